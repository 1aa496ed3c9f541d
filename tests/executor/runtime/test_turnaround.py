"""Several sorties in one flight: the crew changes packs, and says so; on both dialects, in virtual time."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import pytest

from executor.core.interface.intents import Action, IntentReason, Outcome
from executor.core.state.vehicle_state import Stage
from tests.executor.runtime.turns_of_a_day import Crew, Day, DaySky, day_flown
from tests.stories.story import Moment, When, World, asks, at, befalls, told, wants

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime(noop_cycles=2)]
DIALECTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
GOOD = {"P3": 100.0, "P4": 100.0, "P5": 100.0}


def on_sortie(vehicle: str, number: int, flown_m: float = 30.0) -> When:
    """When a vehicle has so much of an inspection of one of its sorties behind it."""

    def due(world: World) -> bool:
        known = world.state.vehicles[vehicle]
        run = known.assignment.run
        return len(known.turn.sorties) == number and run is not None and run.furthest_m >= flown_m

    return due


def told_once(sky: DaySky, pattern: str) -> str:
    found = [line for line in sky.lines if re.search(pattern, line)]
    assert len(found) == 1, "\n".join(sky.lines)
    return found[0]


def starts(sky: DaySky, vehicle: str) -> int:
    return sum(f"{vehicle}: flies its mission" == line for line in sky.lines)


@DIALECTS
async def test_a_day_of_two_vehicles_with_two_sorties_each_survives_a_loss_in_the_second(autopilot: str) -> None:
    day = Day(Crew(GOOD), moments=(told(on_sortie("uav2", 2), "uav2:crash"),))
    sky, flown = await day_flown(day, autopilot)
    assert flown.ended_s is not None
    assert set(flown.inspected) == set(range(8)), "\n".join(sky.lines)
    assert not [line for line in sky.lines if "internal error" in line]
    lost, other = sky.state.vehicles["uav2"], sky.state.vehicles["uav1"]
    assert lost.fault is not None
    assert [flown.inspected[segment] for segment in (6, 7)] == ["uav1", "uav1"]
    assert [sortie.pack for sortie in lost.turn.sorties] == ["", "P4"]
    assert [sortie.pack for sortie in other.turn.sorties][:2] == ["", "P3"]
    assert all(
        record.outcome is Outcome.DONE for record in sky.state.crew.intents.values() if "swap" in record.intent.id
    )
    # Nobody takes off from a base shortly after another one, and nobody starts again before the crew said so.
    began = sorted(sortie.began_s for one in (lost, other) for sortie in one.turn.sorties)
    assert min(later - earlier for earlier, later in itertools.pairwise(began)) >= 10.0
    asked = [record.at_s for record in sky.asked]
    again = [sortie.began_s for one in (lost, other) for sortie in one.turn.sorties[1:]]
    assert all(any(0 < begin - said < 120 for said in asked) for begin in again)


@DIALECTS
async def test_a_bad_pack_is_refused_with_one_line_and_a_better_one_flies(autopilot: str) -> None:
    day = Day(Crew({"P9": 18.0, "P3": 100.0}), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4)
    sky, flown = await day_flown(day, autopilot)
    line = told_once(sky, "uav1: not cleared for take-off")
    assert "pack P9 rests at 3.7" in line
    assert "too close to its reserve of 15 %" in line
    bad, good = (sky.state.crew.intents[record.intent.id] for record in sky.asked)
    assert (bad.outcome, bad.code) == (Outcome.FAILED, IntentReason.PACK_POOR)
    assert good.outcome is Outcome.DONE
    assert set(flown.inspected) == {0, 1, 2, 3}
    assert [sortie.pack for sortie in sky.state.vehicles["uav1"].turn.sorties] == ["", "P3"]


@DIALECTS
async def test_a_pack_that_holds_less_than_it_should_shrinks_the_sortie(autopilot: str) -> None:
    later = {"uav1": ((4, 6, 8, 10, 12, 14),)}
    day = Day(Crew({"P9": 28.0, "P3": 100.0}), first={"uav1": (0, 2)}, later=later)
    sky, flown = await day_flown(day, autopilot)
    told_once(sky, r"pack P9 rests at 3\.\d+ V a cell.*; its budget is \d+ % instead of 75 %")
    told_once(sky, r"uav1: sortie 2: re-planned for its budget")
    by_sortie = [sortie.pack for sortie in sky.state.vehicles["uav1"].turn.sorties]
    assert by_sortie == ["", "P9", "P3"], "\n".join(sky.lines)
    assert set(flown.inspected) == set(range(8))
    assert min(truth.charge_pct or 100.0 for truth in flown.truths) > 15.0


@DIALECTS
async def test_a_ground_station_that_dies_in_a_turnaround_asks_for_confirmation_again(autopilot: str) -> None:
    def under_way(world: World) -> bool:
        turn = world.state.vehicles["uav1"].turn
        return turn.asked_s is not None and turn.ready_s is None and len(turn.sorties) == 1

    day = Day(Crew(GOOD), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4, dies=under_way)
    sky, flown = await day_flown(day, autopilot)
    told_once(sky, "uav1: not cleared for take-off: its turnaround was under way when the ground station went offline")
    assert [record.intent.pack for record in sky.asked] == ["P3", "P4"]
    assert [sortie.pack for sortie in sky.state.vehicles["uav1"].turn.sorties] == ["", "P4"]
    assert set(flown.inspected) == {0, 1, 2, 3}


@DIALECTS
async def test_a_pack_that_earlier_flights_know_is_reckoned_with_by_its_label(autopilot: str) -> None:
    first, later = {"uav1": (0, 2)}, {"uav1": ((4, 6),)}
    day = Day(Crew({"P3": 100.0}), first=first, later=later, segments=4, budgets_pct={"P3": 30.0, "P4": 0.01})
    sky, flown = await day_flown(day, autopilot)
    line = told_once(sky, "uav1: its checks have passed: ")
    assert "; pack P3 has 3.0 Ah, " in line
    assert set(flown.inspected) == {0, 1, 2, 3}
    empty = replace(day, crew=Crew({"P4": 100.0}))
    sky, flown = await day_flown(empty, autopilot)
    told = [record for record in sky.state.crew.intents.values() if record.code is IntentReason.NOTHING_TO_PLAN]
    assert told[0].text == "no open segment is within its budget of 0 %", sky.lines
    assert set(flown.inspected) == {0, 1}


async def test_a_ground_station_that_dies_while_a_sortie_goes_on_board_holds_the_turnaround() -> None:
    def uploading(world: World) -> bool:
        known = world.state.vehicles["uav1"]
        return known.assignment.pending is not None and len(known.turn.sorties) == 1

    day = Day(Crew(GOOD), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4, dies=uploading)
    sky, flown = await day_flown(day, "ardupilot")
    assert set(flown.inspected) == {0, 1, 2, 3}
    assert [sortie.pack for sortie in sky.state.vehicles["uav1"].turn.sorties] == ["", "P3"]
    assert not sky.state.vehicles["uav1"].turn.ahead


async def test_no_vehicle_starts_without_confirmation_and_an_abort_ends_the_day() -> None:
    day = Day(
        Crew(GOOD, confirms=False), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4,
        moments=(wants(at(500), Action.ABORT),),
    )  # fmt: skip
    sky, flown = await day_flown(day, "ardupilot")
    assert starts(sky, "uav1") == 1
    assert "uav1: waiting for pack confirmation: sortie 2, 2 segments" in sky.lines
    assert flown.ended_s is not None
    assert flown.ended_s - flown.began_s >= 490
    assert set(flown.inspected) == {0, 1}


@DIALECTS
async def test_a_vehicle_that_reboots_after_its_checks_is_checked_again(autopilot: str) -> None:
    """Its first sortie waits for the other's take-off; meanwhile somebody unplugs it."""
    unplugged: list[str] = []

    def unplug(world: World) -> None:
        plan = world.state.replanning.replan
        assert plan is not None
        unplugged.extend(name for name in world.state.vehicles if name not in plan.pending)
        befalls(f"{unplugged[0]}:reboot")(world)

    def swap(world: World) -> None:
        asks(Action.SWAP, unplugged[0])(world)

    day = Day(
        Crew({}), first={"uav1": (0, 2), "uav2": (4, 6)}, later={}, segments=4,
        moments=(Moment(at(1), unplug), Moment(at(60), swap)),
    )  # fmt: skip
    sky, flown = await day_flown(day, autopilot)
    [who] = unplugged
    why = "(its autopilot|no position for 10 s: it may) (has|have) rebooted since its checks"
    told_once(sky, f"{who}: not cleared for take-off: {why}; repeat `swap` when fixed")
    told_once(sky, f"{who}: its checks have passed")
    assert starts(sky, who) == 1
    assert set(flown.inspected) == {0, 1, 2, 3}, "\n".join(sky.lines)


