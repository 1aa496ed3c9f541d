"""A start that failed while its vehicle said no position waits for one: it may have rebooted, with another pack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.commands import Command, HandsOff, Level, Say, Start
from executor.core.interface.events import Event, Heard, StartEnded, Tick
from executor.core.launch import apply_start_result, resume_start, retry_waiting_starts, start_from_base
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import FaultCode, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import CREW, LOW, beat, flight_of, over_pad
from tests.executor.core.vehicles import AUTO, DISARMED, FLEET, NOW_S, flying

STARTS = flying(
    stage=Stage.STARTING, heartbeat=DISARMED, took_off=False, armed_once=False, waypoint=0, anchor=None, fix=LOW
)
STALE = replace(LOW, at_s=NOW_S - CREW.limits.link_stale_s - 0.1)
OWED = with_facts(STARTS, fix=STALE, start_owed_s=NOW_S)


def failed(vehicle: VehicleState) -> tuple[VehicleState, tuple[Command, ...]]:
    flight = flight_of(vehicle, launched_s=NOW_S - 5.0)
    state, commands = apply_start_result(CREW, flight, StartEnded("uav1", False, "no answer"), NOW_S)
    return state.vehicles["uav1"], commands


def pursued(vehicle: VehicleState, at_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    return retry_waiting_starts(CREW, flight_of(vehicle, launched_s=NOW_S - 5.0), at_s)


def test_a_vehicle_with_a_position_is_started_again_at_once() -> None:
    vehicle, commands = failed(with_facts(STARTS, fix=replace(LOW, at_s=NOW_S - CREW.limits.link_stale_s)))
    assert commands == (Say(Level.WARNING, "uav1: did not start (no answer); trying again"), Start("uav1"))
    assert vehicle.orders.start_owed_s is None


@pytest.mark.parametrize("fix", [STALE, None])
def test_a_vehicle_without_a_position_waits(fix: object) -> None:
    vehicle, commands = failed(with_facts(STARTS, fix=fix))
    text = "uav1: did not start (no answer); trying again once a position is received"
    assert commands == (Say(Level.WARNING, text),)
    assert (vehicle.stage, vehicle.orders.start_owed_s, vehicle.assignment.failures) == (Stage.STARTING, NOW_S, 1)
    state, commands = pursued(vehicle, NOW_S + 10.0)
    assert commands == ()
    assert state.vehicles["uav1"] == vehicle


def test_a_position_that_is_newer_than_the_failure_starts_it() -> None:
    state, commands = pursued(with_facts(OWED, fix=replace(LOW, at_s=NOW_S + 0.1)), NOW_S + 0.5)
    assert commands == (Start("uav1"),)
    orders = state.vehicles["uav1"].orders
    assert (orders.start_owed_s, orders.ordered_mode_s) == (None, NOW_S + 0.5)


@pytest.mark.parametrize(
    ("vehicle", "at_s", "why"),
    [
        (
            with_facts(OWED, fix=replace(LOW, at_s=NOW_S + 1.0), rebooted_s=NOW_S + 1.0), NOW_S + 1.1,
            "did not start: its autopilot has rebooted since its checks",
        ),
        (OWED, NOW_S + 10.1, "did not start: no position for 10 s, it may have rebooted since its checks"),
    ],
)  # fmt: skip
def test_a_rebooted_vehicle_or_one_without_a_position_stays_on_the_ground(
    vehicle: VehicleState, at_s: float, why: str
) -> None:
    state, commands = pursued(vehicle, at_s)
    fault = state.vehicles["uav1"].fault
    assert fault is not None
    assert (fault.reason, fault.code) == (why, FaultCode.NOT_STARTED)
    assert state.vehicles["uav1"].orders.start_owed_s is None
    assert not [one for one in commands if isinstance(one, Start)]


@pytest.mark.parametrize(("fix", "found", "owed_s"), [
    (replace(LOW, at_s=NOW_S - CREW.limits.link_stale_s), Start("uav1"), None),
    (STALE, Say(Level.WARNING, "uav1: take-off waits for a position"), NOW_S),
    (None, Say(Level.WARNING, "uav1: take-off waits for a position"), NOW_S),
])  # fmt: skip
def test_a_later_start_waits_for_a_position(fix: object, found: Command, owed_s: float | None) -> None:
    vehicle = with_facts(STARTS, stage=Stage.GROUND, fix=fix)
    state, commands = start_from_base(CREW, flight_of(vehicle, launched_s=NOW_S - 90.0), vehicle, NOW_S)
    assert commands == (found,)
    assert (state.vehicles["uav1"].stage, state.vehicles["uav1"].orders.start_owed_s) == (Stage.STARTING, owed_s)


@pytest.mark.parametrize(("facts", "why"), [
    ({"rebooted_s": NOW_S - 9.0}, "its autopilot has rebooted since its checks"),
    (
        {"behind_s": 5.0, "fell_back_s": NOW_S - 9.0},
        "its clock fell back: its autopilot may have rebooted since its checks",
    ),
])  # fmt: skip
def test_a_vehicle_that_rebooted_on_its_pad_does_not_start_until_included(facts: dict[str, float], why: str) -> None:
    vehicle = with_facts(STARTS, stage=Stage.GROUND, fix=LOW, **facts)
    state, commands = start_from_base(CREW, flight_of(vehicle, launched_s=NOW_S - 90.0), vehicle, NOW_S)
    assert commands == ()
    state, commands = retry_waiting_starts(CREW, state, NOW_S + 0.5)
    fault = state.vehicles["uav1"].fault
    assert fault is not None
    assert fault.reason == f"did not start: {why}"
    assert not [one for one in commands if isinstance(one, Start)]
    included = with_facts(vehicle, cleared_s=NOW_S - 8.0)
    _, commands = start_from_base(CREW, flight_of(included, launched_s=NOW_S - 90.0), included, NOW_S)
    assert commands == (Start("uav1"),)


def test_a_cancelled_start_needs_no_report() -> None:
    state, commands = pursued(replace(OWED, stage=Stage.LOST), NOW_S + 10.1)
    assert commands == ()
    assert state.vehicles["uav1"].orders.start_owed_s is None
    assert state.vehicles["uav1"].fault is None


@pytest.mark.parametrize(("after_s", "starts"), [(44.9, True), (45.0, False)])
def test_a_start_interrupted_by_an_upload_continues_while_the_clearance_is_valid(after_s: float, starts: bool) -> None:
    flight = flight_of(STARTS, launched_s=NOW_S - after_s)
    state, commands = resume_start(CREW, flight, flight.vehicles["uav1"], NOW_S)
    assert (Start("uav1") in commands) is starts
    fault = state.vehicles["uav1"].fault
    assert (fault is None) is starts
    assert starts or (fault is not None and fault.reason == "did not start within 45 s of take-off clearance")


LOITER = 5
CLIMBS = over_pad(8.0, climbs_m_s=1.0)


def gone_through(
    events: Sequence[tuple[float, Event]], context: Context = CREW, **facts: object
) -> tuple[VehicleState, list[Command]]:
    """Return what becomes of a vehicle that is armed, in mission mode and starting; with what was commanded."""
    vehicle = with_facts(STARTS, heartbeat=beat(AUTO), armed_once=True, heard_s=NOW_S, heartbeat_s=NOW_S, **facts)
    state, said = flight_of(vehicle, launched_s=NOW_S - 3.0), list[Command]()
    for after_s, event in events:
        state, commands = fleet_step.step(context, state, event, NOW_S + after_s)
        said.extend(commands)
    return state.vehicles["uav1"], said


def heard(mode: int, *, armed: bool = True) -> Heard:
    return Heard("uav1", beat(mode, armed=armed))


def test_a_start_interrupted_by_a_mode_change_ends_when_the_vehicle_disarms() -> None:
    # By then nobody was sure yet that it is the pilot's, and nothing pursues the start any more.
    begun: list[tuple[float, Event]] = [(0.1, heard(LOITER)), (0.8, heard(LOITER, armed=False)), (0.9, Tick())]
    assert gone_through([*begun])[0].stage is Stage.STARTING, "one HEARTBEAT may be another's"
    vehicle, commands = gone_through([*begun, (1.8, heard(LOITER, armed=False)), (1.9, Tick())])
    assert HandsOff("uav1") in commands
    assert vehicle.stage is Stage.LANDED
    assert vehicle.fault is not None
    assert (vehicle.fault.reason, vehicle.fault.code) == (
        "did not start: mode changed by another source, then disarmed",
        FaultCode.NOT_STARTED,
    )
    assert not [one for one in commands if isinstance(one, Start)]


@pytest.mark.parametrize(("context", "stays"), [(CREW, True), (FLEET.context, False)])
def test_a_vehicle_disarmed_during_its_start_is_not_armed_again(context: Context, stays: bool) -> None:
    # PX4 disarms on its pad 10 s after it was armed; a start whose orders get lost would arm it half a minute later.
    disarmed: list[tuple[float, Event]] = [(at_s, heard(AUTO, armed=False)) for at_s in (10.0, 11.0)]
    vehicle, commands = gone_through([*disarmed, (11.1, Tick())], context)
    assert (HandsOff("uav1") in commands) is stays
    assert vehicle.stage is (Stage.LANDED if stays else Stage.STARTING)
    if stays:
        assert vehicle.fault is not None
        assert vehicle.fault.reason == "did not start: armed, then disarmed"


@pytest.mark.parametrize(("took_off", "stage"), [(True, Stage.FLYING), (False, Stage.STARTING)])
def test_a_vehicle_back_in_mission_mode_counts_as_flying_once_in_the_air(took_off: bool, stage: Stage) -> None:
    begun: list[tuple[float, Event]] = [(0.1, heard(LOITER)), (0.8, heard(AUTO)), (0.9, Tick())]
    vehicle, commands = gone_through(begun, took_off=took_off, fix=CLIMBS if took_off else LOW)
    assert HandsOff("uav1") in commands
    assert (vehicle.stage, vehicle.fault) == (stage, None)
    assert (Say(Level.INFO, "uav1: flies its mission") in commands) is took_off


def test_a_start_that_is_ordered_again_is_pursued_again() -> None:
    vehicle = with_facts(STARTS, start_let_go=True)
    state, _ = start_from_base(CREW, flight_of(vehicle, launched_s=NOW_S), vehicle, NOW_S)
    assert not state.vehicles["uav1"].orders.start_let_go
