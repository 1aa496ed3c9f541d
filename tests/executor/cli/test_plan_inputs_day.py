"""`plan --day`: days planned, told, drawn, kept and checked; what cannot be used is refused in one line."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executor.analysis.documents import AskedVehicles, SortieRow, VehicleRow, read_flown_day_plan
from executor.analysis.report import build_vehicle_answers
from executor.cli import flights
from executor.cli.main import main
from executor.core.context import PackRules
from executor.flight.run_start import FlightRequest, read_run_start, write_run_start
from executor.site.day_plans import build_day_rules, sorties_ahead_of
from executor.site.plan_summary import describe_day
from missions import DayPlanFile, read_day_plan
from planner import segment_of
from tests.executor.flights import short_report

VEHICLES = "".join(
    f'[[vehicle]]\nname = "uav{number}"\nconnection = "udpin://127.0.0.1:{14550 + number}"\nsysid = {number}\n'
    f'autopilot = "{autopilot}"\n'
    for number, autopilot in ((1, "px4"), (2, "ardupilot"))
)
NORTH = '[[base]]\nname = "north"\nlat_deg = 49.6120\nlon_deg = 15.6344\nvehicles = ["uav1"]\npacks = 9\n'
SOUTH = (
    '[[base]]\nname = "south"\nlat_deg = 49.5895\nlon_deg = 15.5930\nvehicles = ["uav2"]\npacks = 8\n'
    "recharge_s = 1800\n"
)
PEAK = '[[base]]\nname = "peak"\nlat_deg = 49.6000\nlon_deg = 15.6100\nalt_m = 800\n'
DAY = '[day]\nbegin = "08:00"\nend = "11:00"\nlands = "any"\nroad_m_s = 8\n'
NETWORK = '[network]\nfile = "default"\nradius_m = 1200\n'
FAST = ("--seconds", "0.5", "--starts", "1")


def inspector(segments: Collection[int]) -> VehicleRow:
    """Return the row of a vehicle that has inspected some segments."""
    return VehicleRow(
        name="uav1", segments=tuple(sorted(segments)), energy_used_pct=1.0, landed=True, min_reserve_pct=None
    )


class Place:
    """A folder with a site, and the command line in it."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self._capsys = capsys

    def write(self, *parts: str) -> None:
        (self.folder / "site.toml").write_text("".join(parts), encoding="utf-8")

    def plan(self, *arguments: object) -> tuple[int, str, str]:
        return self.call("plan", "site.toml", "--day", *FAST, *arguments)

    def call(self, *arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(one) for one in arguments])
        said = self._capsys.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, said.out, said.err


