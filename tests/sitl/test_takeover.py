"""A pilot, or another ground station, takes a real vehicle: from its own log nothing is commanded while that lasts."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import VehicleState
from missions import Phase
from tests.ports import free_port
from tests.sitl.custody import COMMANDS, LOGGED, boot_s, nothing_was_commanded, own_commands, switches
from tests.sitl.flights import VICTIM, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, PX4, Autopilot, RealVehicle

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

# PX4 refuses Position mode to a station without sticks (measured: "Switching to Position is currently not available").
LASTS_S = 45.0


def both(*acts: Callable[[RealVehicle], None]) -> Callable[[RealVehicle], None]:
    def act(vehicle: RealVehicle) -> None:
        for one in acts:
            one(vehicle)

    return act


def includes(port: int) -> Callable[[RealVehicle], None]:
    """Return how an operator takes uav2 back into the plan, as soon as it may be."""

    def ask() -> None:
        for number in range(40):
            body = {"id": f"include-{number}", "action": "include", "vehicle": VICTIM}
            answer = httpx.post(f"http://127.0.0.1:{port}/intents", json=body).json()
            if answer["outcome"] == "done":
                return
            time.sleep(0.5)

    return lambda _: threading.Thread(target=ask).start()


def in_transit(vehicle: VehicleState, state: FleetState) -> bool:
    leg = vehicle.leg
    moved = (
        vehicle.motion.fix is not None
        and abs(vehicle.motion.fix.velocity_m_s[0]) + abs(vehicle.motion.fix.velocity_m_s[1]) > 4.0
    )
    return (
        vehicle.name in state.coverage.inspected.values() and leg is not None and leg.phase is Phase.TRANSIT and moved
    )


def story_of(autopilot: Autopilot, **more: object) -> Story:
    settings = LOGGED if autopilot is PX4 else {}
    return replace(Story(settings=settings, flight={"fly_again": "ask", "pilot_grace_s": 15.0}), **more)  # type: ignore[arg-type]


@BOTH
@pytest.mark.parametrize("at", [None, in_transit], ids=["segment", "transit"])
def test_a_pilot_takes_it_by_mode_and_keeps_it_until_it_has_landed(
    autopilot: Autopilot, at: Callable[[VehicleState, FleetState], bool] | None, tmp_path: Path
) -> None:
    """LOITER for a while, then the pilot's own RTL."""
    more = {} if at is None else {"at": at}
    story = story_of(
        autopilot, strike=switches(autopilot, "loiter"), lift=switches(autopilot, "rtl"), lasts_s=LASTS_S, **more
    )
    flight = flown(autopilot, story, tmp_path)
    nothing_was_commanded(flight, autopilot)
    assert flight.says(f"{VICTIM}: with its pilot, mode ") is not None, flight.said
    # The others have flown what it left, or were asked to.
    assert flight.report["finished"] or flight.says("can take over") is not None, flight.said
    assert flight.report["faults"] == []


