"""Files with right and wrong heights, sixty with the campaign: refused in a line, or flown well above everything."""

from __future__ import annotations

from pathlib import Path

import pytest

from executor.cli.main import main
from tests.executor.height_files import KINDS, HeightFile, height_file
from tests.executor.height_judge import too_low

MARGIN_M = 10.0
"""Two thirds of the 15 m that a site asks for by default."""
NAMES_A_KEY = ("elevation_m", "height_m", "alt_m", "third coordinate", "heights: ")


def site_of(folder: Path, file: HeightFile) -> Path:
    (folder / "line.geojson").write_text(file.geojson(), encoding="utf-8")
    vehicles = "".join(
        f'[[vehicle]]\nname = "uav{number}"\nconnection = "udpin://127.0.0.1:{14550 + number}"\nsysid = {number}\n'
        'autopilot = "ardupilot"\nbudget_pct = 85\n'
        for number in (1, 2, 3)
    )
    site = folder / "site.toml"
    site.write_text(
        f'[network]\nfile = "line.geojson"\n[inspection]\nheights = "{file.heights}"\n{vehicles}', encoding="utf-8"
    )
    return site


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert isinstance(ended.value.code, int)
    return ended.value.code


def judged(folder: Path, file: HeightFile, capsys: pytest.CaptureFixture[str]) -> str:
    """Plan and export; returns the refusal, or nothing for what was flown with the margin."""
    site, plan, missions = site_of(folder, file), folder / "plan.json", folder / "missions"
    code = called("plan", str(site), "--seconds", "0.05", "--starts", "1", "--all-vehicles", "-o", str(plan))
    refusal = capsys.readouterr().err.strip()
    if code == 2:
        assert len(refusal.splitlines()) == 1
        assert str(folder / "line.geojson") in refusal
        assert any(key in refusal for key in NAMES_A_KEY), refusal
        assert not plan.exists()
        return refusal
    assert code == 0, refusal
    assert called("export", str(plan), "-o", str(missions)) == 0
    capsys.readouterr()
    flown = sorted(missions.glob("*.plan"))
    assert flown
    assert [line for path in flown for line in too_low(path, file.lines, MARGIN_M)][:3] == []
    return ""


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_is_refused_or_flown_with_the_margin(
    tmp_path: Path, kind: str, seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    file = height_file(kind, seed)
    refusal = judged(tmp_path, file, capsys)
    print(kind, "|", refusal or "flown")
    assert file.must == "either" or (file.must == "refused") == bool(refusal)


def test_the_judge_sees_a_line_that_is_flown_through(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A judge that finds nothing wrong anywhere would be worth nothing: lines that are higher than their file says."""
    file = height_file("good", 1)
    assert judged(tmp_path, file, capsys) == ""
    path = tmp_path / "missions" / "uav1.plan"
    assert too_low(path, file.lines, MARGIN_M) == []
    assert too_low(path, file.lines, MARGIN_M + 6.0) != []