@pytest.fixture
def place(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Place:
    """Return a folder whose site has two bases."""
    monkeypatch.chdir(tmp_path)
    made = Place(tmp_path, capsys)
    made.write(NETWORK, DAY, NORTH, SOUTH, VEHICLES)
    return made


def test_a_day_is_planned_printed_drawn_kept_and_checked(place: Place) -> None:
    code, out, _ = place.plan("-o", "day.json", "--picture", "day.png")
    assert code == 0
    assert "finished on day 1 at" in out
    assert "base north:" in out
    assert "of 9 packs" in out
    assert "may be lost" in out
    assert (place.folder / "day.png").read_bytes().startswith(b"\x89PNG")
    assert place.call("check", "day.json")[:2] == (0, "every figure is right\n")


def test_a_day_as_json_is_the_file_with_what_it_needs(place: Place) -> None:
    code, out, _ = place.plan("--json", "-o", "day.json")
    told, kept = json.loads(out), json.loads((place.folder / "day.json").read_text())
    assert code == 0
    assert {key: told[key] for key in kept} == kept
    assert [one["name"] for one in told["needs"]] == ["north", "south"]
    assert sum(one["sorties"] for one in told["needs"]) == len(kept["routes"])
    visited = [visit["segment"] for one in kept["routes"] for visit in one["visits"]]
    assert sorted(visited) == sorted(one["id"] for one in kept["segments"])


def test_a_loss_on_a_day_is_answered_with_the_days_that_the_others_fly(place: Place) -> None:
    place.plan("-o", "day.json")
    day = read_day_plan(place.folder / "day.json")
    first = day.routes_of("uav1")[0]
    at_s = first.start_s + first.duration_s / 2
    code, out, err = place.call("replan", "day.json", "--lost", "uav1", "--at", at_s, "--json", "-o", "after.json")
    assert code in {0, 1}, err
    told, after = json.loads(out), read_day_plan(place.folder / "after.json")
    assert (code, told["left_over"]) == (0, []) or (code == 1 and told["left_over"])
    assert not after.routes_of("uav1")
    assert after.routes_of("uav2")[0].start_s == day.routes_of("uav2")[0].start_s
    assert place.call("check", "after.json")[:2] == (0, "every figure is right\n")
    code, out, _ = place.call("replan", "day.json", "--lost", "uav1", "--at", day.finish_s)
    assert code == 0
    assert out.startswith("\n".join(describe_day(replace(day, windows=())))[:200])


def test_every_command_takes_a_day_or_says_in_one_line_that_it_takes_a_flight(place: Place) -> None:
    place.plan("-o", "day.json")
    kept = json.loads((place.folder / "day.json").read_text())
    assert kept["format"] == "faultline-plan/2"
    assert [one["autopilot"] for one in kept["vehicles"]] == ["px4", "ardupilot"]
    code, out, _ = place.call("window", "day.json", "--json")
    assert (code, json.loads(out)) == (0, {"windows": kept["windows"]})
    code, out, _ = place.call("window", "day.json")
    assert (code, out.count("may be lost")) == (0, 2)
    for command in (
        ("window", "day.json", "--picture", "day.png"),
        ("replan", "day.json", "--lost", "uav1", "--at", 60, "--seconds", 1),
        ("export", "day.json", "-o", "out"),
        ("risk", "day.json", "--mtbf", 5),
    ):
        code, _, err = place.call(*command)
        assert (code, err.count("\n")) == (2, 1), command
        assert "day plan" in err


def test_a_day_with_something_left_over_has_no_window(place: Place) -> None:
    place.write(NETWORK, DAY.replace("11:00", "08:30"), NORTH.replace("packs = 9", "packs = 1"), SOUTH, VEHICLES)
    place.plan("-o", "day.json")
    assert place.call("window", "day.json")[:2] == (0, "no window: segments are left over, or nothing is flown\n")


def spoilt(document: dict[str, Any], key: str, value: object) -> str:
    document["routes"][0][key] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("key", "value", "code", "expected"),
    [
        ("duration_s", 1.0, 1, "sortie 1 of uav1: duration_s is 1"),
        ("energy_pct", 1.0, 1, "energy_pct is 1"),
        ("start_s", 0.0, 1, "flies outside of its hours"),
        ("base", "south", 1, "duration_s"),
        ("base", "east", 2, "routes[0].base: expected one of north, south, got east"),
        ("vehicle", "uav9", 2, "routes[0].vehicle: expected one of uav1, uav2, got uav9"),
        ("visits", [], 2, "routes[0].visits"),
        (
            "visits",
            [{"segment": 5000, "reversed": False}],
            2,
            "visits[0].segment: expected the id of a segment, got 5000",
        ),
    ],
)
def test_a_day_plan_that_does_not_hold(place: Place, key: str, value: object, code: int, expected: str) -> None:
    place.plan("-o", "day.json")
    path = place.folder / "day.json"
    path.write_text(spoilt(json.loads(path.read_text()), key, value))
    answered, out, err = place.call("check", "day.json")
    assert answered == code
    assert expected in out + err
    assert code == 1 or err.count("\n") == 1


def test_without_bases_the_depot_is_the_only_one(place: Place) -> None:
    place.write(NETWORK, VEHICLES)
    code, out, _ = place.plan()
    assert code == 0
    assert "base depot:" in out


def test_what_finds_no_day_is_named_and_a_no(place: Place) -> None:
    place.write(NETWORK, DAY.replace("11:00", "08:30"), NORTH.replace("packs = 9", "packs = 1"), SOUTH, VEHICLES)
    code, out, _ = place.plan()
    assert code == 1
    assert "left over, within reach, but no time is left: " in out


def test_quiet_hours_roads_and_cameras_hold(place: Place) -> None:
    more = (
        '[[day.quiet]]\nbegin = "08:10"\nend = "09:30"\nvehicles = ["uav2"]\n'
        '[[day.road]]\nbetween = ["north", "south"]\nminutes = 30\n'
        '[[day.vehicle]]\nname = "uav1"\nspeed_m_s = 4\n'
    )
    place.write(NETWORK, DAY, more, NORTH, SOUTH, VEHICLES)
    code, out, _ = place.plan("--json", "--objective", "swaps")
    told = json.loads(out)
    assert code == 0
    assert told["transfers_s"][0][1] == 1800.0
    assert [own["inspection_speed_m_s"] for own in told["model"]["models"].values()] == [4.0, 3.0]
    for one in told["sorties"]:
        if one["vehicle"] == "uav2":
            assert one["start_s"] + one["duration_s"] <= 8 * 3600 + 600 or one["start_s"] >= 9.5 * 3600


