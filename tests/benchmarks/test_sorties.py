"""The bench of days of sorties on a small one, and what it makes of figures known beforehand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks import sorties
from benchmarks.commands import cli
from benchmarks.sorties import SortiesCase, SortiesDay, fly_sorties, sorties_over, sorties_site, went_wrong
from benchmarks.sortiespage import report_sorties, sorties_document

GOOD = SortiesDay(
    number=1, autopilot="px4", segments=97, planned_sorties=48, planned_s=7000.0, losses=("uav3 after 1093 s",),
    died_s=(3899.4,), bad_packs=("P7: 18 %",), sorties=49, swaps=48, inspected=90, named=7, replans=3,
    least_pct=25.3, reserve_pct=15.0, nearest_m=13.7, nearest="uav1 and uav2 after 9413 s", flown_s=10186.2,
)  # fmt: skip


def test_a_small_day_is_flown_with_changed_packs_losses_and_a_dead_ground_station() -> None:
    day = fly_sorties(SortiesCase(0, 1, "px4", 2000, sorties_over(None, 600.0)))
    assert went_wrong(day) == []
    assert len(day.losses) == sorties.LOSSES
    assert day.swaps > 0
    assert day.sorties > sorties.VEHICLES
    assert day.inspected + day.named == day.segments
    assert sorties.APART_M <= day.nearest_m < 100.0
    assert day.reserve_pct <= day.least_pct < 100.0


@pytest.mark.parametrize(
    ("spoilt", "line"),
    [
        ({"wrong": "the supervision did not end"}, "the supervision did not end"),
        ({"unproven": (4,)}, "segment 4 counts, but no vehicle flew along it"),
        ({"below": ("uav1 after 60 s with 9.0 %",)}, "below its reserve of 15 %: uav1 after 60 s with 9.0 %"),
        ({"nearest_m": 4.99}, "4.99 m apart: uav1 and uav2 after 9413 s"),
        ({"inspected": 89}, "1 segments neither inspected nor named"),
        ({"strays": ("uav1 stood 7.0 m from its pad",)}, "uav1 stood 7.0 m from its pad"),
        ({"mistakes": ("internal error at Tick",)}, "internal error at Tick"),
    ],
)
def test_whatever_should_not_have_come_of_a_day_has_a_line(spoilt: dict[str, object], line: str) -> None:
    assert went_wrong(GOOD) == []
    assert went_wrong(replace(GOOD, **spoilt)) == [f"day 2 (px4): {line}"]  # type: ignore[arg-type]


def test_the_page_says_what_happened_and_what_went_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = sorties_document([GOOD, replace(GOOD, number=2, nearest_m=3.0)], "faultline bench sorties --days 2", 1)
    report_sorties(content).keep(tmp_path)
    assert json.loads((tmp_path / "sorties.json").read_text())["days"] == content["days"]
    page = (tmp_path / "sorties.md").read_text()
    assert "| 2 | px4 | 49 | 48 | 2.8 | 90 of 97 | 7 | 25.3 | 13.7 |" in page
    assert "| 2 | uav3 after 1093 s | 3899 | P7: 18 % |" in page
    assert "- day 3 (px4): 3.00 m apart: uav1 and uav2 after 9413 s" in page
    report_sorties(content).show()
    assert "1 went wrong" in " ".join(capsys.readouterr().out.split())


def test_over_another_network_bases_stand_where_most_is_near(tmp_path: Path) -> None:
    places_m = (0, 300, 600, 900, 50_000, 50_300, 50_600, 90_000, 90_300)
    joined = ("2", "1 3", "2 4", "3", "6", "5 7", "6", "9", "8")
    network = tmp_path / "far.yaml"
    network.write_text(
        'pylons_position = "' + " ".join(f"{east_m} 500 0;" for east_m in places_m) + '"\n'
        'connections_indexes = "' + " ".join(f"{others};" for others in joined) + '"\n'
    )
    site = sorties_site("px4", sorties_over(network, None))
    assert site["network"] == {"file": str(network)}
    assert [base["vehicles"] for base in site["base"]] == [["uav1", "uav2"], ["uav3", "uav4"], ["uav5"], ["uav6"]]
    east_deg = [base["lon_deg"] for base in site["base"][:3]]
    assert sorted(east_deg) == east_deg
    assert east_deg[1] - east_deg[0] == pytest.approx(50_000 / 72_300, rel=0.05)
    content = sorties_document([GOOD], "faultline bench sorties", 1, sorties_over(network, None))
    assert content["over"] == {"network": "far.yaml", "pack_ah": 6.5, "speed_m_s": 1.0, "hours": 8}


def test_the_command_flies_by_turns_and_ends_with_one_where_something_went_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[SortiesCase] = []

    def flown(case: SortiesCase) -> SortiesDay:
        asked.append(case)
        return replace(GOOD, number=case.number, autopilot=case.autopilot)

    monkeypatch.setattr(sorties, "fly_sorties", flown)
    command = ["sorties", "--days", "2", "--jobs", "1", "--seed", "5", "--radius", "700", "-o", str(tmp_path), "--json"]
    result = CliRunner().invoke(cli, command)
    assert result.exit_code == 0, result.output
    assert [(case.autopilot, case.seed, case.over.radius_m) for case in asked] == [
        ("ardupilot", 5, 700.0),
        ("px4", 5, 700.0),
    ]
    content = json.loads(result.stdout.strip().splitlines()[-1])
    assert content["command"] == "faultline bench sorties --radius 700 --days 2 --seed 5 --iterations 20000"
    monkeypatch.setattr(sorties, "fly_sorties", lambda _: replace(GOOD, nearest_m=1.0))
    assert CliRunner().invoke(cli, ["sorties", "--days", "1"]).exit_code == 1