async def test_a_vehicle_that_its_pilot_takes_in_its_turnaround_is_not_started() -> None:
    day = Day(
        Crew(GOOD), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4,
        moments=(told(lambda world: world.state.vehicles["uav1"].turn.ready_s is not None
                      and len(world.state.vehicles["uav1"].turn.sorties) == 1, "uav1:pilot={hold}"),
                 wants(at(900), Action.ABORT)),
    )  # fmt: skip
    sky, _ = await day_flown(day, "ardupilot")
    assert starts(sky, "uav1") <= 2


async def test_without_a_day_plan_a_new_pack_flies_what_is_open_while_others_fly() -> None:
    """uav2 holds meanwhile, so that what is open is for nobody else."""
    moments = (wants(at(60), Action.HOLD, "uav2"), wants(at(500), Action.RESUME, "uav2"))
    first = {"uav1": (0,), "uav2": (6,)}
    day = Day(Crew({"P3": 100.0}), first=first, ruled=False, segments=4, moments=moments)
    sky, flown = await day_flown(day, "ardupilot")
    assert set(flown.inspected) == {0, 1, 2, 3}, "\n".join(sky.lines)
    assert sky.state.vehicles["uav1"].turn.sorties[-1].pack == "P3"
    told_once(sky, "uav1: its checks have passed: .*re-planning with it")
    assert not [line for line in sky.lines if "internal error" in line]


