"""What a vehicle can offer to a re-plan, and what it keeps for itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery import kalman
from executor.core.battery.account import BatteryState
from executor.core.battery.kalman import Prior
from executor.core.context import Context, DayRules
from executor.core.interface.commands import Survivor
from executor.core.lines import operator
from executor.core.preflight.readiness import find_obstacles
from executor.core.replanning import replan_cycle, survivors
from executor.core.state.vehicle_parts import ModeCause, PositionFix
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.vehicle_learning import LearnedFactors, PaceEstimate
from missions import Pace
from missions.flight_model import AS_MODELLED
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    CREW,
    HOLD,
    ITS_OFFER,
    LOW,
    TAKEN,
    beat,
    flight_of,
    landed,
    offer_of,
    over_pad,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, at, flying, pack

CONTEXT = FLEET.context
STANDS = landed(stage=Stage.LANDED, fix=LOW)
ON_ITS_WAY = flying(waypoint=1, fix=at(east_m=60.0))


def offered(one: VehicleState, context: Context = CONTEXT) -> Survivor | None:
    return survivors.build_survivor(context, flight_of(one), one, NOW_S)


def far(seconds: float) -> PositionFix:
    """Return where the end of the first inspection is so far away, at its speed."""
    return replace(at(), place_m=(200.0 - 3.0 * seconds, -5.0))


def test_what_a_vehicle_has_shown_of_its_pace_is_a_part_of_its_offer() -> None:
    slow = LearnedFactors(PaceEstimate(1.1), PaceEstimate(1.05))
    unknown, known = offered(flying()), offered(flying(learned=slow))
    assert unknown is not None
    assert known is not None
    assert (unknown.pace, known.pace) == (AS_MODELLED, Pace(1.1, 1.05))
    # Its way to where the new mission takes over is flown at its own pace too.
    assert known.budget_pct < unknown.budget_pct


STABILIZE = 0
IN_HAND = replace(STANDS, telemetry=replace(STANDS.telemetry, heartbeat=beat(STABILIZE, armed=False)))


def test_a_vehicle_with_a_foreign_mode_since_landing_takes_off_only_by_confirmation() -> None:
    assert offered(IN_HAND) is None
    assert operator.UNCLEARED in find_obstacles(CONTEXT, flight_of(IN_HAND), IN_HAND, NOW_S)
    said = with_facts(IN_HAND, cleared_s=NOW_S - 1.0)
    assert offered(said) is not None
    assert not find_obstacles(CONTEXT, flight_of(said), said, NOW_S)
    # Before its start a vehicle may stand in any mode.
    assert offered(replace(IN_HAND, stage=Stage.GROUND)) is not None


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a vehicle on its pad offers its whole budget",
        lambda: offered(STANDS),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=74.0,
            consumption=0.999998,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=75.0,
        ),
    ),
    (
        "a vehicle on its pad before its start",
        lambda: offered(replace(STANDS, stage=Stage.GROUND)),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=74.0,
            consumption=0.999998,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=75.0,
        ),
    ),
    (
        "a vehicle on its pad without a mission",
        lambda: offered(with_facts(STANDS, board=None)),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=74.0,
            consumption=0.999998,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=75.0,
        ),
    ),
    ("a vehicle on its pad without clearance", lambda: offered(STANDS, CREW), None),
    (
        "a clearance one minute old",
        lambda: offered(with_facts(STANDS, cleared_s=NOW_S - 60.0), CREW),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=74.0,
            consumption=0.999998,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=75.0,
        ),
    ),
    ("an older clearance", lambda: offered(with_facts(STANDS, cleared_s=NOW_S - 60.1), CREW), None),
    ("at fault", lambda: offered(replace(STANDS, fault=BATTERY_FAULT)), None),
    ("its last mission declined", lambda: offered(with_facts(STANDS, stubborn=True)), None),
    ("excluded from the plan", lambda: offered(with_facts(STANDS, excluded=True)), None),
    ("on hold by the operator's intent", lambda: offered(flying(held_s=NOW_S)), None),
    ("silent", lambda: offered(with_facts(STANDS, heard_s=NOW_S - 3.0)), None),
    ("just received", lambda: offered(with_facts(STANDS, heard_s=NOW_S - 2.9)) is not None, True),
    ("no message yet", lambda: offered(with_facts(STANDS, heard_s=None)), None),
    ("link stale", lambda: offered(with_facts(STANDS, stale=True)), None),
    ("battery not reported", lambda: offered(with_facts(STANDS, battery=BatteryState())), None),
    ("down away from its pad", lambda: offered(flying(stage=Stage.DOWN)), None),
    ("returning", lambda: offered(flying(stage=Stage.RETURNING)), None),
    ("airborne without a mission", lambda: offered(flying(board=None)), None),
    ("airborne without a position", lambda: offered(flying(fix=None)), None),
    ("an inspection under way is kept", lambda: offered(flying()), ITS_OFFER),
    (
        "an inspection it is flying to is kept",
        lambda: offered(ON_ITS_WAY),
        replace(ITS_OFFER, budget_pct=72.1154, most_pct=73.1154),
    ),
    (
        "a climbing vehicle keeps its first inspection",
        lambda: offered(flying(waypoint=0, fix=over_pad(5.0))),
        replace(ITS_OFFER, budget_pct=71.2622, most_pct=72.2622),
    ),
    (
        "a starting vehicle keeps its first inspection in any mode",
        lambda: offered(flying(stage=Stage.STARTING, waypoint=0, fix=over_pad(5.0), heartbeat=beat(4))),
        replace(ITS_OFFER, budget_pct=71.2622, most_pct=72.2622),
    ),
    ("flying in another mode", lambda: offered(flying(heartbeat=beat(HOLD))), None),
    ("mode report stale", lambda: offered(flying(heartbeat_s=NOW_S - 3.5)), None),
    ("mode report fresh", lambda: offered(flying(heartbeat_s=NOW_S - 3.4)) is not None, True),
    ("mode unknown", lambda: offered(flying(heartbeat=None)), None),
    ("mode not received", lambda: offered(flying(heartbeat_s=None)), None),
    (
        "inspection ends in time",
        lambda: offered(flying(fix=far(3.6))),
        replace(ITS_OFFER, budget_pct=73.8513, most_pct=74.8513),
    ),
    (
        "inspection ends before the upload, so the next one is kept",
        lambda: (one := offered(flying(fix=far(2.4)))) and (one.start_m, one.tail, one.kept),
        ((300.0, -5.0), (), 4),
    ),
    (
        "on its last inspection",
        lambda: offered(flying(waypoint=3, fix=replace(at(), place_m=(250.0, -5.0)))),
        Survivor(
            vehicle="uav1",
            start_m=(300.0, -5.0),
            budget_pct=73.3116,
            consumption=0.999998,
            airborne=True,
            tail=(),
            kept=4,
            most_pct=74.3116,
            start_up_m=15.0,
            facing_m=(100.0, 0.0),
        ),
    ),
    (
        "last inspection ends in a moment",
        lambda: offered(flying(waypoint=3, fix=replace(at(), place_m=(299.0, -5.0)))),
        Survivor(
            vehicle="uav1",
            start_m=(300.0, -5.0),
            budget_pct=73.9862,
            consumption=0.999998,
            airborne=True,
            tail=(),
            kept=4,
            most_pct=74.9862,
            start_up_m=15.0,
            facing_m=(100.0, 0.0),
        ),
    ),
    (
        "on its way home, far out",
        lambda: offered(flying(waypoint=4, fix=at(north_m=-18.0))),
        Survivor(
            vehicle="uav1",
            start_m=(261.5, -2.6),
            budget_pct=73.7572,
            consumption=0.999998,
            airborne=True,
            tail=(),
            kept=4,
            most_pct=74.7572,
            start_up_m=20.0,
            facing_m=(100.0, 0.0),
        ),
    ),
    (
        "given back by its pilot beside its way home",
        lambda: offered(flying(waypoint=4, fix=at())),
        Survivor(
            vehicle="uav1",
            start_m=(-38.5, 15.4),
            budget_pct=72.4877,
            consumption=0.999998,
            airborne=True,
            tail=(),
            kept=5,
            most_pct=73.4877,
            start_up_m=15.0,
            facing_m=(-338.5, 20.4),
        ),
    ),
    ("on its way home, nearly there", lambda: offered(flying(waypoint=4, fix=over_pad(15.0))), None),
    ("landing", lambda: offered(flying(waypoint=5, fix=over_pad(5.0))), None),
    ("past all waypoints", lambda: offered(flying(waypoint=6, fix=over_pad(5.0))), None),
    (
        "most of the site's budget used",
        lambda: offered(with_facts(STANDS, battery=pack(100.0, 30.0))),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=5.0,
            consumption=1.0,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=15.0,
        ),
    ),
    (
        "battery at its reserve",
        lambda: offered(with_facts(STANDS, battery=pack(15.0))),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=0.0,
            consumption=1.0,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=0.0,
        ),
    ),
    (
        "battery slightly above its reserve",
        lambda: offered(with_facts(STANDS, battery=pack(20.0))),
        Survivor(
            vehicle="uav1",
            start_m=(0.0, 0.0),
            budget_pct=4.0,
            consumption=1.0,
            airborne=False,
            tail=(),
            kept=0,
            most_pct=5.0,
        ),
    ),
    (
        "consumption above the model",
        lambda: offered(
            flying(battery=replace(pack(90.0, 90.0), estimate=kalman.initialise_estimate(90.0, Prior(1.5, 0.1))))
        ),
        Survivor(
            vehicle="uav1",
            start_m=(200.0, -5.0),
            budget_pct=72.6617,
            consumption=1.5,
            airborne=True,
            tail=(2,),
            kept=3,
            most_pct=73.6617,
            start_up_m=15.0,
            facing_m=(100.0, 0.0),
        ),
    ),
    (
        "an offer of the ground fits on the ground",
        lambda: [stage for stage in Stage if survivors.is_offer_valid(flying(stage=stage), offer_of(airborne=False))],
        [Stage.GROUND, Stage.LANDED],
    ),
    (
        "an offer of the air fits in the air",
        lambda: [stage for stage in Stage if survivors.is_offer_valid(flying(stage=stage), offer_of())],
        [Stage.STARTING, Stage.FLYING],
    ),
    (
        "an offer fits until it is flown past",
        lambda: [
            waypoint for waypoint in range(6) if survivors.is_offer_valid(flying(waypoint=waypoint), offer_of(kept=3))
        ],
        [0, 1, 2],
    ),
    (
        "an offer of who is on its way home fits until that leg ends",
        lambda: [
            waypoint for waypoint in range(6) if survivors.is_offer_valid(flying(waypoint=waypoint), offer_of(kept=4))
        ],
        [0, 1, 2, 3, 4],
    ),
    (
        "an offer of who is at fault does not fit",
        lambda: survivors.is_offer_valid(flying(fault=BATTERY_FAULT), offer_of()),
        False,
    ),
    (
        "an offer of who is out of the plan does not fit",
        lambda: survivors.is_offer_valid(flying(excluded=True), offer_of()),
        False,
    ),
    (
        "an offer of who has just left its mission does not fit",
        lambda: [cause for cause in ModeCause if survivors.is_offer_valid(flying(cause=cause), offer_of())],
        [ModeCause.OURS],
    ),
    ("an offer of who holds does not fit", lambda: survivors.is_offer_valid(flying(held_s=NOW_S), offer_of()), False),
    (
        "segments without names in words",
        lambda: [
            replan_cycle.format_segments(CONTEXT, segments) for segments in ((), (3,), (3, 1), frozenset({5, 0, 2}))
        ],
        ["", "segment 3", "segments 1, 3", "segments 0, 2, 5"],
    ),
    (
        "segments without a vehicle",
        lambda: [
            sorted(replan_cycle.find_orphan_segments(CONTEXT, flight))
            for flight in (
                flight_of(),
                flight_of(flying()),
                flight_of(flying(waypoint=3), inspected={0: "uav1"}, given_up=frozenset({4})),
                flight_of(flying(fault=BATTERY_FAULT)),
                flight_of(flying(stage=Stage.PILOT, taken=TAKEN)),
                flight_of(flying(stage=Stage.PILOT, taken=replace(TAKEN, given_away=True))),
            )
        ],
        [[0, 1, 2, 3, 4, 5], [2, 3, 4, 5], [2, 3, 5], [0, 1, 2, 3, 4, 5], [2, 3, 4, 5], [0, 1, 2, 3, 4, 5]],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


def test_what_a_days_camera_is_not_good_for_is_not_offered() -> None:
    day = DayRules(30.0, {}, {}, barred={"uav1": frozenset({2, 5})})
    offer = survivors.build_survivor(replace(CONTEXT, day=day), flight_of(flying()), flying(), NOW_S)
    assert offer is not None
    assert offer.barred == (2, 5)
