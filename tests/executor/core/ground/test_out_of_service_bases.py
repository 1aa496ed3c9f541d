"""Bases of a day that are closed and opened, and vehicles that join it, in virtual time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import DayRules
from executor.core.interface.intents import Action, Intent, IntentReason, Outcome
from executor.core.operator import intent_refusals
from executor.core.state.vehicle_state import FaultCode, Stage
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import FLEET, NOW_S, flying
from tests.executor.runtime.turns_of_a_day import Crew, Day, DaySky, day_flown
from tests.stories.story import Moment, When, World, at, wants

pytestmark = pytest.mark.looptime(noop_cycles=2)
FULL = {f"P{number}": 100.0 for number in range(3, 9)}
BASES = {"uav1": "west", "uav2": "east"}


def crew_asks(when: When, action: Action, base: str) -> Moment:
    def ask(world: World) -> None:
        assert isinstance(world, DaySky)
        assert world.flight is not None
        record = world.flight.submit_intent(
            Intent(f"{action.value}-{base}-{world.now_s}", action, None, "page", base=base)
        )
        assert record.outcome is Outcome.DONE, record.text

    return Moment(when, ask)


def in_stage(vehicle: str, stage: Stage, *, armed: bool = False, sorties: int = 1) -> When:
    def due(world: World) -> bool:
        known = world.state.vehicles[vehicle]
        begun = len(known.turn.sorties) == sorties
        return begun and known.stage is stage and known.armed is armed and not known.sortie.took_off

    return due


def sortie_goes_on_board(vehicle: str) -> When:
    def due(world: World) -> bool:
        known = world.state.vehicles[vehicle]
        return known.assignment.pending is not None and len(known.turn.sorties) == 1

    return due


def starts(sky: DaySky, vehicle: str) -> int:
    return sum(f"{vehicle}: flies its mission" == line for line in sky.lines)


@pytest.mark.asyncio
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_flying_vehicle_lands_at_a_closed_base_and_others_fly_its_later_sorties(autopilot: str) -> None:
    day = Day(Crew(FULL), bases=BASES, moments=(crew_asks(at(40), Action.CLOSE, "east"),
                                                wants(at(1500), Action.ABORT)))  # fmt: skip
    sky, flown = await day_flown(day, autopilot)
    assert set(flown.inspected) == set(range(8)), "\n".join(sky.lines)
    assert {segment for segment, name in flown.inspected.items() if name == "uav2"} == {2, 3}
    assert sky.state.vehicles["uav2"].stage is Stage.LANDED
    assert starts(sky, "uav2") == 1
    closed = "page asks: close base east; no take-off from it until it is opened; still to land there: uav2"
    assert closed in sky.lines
    assert "uav2: 2 segments of its later sorties open for the sorties of others" in sky.lines
    assert not [line for line in sky.lines if "internal error" in line]


@pytest.mark.asyncio
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("armed", [False, True])
async def test_a_vehicle_about_to_take_off_from_a_closed_base_stays(autopilot: str, *, armed: bool) -> None:
    shut = crew_asks(in_stage("uav2", Stage.STARTING, armed=armed), Action.CLOSE, "east")
    day = Day(
        Crew(FULL), bases=BASES, later={}, segments=4,
        moments=(shut, crew_asks(at(200), Action.OPEN, "east"), wants(at(210), Action.SWAP, "uav2")),
    )  # fmt: skip
    sky, flown = await day_flown(day, autopilot)
    took_off_s = [one.t_s for one in flown.truths if one.vehicle == "uav2" and one.what == "took_off"]
    assert took_off_s == [] or min(took_off_s) > flown.began_s + 200
    assert set(flown.inspected) == set(range(4)), "\n".join(sky.lines)
    mended = [fault.code for name, fault in sky.state.replanning.mended if name == "uav2"]
    assert mended == ([FaultCode.OPERATOR_EXCLUDE] if armed and took_off_s else [])


@pytest.mark.asyncio
async def test_a_sortie_that_goes_on_board_does_not_start_at_a_closed_base_and_is_flown_once_it_is_open() -> None:
    day = Day(
        Crew(FULL), bases={"uav1": "west"}, first={"uav1": (0, 2)}, later={"uav1": ((4, 6),)}, segments=4,
        moments=(crew_asks(sortie_goes_on_board("uav1"), Action.CLOSE, "west"),
                 crew_asks(at(500), Action.OPEN, "west"), wants(at(510), Action.SWAP, "uav1")),
    )  # fmt: skip
    sky, flown = await day_flown(day, "ardupilot")
    assert set(flown.inspected) == {0, 1, 2, 3}, "\n".join(sky.lines)
    began_s = [sortie.began_s - flown.began_s for sortie in sky.state.vehicles["uav1"].turn.sorties]
    assert len(began_s) == 2
    assert began_s[1] > 500
    assert "uav1: sortie 2, plan 2, ended; no mission has changed" in sky.lines


@pytest.mark.asyncio
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_a_spare_takes_over_the_last_sortie_of_the_busiest_vehicle(autopilot: str) -> None:
    day = Day(
        Crew(FULL), first={"uav1": (0,), "uav2": (2,), "uav3": ()}, segments=6,
        later={"uav1": ((4,), (6,), (8,)), "uav2": ((10,),)}, moments=(wants(at(30), Action.SWAP, "uav3"),),
    )  # fmt: skip
    sky, flown = await day_flown(day, autopilot)
    assert set(flown.inspected) == set(range(6)), "\n".join(sky.lines)
    assert "uav3: takes over the last sortie of uav1, 1 segment" in sky.lines
    assert flown.inspected[4] == "uav3"
    assert not [line for line in sky.lines if "internal error" in line]


@pytest.mark.parametrize(
    ("action", "base", "shut", "code"),
    [
        (Action.CLOSE, "west", (), None),
        (Action.CLOSE, "north", (), IntentReason.BASE_UNKNOWN),
        (Action.CLOSE, "", (), IntentReason.BASE_UNKNOWN),
        (Action.CLOSE, "west", ("west",), IntentReason.BASE_CLOSED),
        (Action.OPEN, "west", ("west",), None),
        (Action.OPEN, "west", ("east",), IntentReason.BASE_OPEN),
    ],
)
def test_what_is_refused(action: Action, base: str, shut: tuple[str, ...], code: IntentReason | None) -> None:
    rules = DayRules(30.0, {"uav1": "west", "uav2": "west", "uav3": "east"}, {})
    state = flight_of(flying()).with_crew(closed_bases=frozenset(shut))
    wish = Intent("wish", action, None, "page", base=base)
    why = intent_refusals.find_refusal(replace(FLEET.context, day=rules), state, wish, NOW_S)
    assert (None if why is None else why[0]) is code
    refused = intent_refusals.find_refusal(FLEET.context, state, wish, NOW_S)
    assert refused is not None
    assert refused[0] is IntentReason.BASE_UNKNOWN
    named = intent_refusals.find_refusal(replace(FLEET.context, day=rules), state, replace(wish, vehicle="uav1"), NOW_S)
    assert named is not None
    assert named[0] is IntentReason.VEHICLE_UNEXPECTED


@pytest.mark.parametrize("action", [Action.SWAP, Action.INCLUDE])
def test_a_vehicle_at_a_closed_base_is_not_sent_out(action: Action) -> None:
    one = flying(stage=Stage.LANDED)
    one = replace(one, telemetry=replace(one.telemetry, heartbeat=None))
    context = replace(FLEET.context, day=DayRules(30.0, {"uav1": "west"}, {}))
    state = flight_of(one).with_crew(closed_bases=frozenset({"west"}))
    why = intent_refusals.find_refusal(context, state, Intent("wish", action, "uav1", "page"), NOW_S)
    assert why == (IntentReason.BASE_CLOSED, "its base is closed; open it first")
