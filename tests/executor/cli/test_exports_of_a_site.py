"""What a plan file does not hold of its site is taken from the site, or the export is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import tomlkit

from executor.cli.main import main
from missions import write_plan
from tests.executor.site.keys import AREA, BASE, BASES, LOOK, PLACE, Changes, Tables, changed, load, write_files

TRIGGER_BY_DISTANCE = 206
"""MAV_CMD_DO_SET_CAM_TRIGG_DIST."""


def planned(tables: Tables, folder: Path) -> tuple[Path, Path]:
    """Return a site file and the file of its plan."""
    write_files(folder)
    site, plan = folder / "site.toml", folder / "plan.json"
    site.write_text(tomlkit.dumps(tables))
    write_plan(plan, load(tables, folder).plan)
    return site, plan


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    return int(ended.value.code or 0)


@pytest.mark.parametrize(
    ("needs", "words"),
    [
        (LOOK, "plan.json: cameras"),
        (BASES, "stands on a pad of its site"),
        (PLACE, "plan.json: uav1 stands on a pad of its site"),
    ],
)  # fmt: skip
def test_a_plan_that_needs_its_site_is_exported_beside_it(
    needs: Changes, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, plan = planned(changed(BASE, *needs), tmp_path)
    assert run("export", plan, "-o", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert f"{words}: expected --site with the site file that the plan was made of\n" in said
    assert run("export", plan, "-o", tmp_path / "out", "--site", site) == 0
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"uav1.plan", "uav2.plan"}


def test_cameras_are_triggered_by_the_missions_that_are_exported(tmp_path: Path) -> None:
    site, plan = planned(changed(BASE, *LOOK), tmp_path)
    assert run("export", plan, "-o", tmp_path / "out", "--site", site) == 0
    for name in ("uav1", "uav2"):
        items = json.loads((tmp_path / "out" / f"{name}.plan").read_text())["mission"]["items"]
        assert TRIGGER_BY_DISTANCE in [item["command"] for item in items]


def test_missions_above_the_ceiling_are_not_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, plan = planned(changed(BASE, ("inspection.ceiling_m", 30.0)), tmp_path)
    assert run("export", plan, "-o", tmp_path / "out") == 2
    assert "m over the ground near" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_plan_around_an_area_holds_all_that_its_missions_need(tmp_path: Path) -> None:
    _, plan = planned(changed(BASE, *AREA), tmp_path)
    assert run("export", plan, "-o", tmp_path / "out") == 0