def test_a_day_is_planned_and_flown_and_the_next_one_continues(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[FlightRequest] = []
    monkeypatch.setattr(flights, "_fly_and_finish", lambda order, *_, **__: flown.append(order))
    place.write(NETWORK, DAY.replace('"any"\nroad_m_s = 8', '"own"'), NORTH, SOUTH, VEHICLES)
    code, _, err = place.call("day", "site.toml", "--seconds", "0.5", "--starts", "1", "--run", "one")
    assert (code, flown[0].earlier) == (0, ())
    assert flown[0].day is not None
    planned = {segment.id for segment in flown[0].day.segments}
    assert "sorties" in err
    write_run_start(flown[0])
    left = sorted(planned)[:3]
    report = short_report(left).model_copy(
        update={"sorties": (SortieRow(vehicle="uav1", number=1, pack="", began_s=0, ended_s=9, began_pct=99,
                                      ended_pct=80, rest_v=None, segments=(4, 5)),)}
    )  # fmt: skip
    report.write(place.folder / "one" / "report.json")
    code, _, _ = place.call("day", "site.toml", "--after", "one", "--seconds", "0.5", "--starts", "1")
    assert code == 0
    assert flown[1].day is not None
    assert [segment.id for segment in flown[1].day.segments] == left
    assert [(row.run, row.sorties) for row in flown[1].earlier] == [("one", 1)]


LATER_DAYS = DAY.replace("11:00", "08:20").replace('"any"\nroad_m_s = 8', '"own"') + "days = 3\n"


def test_the_days_of_a_plan_are_flown_one_after_the_other(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[FlightRequest] = []
    monkeypatch.setattr(flights, "_fly_and_finish", lambda order, *_, **__: flown.append(order))

    def fly(run: str, after: str, left: Collection[int]) -> DayPlanFile:
        """Fly the next day and write its report: of what it was for, `left` stays open."""
        code, _, _ = place.call("fly", "site.toml", "--plan", "days.json", *(("--after", after) if after else ()),
                                "--run", run)  # fmt: skip
        assert code == 0
        order = flown[-1]
        write_run_start(order)
        whole = {segment.id for segment in order.plan.segments}
        short_report(sorted(left)).model_copy(
            update={"earlier": order.earlier, "vehicles": (inspector(whole - set(left)),)}
        ).write(place.folder / run / "report.json")
        assert order.day is not None
        kept = read_flown_day_plan(place.folder / run)
        assert kept is not None
        assert sorties_ahead_of(kept) == sorties_ahead_of(order.day)
        return order.day

    place.write(NETWORK, LATER_DAYS, NORTH, SOUTH, VEHICLES)
    assert place.plan("-o", "days.json")[0] == 0
    whole = read_day_plan(place.folder / "days.json")
    planned = [
        {visit.segment for one in whole.routes_on(day) for visit in one.visits} for day in range(len(whole.days))
    ]
    assert all(planned)

    lost = min(planned[0])  # the first day leaves one of its segments, and does one of the second day's
    done = min(planned[1])
    first = fly("one", "", {lost} | planned[1] - {done} | planned[2])
    assert (first.first_day, first.part_of) == (1, None)
    second = fly("two", "one", {lost} | planned[2])
    assert (second.first_day, second.part_of) == (2, whole.schedule_id)
    assert {segment_of(visit) for own in sorties_ahead_of(second).values() for one in own for visit in one.visits} == (
        planned[1] - {done}
    )
    assert {second.segments[place].id for place in second.plan.uncovered} == {lost} | planned[2]
    assert min(own[0].start_s for own in sorties_ahead_of(second).values() if own) == 0.0
    assert build_day_rules(second).ends_s == pytest.approx(20 * 60.0, abs=60.0)
    third = fly("three", "two", {lost})
    assert (third.first_day, [(row.run, row.day) for row in flown[-1].earlier]) == (3, [("one", 1), ("two", 2)])

    code, _, err = place.call("fly", "site.toml", "--plan", "days.json", "--after", "three")
    assert code == 2
    assert err.splitlines()[-1] == (
        "faultline: days.json: no day of it is left for 1 open segment; plan the rest: "
        "faultline plan site.toml --day --after three -o FILE"
    )
    short_report([]).model_copy(
        update={"earlier": flown[-1].earlier, "vehicles": (inspector({lost} | planned[2]),)}
    ).write(place.folder / "three" / "report.json")
    for command in (("fly", "days.json", "--site", "site.toml"), ("preflight", "site.toml", "--plan", "days.json")):
        code, _, err = place.call(*command, "--after", "three")
        assert (code, err.splitlines()[-1].endswith("everything is inspected; nothing is left to fly")) == (0, True)


def test_a_run_directory_from_before_packs_were_counted_is_read_without_them(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[FlightRequest] = []
    monkeypatch.setattr(flights, "_fly_and_finish", lambda order, *_, **__: flown.append(order))
    place.write(NETWORK, LATER_DAYS, NORTH, SOUTH, VEHICLES)
    assert place.call("day", "site.toml", "--seconds", "0.5", "--starts", "1", "--run", "one")[0] == 0
    write_run_start(flown[0])
    run, counted = place.folder / "one", {"north": PackRules(9), "south": PackRules(8, 1800.0)}
    for answers in (AskedVehicles(vehicles=(), counts_packs=True), AskedVehicles(vehicles=())):
        answers.write(run / "vehicles.json")
        context = read_run_start(run).context
        assert context.day is not None
        assert context.day.packs == (counted if answers.counts_packs else {})
        assert build_vehicle_answers(context, {}) == answers
    assert "counts_packs" not in (run / "vehicles.json").read_text()


def test_the_next_day_is_flown_without_a_vehicle_that_is_lost(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[FlightRequest] = []
    monkeypatch.setattr(flights, "_fly_and_finish", lambda order, *_, **__: flown.append(order))
    place.write(NETWORK, LATER_DAYS, NORTH, SOUTH, VEHICLES)
    assert place.plan("-o", "days.json")[0] == 0
    assert place.call("fly", "site.toml", "--plan", "days.json", "--run", "one")[0] == 0
    write_run_start(flown[0])
    ids = [segment.id for segment in flown[0].plan.segments]
    short_report(ids[1:]).model_copy(update={"vehicles": (inspector(ids[:1]),)}).write(
        place.folder / "one" / "report.json"
    )
    alone = NORTH.replace('["uav1"]', "[]"), SOUTH, VEHICLES[VEHICLES.rindex("[[vehicle]]") :]
    place.write(NETWORK, LATER_DAYS, *alone)
    code, _, err = place.call("fly", "site.toml", "--plan", "days.json", "--after", "one", "--run", "two")
    assert (code, err.count("day 2 of 3")) == (0, 1)
    assert flown[1].day is not None
    assert [own.name for own in flown[1].day.vehicles] == ["uav2"]
    assert [segment.id for segment in flown[1].day.segments] == ids[1:]
    code, _, err = place.call("fly", "site.toml", "--plan", "days.json", "--run", "three")
    assert (code, "expected uav2 as in the site" in err) == (2, True)


def test_nothing_is_planned_for_a_spare(place: Place) -> None:
    place.write(NETWORK, DAY, '[[day.vehicle]]\nname = "uav2"\nspare = true\n', NORTH, SOUTH, VEHICLES)
    code, out, _ = place.plan("--json")
    told = json.loads(out)
    assert code == 0
    assert {one["vehicle"] for one in told["sorties"]} == {"uav1"}
    assert all("segments" not in one for one in told["vehicles"])


def test_how_many_vehicles_and_packs_are_needed(place: Place) -> None:
    code, out, _ = place.plan("--mtbf-hours", "1000000", "--samples", "10", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["fleets"][0]["probability"] == 1.0
    assert [one["vehicles"] for one in told["needed"]] == [told["fleets"][0]["vehicles"]] * 2
    assert told["rule_packs"]["north"] is None
    code, out, _ = place.plan("--mtbf-hours", "0.3", "--samples", "6", "--probability", "99")
    assert code == 0
    assert "vehicles finish in" in out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--front",), "--front: expected none with --day"),
        (("--cost", "minmax"), "--cost: expected none with --day"),
        (("--objective", "speed"), "'speed' is not one of 'finish', 'flight', 'swaps'"),
        (("--probability", "95,x"), "--probability: expected percentages"),
        (("-o", "nowhere/day.json"), "there is no directory"),
    ],
)
def test_options_that_do_not_fit(place: Place, arguments: tuple[str, ...], expected: str) -> None:
    code, _, err = place.plan(*arguments)
    assert code == 2
    assert expected in err
    assert err.count("\n") == 1


def test_options_of_days_need_a_day(place: Place) -> None:
    code, _, err = place.call("plan", "site.toml", "--mtbf-hours", "5")
    assert (code, err.count("\n")) == (2, 1)
    assert "--mtbf-hours: expected --day with it" in err
    code, _, err = place.plan("--jobs", "2")
    assert (code, err.count("\n")) == (2, 1)
    assert "--jobs: expected --mtbf-hours with it" in err


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((DAY.replace("08:00", "8 o'clock"), NORTH, SOUTH), "day.begin"),
        ((DAY.replace("11:00", "07:00"), NORTH, SOUTH), "end: expected a time after begin, 08:00, got '07:00'"),
        ((DAY.replace('"any"', '"own"'), NORTH, SOUTH), "lands: expected 'any' with roads"),
        ((DAY, NORTH), "base: expected every vehicle at one, got none for 'uav2'"),
        ((DAY, NORTH, SOUTH.replace("uav2", "uav7")), "base[1].vehicles: expected one of uav1, uav2, got 'uav7'"),
        ((DAY, NORTH, SOUTH.replace("uav2", "uav1")), "base[1].vehicles: expected each vehicle at one base"),
        ((DAY, NORTH, SOUTH.replace("south", "north")), "base[1].name: expected a name of its own"),
        ((DAY, NORTH.replace("packs = 9", "packs = -1"), SOUTH), "base[0].packs"),
        ((DAY, '[[day.road]]\nbetween = ["north", "x"]\nminutes = 1\n', NORTH, SOUTH), "day.road[0].between"),
        ((DAY, '[[day.quiet]]\nbegin = "09:00"\nend = "08:00"\n', NORTH, SOUTH), "expected a time after begin, 09:00"),
        ((DAY, '[[day.vehicle]]\nname = "uav1"\nspeed_m_s = 90\n', NORTH, SOUTH), "day.vehicle[0].speed_m_s"),
        ((DAY, '[[day.vehicle]]\nname = "uav1"\nsegments = ["no"]\n', NORTH, SOUTH), "day.vehicle[0].segments"),
        ((DAY, NORTH + "alt_m = 800\n", SOUTH), "flight heights of 5 m or more over the pad of uav1"),
        ((DAY, NORTH, SOUTH, PEAK), "base peak: expected flights 5 m or more over it"),
    ],
)
def test_days_that_cannot_be_used(place: Place, parts: tuple[str, ...], expected: str) -> None:
    place.write(NETWORK, *parts, VEHICLES)
    code, _, err = place.plan()
    assert code == 2
    assert expected in err
    assert err.count("\n") == 1


CLOSED = (
    '[[area]]\nname = "quarry"\n'
    "polygon = [[49.6020, 15.6110], [49.6035, 15.6110], [49.6035, 15.6160], [49.6020, 15.6160]]\n"
)
OWN = DAY.replace('"any"\nroad_m_s = 8', '"own"')


def not_reachable(out: str) -> list[str]:
    return [line for line in out.splitlines() if line.startswith("not reachable, ")]


def test_what_an_area_closes_a_day_cannot_reach_either(place: Place) -> None:
    place.write(NETWORK, OWN, NORTH, SOUTH, VEHICLES)
    assert place.plan("-o", "before.json")[0] == 0
    place.write(NETWORK, OWN, CLOSED, NORTH, SOUTH, VEHICLES)
    flight, day = place.call("plan", "site.toml", *FAST), place.plan("-o", "day.json")
    assert (flight[0], day[0]) == (1, 1)
    assert not_reachable(day[1]) == not_reachable(flight[1]) != []
    assert "lies in area 'quarry': " in not_reachable(day[1])[0]
    place.call("plan", "site.toml", *FAST, "-o", "plan.json")
    kept, single = (json.loads((place.folder / name).read_text()) for name in ("day.json", "plan.json"))
    assert kept["unreachable"] == single["unreachable"]
    assert [one["id"] for one in kept["segments"]] == [one["id"] for one in single["segments"]]
    assert kept["model"]["kept_out"] == single["model"]["kept_out"]
    assert place.call("check", "day.json")[:2] == (0, "every figure is right\n")
    for command in (("fly", "before.json", "--site", "site.toml"), ("preflight", "site.toml", "--plan", "before.json")):
        code, _, err = place.call(*command)
        assert (code, err.count("\n")) == (2, 1)
        assert "the site has changed: " in err
        assert "lies in area 'quarry'" in err


def test_a_day_lands_at_no_base_in_an_area(place: Place) -> None:
    closed = CLOSED.replace("49.6020", "49.6115").replace("49.6035", "49.6125")
    closed = closed.replace("15.6110", "15.6340").replace("15.6160", "15.6350")
    place.write(NETWORK, DAY, closed, NORTH, SOUTH, VEHICLES)
    code, _, err = place.plan()
    assert (code, err.count("\n")) == (2, 1)
    assert "base north: expected 10 m or more outside of area 'quarry', got a place in it" in err