async def test_a_sortie_that_does_not_fit_into_its_hours_is_refused() -> None:
    day = Day(
        Crew(GOOD), first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4,
        windows_s=((0.0, 300.0), (900.0, 1500.0)),
    )  # fmt: skip
    sky, flown = await day_flown(day, "ardupilot")
    refused = [record for record in sky.asked if record.code is IntentReason.OUT_OF_HOURS]
    assert refused
    assert refused[0].text.endswith("its next hours begin at T+15:00")
    assert sky.state.vehicles["uav1"].stage is Stage.LANDED
    assert set(flown.inspected) == {0, 1}


@pytest.mark.parametrize(
    ("end_s", "inspected", "sorties"), [(300.0, 2, 1), (400.0, 2, 1), (500.0, 4, 2), (600.0, 6, 2)]
)
async def test_at_the_end_of_its_last_hours_as_much_is_flown_as_there_is_time_for(
    end_s: float, inspected: int, sorties: int
) -> None:
    day = Day(
        Crew(GOOD), first={"uav1": (0, 2)}, later={"uav1": ((4, 6, 8, 10),)}, segments=6, windows_s=((0.0, end_s),)
    )  # fmt: skip
    sky, flown = await day_flown(day, "ardupilot")
    assert set(flown.inspected) == set(range(inspected)), "\n".join(sky.lines)
    assert len(sky.state.vehicles["uav1"].turn.sorties) == sorties
    assert flown.ended_s is not None
    assert flown.ended_s - flown.began_s <= end_s
    assert len([line for line in sky.lines if "can be inspected in the" in line]) == (end_s == 400.0)
    assert bool(sky.asked) is (end_s > 300.0)  # nobody is asked for a pack when no time is left


@pytest.mark.parametrize(
    ("autopilot", "name", "value"), [("ardupilot", "RTL_ALT", 300.0), ("px4", "RTL_RETURN_ALT", 3.0)]
)
async def test_what_vehicles_forgot_as_they_booted_is_set_again(autopilot: str, name: str, value: float) -> None:
    sky, flown = await day_flown(Day(Crew(GOOD), forgets={name: value}), autopilot)
    for vehicle in ("uav1", "uav2"):
        assert f": {name} {value:g} -> " in told_once(sky, f"{vehicle}: parameters set again after reboot: ")
        assert sky.vehicle(vehicle).autopilot.params[name] in {5.0 * value, 7.0 * value}
    assert set(flown.inspected) == set(range(8)), "\n".join(sky.lines)
    assert all(record.outcome is Outcome.DONE for record in sky.state.crew.intents.values())
