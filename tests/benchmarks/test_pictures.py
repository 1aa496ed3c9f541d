"""The bench of pictures on a small flight, and what it makes of figures known beforehand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks import pictures
from benchmarks.commands import cli
from benchmarks.parallel_flights import FlightCase
from benchmarks.pictures import PicturesFlight, fly_pictures, pictures_results
from benchmarks.picturespage import pictures_document, report_pictures
from executor.images.matching import match_files

GOOD = PicturesFlight(
    number=3, autopilot="px4", vehicles=3, camera="speaks", faults=("uav3:camera-silent@57%", "uav1:crash@40%"),
    assets=27, seen=20, named=7, taken=232, indexed=230, excused=2, files=232, matched=230, flown_s=600.0,
)  # fmt: skip


def test_a_small_flight_is_what_its_index_and_its_cards_say() -> None:
    flown = fly_pictures(FlightCase(1, 1, "px4"))
    assert (flown.wrong, flown.not_flown, flown.camera) == ((), "", "speaks")
    assert flown.seen + flown.named == flown.assets > 0
    assert flown.indexed + flown.excused == flown.taken == flown.files > 0
    assert flown.matched == flown.indexed


def test_a_card_of_another_vehicle_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were every file taken for the first row of the index, the judge would say so."""

    def confused(index, files, folder):  # type: ignore[no-untyped-def]
        found = match_files(index, files, folder)
        return replace(found, matches=tuple(replace(match, image=index.images[0]) for match in found.matches))

    monkeypatch.setattr(pictures, "match_files", confused)
    flown = fly_pictures(FlightCase(1, 1, "px4"))
    assert len(flown.wrong) >= flown.matched - 1
    assert all("is taken for picture" in line for line in flown.wrong)


def test_what_went_wrong_has_a_line_with_its_flight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flights = [GOOD, replace(GOOD, number=4, wrong=("5 was not seen, and is not named",)),
               replace(GOOD, number=5, not_flown="uav1: not ready")]  # fmt: skip
    found = pictures_results(flights)
    assert (found["flights"], found["taken"], found["faults"]) == (2, 464, {"camera-silent": 2, "crash": 2})
    [line] = found["wrong"]
    assert line == ("flight 4 (px4, speaks, uav3:camera-silent@57%, uav1:crash@40%): 5 was not seen, and is not named")
    content = pictures_document(flights, "faultline bench pictures --flights 3 --seed 1", 1)
    report_pictures(content).keep(tmp_path)
    assert json.loads((tmp_path / "pictures.json").read_text())["indexed"] == 460
    page = (tmp_path / "pictures.md").read_text()
    assert "- not flown: flight 5: uav1: not ready" in page
    assert "| pictures on the cards | 464 |" in page
    report_pictures(content).show()
    assert "2 went wrong" in " ".join(capsys.readouterr().out.split())


def test_the_command_ends_with_one_where_something_went_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "fly_pictures", lambda _: GOOD)
    result = CliRunner().invoke(cli, ["pictures", "--flights", "1", "--seed", "5", "-o", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout.strip().splitlines()[-1])
    assert content["command"] == "faultline bench pictures --flights 1 --seed 5"
    monkeypatch.setattr(pictures, "fly_pictures", lambda _: replace(GOOD, wrong=("a",)))
    assert CliRunner().invoke(cli, ["pictures", "--flights", "1"]).exit_code == 1