def while_it_is_solved(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether the loss of another one is being planned for, with uav2 among the survivors."""
    plan = state.replanning.replan
    return plan is not None and plan.solve_s is None and vehicle.name in {one.vehicle for one in plan.solve.survivors}


def while_it_is_uploaded(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether uav2's new mission is being put on board."""
    return (
        state.replanning.replan is not None
        and state.replanning.replan.solve_s is not None
        and vehicle.name in state.replanning.replan.pending
    )


@BOTH
@pytest.mark.parametrize("at", [while_it_is_solved, while_it_is_uploaded], ids=["solve", "upload"])
def test_a_pilot_takes_it_while_another_one_is_planned_around(
    autopilot: Autopilot, at: Callable[[VehicleState, FleetState], bool], tmp_path: Path
) -> None:
    """uav3 falls silent for good; uav2 is taken in the midst of what follows, and brought home by its pilot."""
    story = story_of(
        autopilot,
        strike=switches(autopilot, "loiter" if autopilot is PX4 else "rtl"),
        lift=switches(autopilot, "rtl"),
        lasts_s=20.0,
        at=at,
        loses="uav3",
        radius_m=400.0,
    )
    flight = flown(autopilot, story, tmp_path)
    nothing_was_commanded(flight, autopilot)
    assert flight.says(f"{VICTIM}: with its pilot, mode ") is not None, flight.said
    assert [fault["vehicle"] for fault in flight.report["faults"]] == ["uav3"], flight.said


@BOTH
def test_a_pilot_returns_it_to_its_mission(autopilot: Autopilot, tmp_path: Path) -> None:
    """Out of the mission and back, by mode; the operator includes it, and it finishes."""
    port = free_port()
    story = story_of(
        autopilot,
        strike=switches(autopilot, "loiter"),
        lift=both(switches(autopilot, "mission"), includes(port)),
        lasts_s=10.0,
        page=port,
    )
    flight = flown(autopilot, story, tmp_path)
    nothing_was_commanded(flight, autopilot)
    assert flight.says(f"{VICTIM}: is back in the plan, from its pilot") is not None, flight.said
    assert flight.report["finished"], flight.said
    assert flight.vehicle(VICTIM)["landed"]


def test_ardupilots_mode_switch(tmp_path: Path) -> None:
    """Channel 5 of the remote control to LOITER and back to AUTO."""
    port = free_port()
    settings = {"FLTMODE1": 3.0, "FLTMODE4": 5.0, "FLTMODE6": 0.0, "RC_OVERRIDE_TIME": -1.0}
    story = story_of(
        ARDUPILOT,
        strike=lambda vehicle: vehicle.turn(1550),
        lift=both(lambda vehicle: vehicle.turn(1100), includes(port)),
        lasts_s=10.0,
        page=port,
        settings=settings,
    )
    flight = flown(ARDUPILOT, story, tmp_path)
    nothing_was_commanded(flight, ARDUPILOT)
    assert flight.report["finished"], flight.said


def test_px4s_sticks(tmp_path: Path) -> None:
    """Sticks out of their middle take it to Position mode; then the pilot brings it home by RTL."""

    def push(vehicle: RealVehicle) -> None:
        def move() -> None:
            # PX4 wants to see sticks that have rested, and then move by COM_RC_STICK_OV a second of its own time.
            for forward in (*([0] * 60), *range(0, 1000, 200), *([1000] * 60), *([0] * 200)):
                vehicle.push(forward)
                time.sleep(0.02)

        threading.Thread(target=move).start()

    settings = {**LOGGED, "COM_RC_IN_MODE": 1.0, "COM_RC_LOSS_T": 35.0}
    if not PX4.signs:  # 1.18 goes by the speed of a stick (MAN_OVERRIDE_SPD), and does so by default
        settings["COM_RC_OVERRIDE"] = 3.0
    story = story_of(PX4, strike=push, lift=switches(PX4, "rtl"), lasts_s=20.0, settings=settings)
    flight = flown(PX4, story, tmp_path)
    # They rest first, by the wall's clock.
    nothing_was_commanded(flight, PX4, within_s=5.0 + 2.0 * story.speedup)
    assert flight.says(f"{VICTIM}: its pilot has switched it to POSCTL; not commanded from here") is not None, (
        flight.said
    )


def empties(vehicle: RealVehicle) -> None:
    """Have its battery count as all but empty: it holds for five seconds, and lands then."""
    vehicle.set("BAT_EMERGEN_THR", 0.99)


def later(delay_s: float, act: Callable[[RealVehicle], None]) -> Callable[[RealVehicle], None]:
    return lambda vehicle: threading.Timer(delay_s, act, (vehicle,)).start()


@pytest.mark.timeout(580)
def test_a_pilot_who_holds_px4_during_its_failsafe_hold_has_it(tmp_path: Path) -> None:
    """The mode does not change by it, and the failsafe does not act any more."""
    story = story_of(
        PX4, strike=empties, lift=both(switches(PX4, "loiter"), later(40.0, switches(PX4, "rtl"))), lasts_s=2.0,
        settings={**LOGGED, "COM_LOW_BAT_ACT": 2.0, "NAV_DLL_ACT": 2.0}, speedup=1.0,
    )  # fmt: skip
    flight = flown(PX4, story, tmp_path)
    assert flight.lifted_s is not None, flight.said
    has_it_s, home_s = flight.says("not commanded from here"), flight.lifted_s + 40.0
    assert has_it_s is not None, flight.said
    assert has_it_s < flight.lifted_s + 20.0, flight.said
    first_s, last_s = (boot_s(flight, at_s) for at_s in (flight.struck_s or 0.0, home_s))
    orders = [row for row in own_commands(flight, PX4) if first_s < row[0] < last_s and row[1] in COMMANDS]
    assert orders == [], flight.said


@pytest.mark.timeout(580)
def test_px4s_failsafe_that_holds_for_longer_than_usual_is_waited_for(tmp_path: Path) -> None:
    """It holds for what COM_FAIL_ACT_T says, and lands then: nobody has it meanwhile."""
    holds_s = 22.0
    story = story_of(
        PX4, strike=empties, lift=lambda _: None, lasts_s=2.0,
        settings={**LOGGED, "COM_LOW_BAT_ACT": 2.0, "NAV_DLL_ACT": 2.0, "COM_FAIL_ACT_T": holds_s}, speedup=1.0,
    )  # fmt: skip
    flight = flown(PX4, story, tmp_path)
    assert flight.struck_s is not None, flight.said
    acts_s = flight.says(f"{VICTIM}: battery")
    assert acts_s is not None, flight.said
    assert flight.says("its pilot") is None, flight.said
    first_s = boot_s(flight, flight.struck_s)
    orders = [row for row in own_commands(flight, PX4) if first_s < row[0] and row[1] in COMMANDS]
    assert orders == [], flight.said
