"""How a position is known: by GPS, dead-reckoned since its loss, or not at all."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.fleet_view import position_view
from executor.core.inflight.faults.warning_rules import gps_lost
from executor.core.inflight.faults.watch_view import WatchView
from executor.core.interface.commands import Level
from executor.core.interface.events import Heard
from executor.core.interface.messages import EstimatorStatus, FlightMessage, Gps, Position, SystemStatus
from executor.core.state.gps_loss import GPS_SENSOR
from executor.core.state.vehicle_position import (
    accuracy_of,
    describe_down_place,
    describe_last_position,
    format_coordinates,
    format_down_position,
    is_dead_reckoning,
    is_over_pad,
)
from executor.core.state.vehicle_state import VehicleState
from executor.core.telemetry.message_update import WITHOUT_FIX, apply_message
from tests.executor.core.stories import under_way
from tests.executor.core.vehicles import CONTEXT, DISARMED, NOW_S, SETUP, at, flying
from tests.fakes.flight import Story

GOOD, NONE = Gps(3, 14, accuracy_m=1.8), Gps(1, 0)
DRIFTING = EstimatorStatus(is_absolute=False)
SURE = EstimatorStatus(is_absolute=True)
UNHEALTHY = SystemStatus(None, None, GPS_SENSOR, None)


def heard(*said: tuple[float, FlightMessage | None], state: VehicleState | None = None) -> VehicleState:
    """Return a vehicle after what it said; None is a position in the same place then."""
    known = flying() if state is None else state
    for at_s, message in said:
        fix = known.motion.fix
        assert fix is not None
        lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(*fix.place_m)
        place = Position(at_s, lat_deg, lon_deg, fix.alt_msl_m, fix.alt_rel_m, 0.0, 3.0, 0.0, None)
        known = apply_message(CONTEXT, known, message or place, at_s).state
    return known


LOST = ((NOW_S, GOOD), (NOW_S + 1.0, NONE))


def lost_for(seconds: float) -> VehicleState:
    return heard(*LOST, (NOW_S + seconds, None))


def test_a_vehicle_that_says_nothing_of_its_gps_is_not_said_to_have_a_fix() -> None:
    how = accuracy_of(flying())
    assert how is not None
    assert how.known == "unsaid"
    assert format_coordinates(CONTEXT, flying()).endswith("(GPS not reported)")


@pytest.mark.parametrize(("accuracy_m", "text"), [
    (0.02, "49.600138, 15.603617 (GPS, 0.02 m)"), (1.8, "49.60014, 15.60362 (GPS, 1.8 m)"),
    (None, "49.60014, 15.60362 (GPS, 3 m)"), (25.0, "49.6001, 15.6036 (GPS, 25 m)"),
])  # fmt: skip
def test_a_place_has_no_more_digits_than_its_fix_carries(accuracy_m: float | None, text: str) -> None:
    known = heard((NOW_S, Gps(3, 14, accuracy_m=accuracy_m)))
    assert format_coordinates(CONTEXT, known) == text
    assert format_down_position(CONTEXT, known) == f"down at {text}"


@pytest.mark.parametrize("said", [
    ((NOW_S + 1.0, NONE),), ((NOW_S + 1.0, Gps(0, None)),), ((NOW_S + 1.0, Gps(2, 4)),), ((NOW_S + 1.0, DRIFTING),),
    ((NOW_S + 6.0, UNHEALTHY),),
])  # fmt: skip
def test_each_of_three_reports_says_that_gps_is_lost(said: tuple[tuple[float, FlightMessage], ...]) -> None:
    known = heard((NOW_S, GOOD), *said, (NOW_S + 6.5, None))
    assert known.sensors.positioning.lost_s == said[0][0]
    assert known.motion.fix is not None
    assert known.motion.fix.reckoned


@pytest.mark.parametrize("said", [
    ((NOW_S, NONE),),  # it never had one: who flies indoors has none to lose
    ((NOW_S, DRIFTING), (NOW_S + 1.0, UNHEALTHY)),
    ((NOW_S, GOOD), (NOW_S + 1.0, UNHEALTHY)),  # its receiver says more than its health
    ((NOW_S, GOOD), (NOW_S + 1.0, Gps(3, 9, receiver=1)), (NOW_S + 2.0, NONE)),  # the other one has a fix
])  # fmt: skip
def test_what_is_no_loss(said: tuple[tuple[float, FlightMessage], ...]) -> None:
    assert heard(*said).sensors.positioning.lost_s is None


def standing() -> VehicleState:
    """Return a vehicle that stands on its pad, disarmed, and has not flown."""
    state = flying(fix=at(east_m=0.0, up_m=0.0))
    telemetry = replace(state.telemetry, heartbeat=DISARMED)
    return replace(state, telemetry=telemetry, sortie=replace(state.sortie, took_off=False))


def test_an_estimator_that_has_not_begun_to_use_gps_has_none_to_lose() -> None:
    """ArduPilot's receiver has a fix half a minute before its estimator uses it, and speaks first."""
    starts = heard(
        (NOW_S, GOOD), (NOW_S + 0.1, DRIFTING), (NOW_S + 7.0, GOOD), (NOW_S + 7.1, DRIFTING), state=standing()
    )
    assert starts.sensors.positioning.lost_s is None
    ready = heard((NOW_S + 8.0, SURE), (NOW_S + 9.0, GOOD), state=starts)
    assert ready.sensors.positioning.fixed is not None
    assert heard((NOW_S + 10.0, NONE), state=ready).sensors.positioning.lost_s == NOW_S + 10.0


def test_a_wreck_keeps_its_last_fix_when_its_estimator_starts_again() -> None:
    down = lost_for(60.0)
    wreck = replace(down, telemetry=replace(down.telemetry, heartbeat=DISARMED))
    known = heard((NOW_S + 61.0, DRIFTING), state=replace(wreck, sortie=replace(wreck.sortie, took_off=False)))
    assert known.sensors.positioning.fixed == down.sensors.positioning.fixed
    assert known.sensors.positioning.lost_s == NOW_S + 1.0


def test_a_repeated_fix_confirms_no_position() -> None:
    """ArduPilot reports the last fix for four seconds after its receiver has stopped."""
    frozen = Gps(3, 14, measured_s=500.0)
    known = heard((NOW_S, frozen), (NOW_S + 1.0, None), (NOW_S + 1.1, frozen), (NOW_S + 4.0, NONE))
    assert known.sensors.positioning.fixed is not None
    assert known.sensors.positioning.fixed.at_s == NOW_S


def test_gps_is_regained_when_receiver_and_estimator_say_so() -> None:
    lost = heard(*LOST, (NOW_S + 2.0, DRIFTING), (NOW_S + 3.0, GOOD))
    assert lost.sensors.positioning.lost_s == NOW_S + 1.0
    again = heard((NOW_S + 4.0, SURE), (NOW_S + 5.0, GOOD), (NOW_S + 5.2, None), state=lost)
    assert again.sensors.positioning.lost_s is None
    assert format_coordinates(CONTEXT, again).endswith("(GPS, 1.8 m)")


def test_the_place_of_a_wreck_is_its_last_fix_before_what_it_reckons() -> None:
    wreck = heard(state=replace(lost_for(60.0)))
    words = describe_down_place(CONTEXT, replace(wreck, telemetry=replace(wreck.telemetry, heartbeat=DISARMED)))
    assert words == (
        "down: last GPS fix 49.60014, 15.60362, 60 s before, at 3 m/s, "
        "reckoned since to 49.600, 15.604, off by 452 m or more, disarmed"
    )
    heard_last = describe_last_position(CONTEXT, wreck, NOW_S + 75.0)
    assert heard_last.startswith("last GPS fix 49.60014, 15.60362, 60 s before")
    assert heard_last.endswith("20 m over its home, 15 s ago")


def test_what_it_reckons_is_worth_less_with_every_second() -> None:
    off_m = [how.off_m for seconds in (2.0, 10.0, 30.0, 60.0) if (how := accuracy_of(lost_for(seconds))) is not None]
    assert off_m == sorted(off_m)
    assert off_m[-1] > 400.0


def test_programs_get_the_same_answer() -> None:
    told = position_view(CONTEXT, lost_for(60.0), NOW_S + 61.0)
    assert told is not None
    assert (told.known, told.accuracy_m, told.age_s) == ("reckoned", 451.8, 1.0)
    assert told.last_fix is not None
    assert (told.last_fix.lat_deg, told.last_fix.age_s, told.last_fix.accuracy_m) == (49.60014, 61.0, 1.8)
    known = position_view(CONTEXT, heard((NOW_S, GOOD)), NOW_S)
    assert known is not None
    assert (known.known, known.accuracy_m, known.last_fix) == ("fix", 1.8, None)


def test_it_is_not_taken_to_stand_on_its_pad_by_what_it_reckons() -> None:
    on_pad = flying(fix=at(east_m=0.0, up_m=0.0))
    assert is_over_pad(CONTEXT, heard((NOW_S, GOOD), (NOW_S + 1.0, None), state=on_pad))
    assert not is_over_pad(CONTEXT, heard(*LOST, (NOW_S + 30.0, None), state=on_pad))


def test_the_loss_is_reported_with_the_last_fix() -> None:
    view = WatchView(CONTEXT, SETUP, lost_for(2.0), False, NOW_S + 2.0)
    assert gps_lost(view) == (
        "GPS lost (no GPS fix): position is dead-reckoned from now on; "
        "last GPS fix 49.60014, 15.60362, 2 s before, at 3 m/s"
    )


def test_an_estimator_that_leaves_gps_for_one_report_is_not_said() -> None:
    def said(until_s: float) -> str:
        return gps_lost(
            WatchView(CONTEXT, SETUP, heard((NOW_S, GOOD), (NOW_S + 1.0, DRIFTING)), False, NOW_S + until_s)
        )

    assert said(1.5) == ""
    assert said(3.0) != ""


def on_a_segment() -> Story:
    """Return a flight whose uav2 is on its first segment and has a fix."""
    flight = under_way()
    flight.happen(Heard("uav2", GOOD))
    flight.run(lambda: flight.vehicle("uav2").assignment.run is not None)
    flight.pass_s(1.0)
    flight.happen(Heard("uav2", GOOD))
    return flight


def lose_gps(flight: Story, seconds: float) -> None:
    flight.happen(Heard("uav2", NONE))
    flight.pass_s(seconds)
    flight.happen(Heard("uav2", GOOD))


def test_a_segment_that_is_flown_without_a_fix_stays_open_and_is_reported() -> None:
    flight = on_a_segment()
    done = len(flight.state.coverage.inspected)
    flight.happen(Heard("uav2", NONE))
    flight.run(lambda: any("is not proven" in line for line in flight.said(Level.WARNING)))
    assert any(line.endswith(f"is not proven: {WITHOUT_FIX}") for line in flight.said(Level.WARNING))
    assert "uav2" not in list(flight.state.coverage.inspected.values())[done:]
    assert [line for line in flight.said(Level.WARNING) if "GPS lost" in line] != []


def test_a_gap_as_long_as_positions_may_be_missing_is_tolerated() -> None:
    flight = on_a_segment()
    lose_gps(flight, 4.0)
    assert flight.vehicle("uav2").assignment.run is not None
    assert flight.vehicle("uav2").assignment.runs_broken == ()
    assert flight.said(Level.INFO)[-1] == "uav2: GPS regained after 4 s"


def test_a_longer_one_breaks_the_inspection() -> None:
    flight = on_a_segment()
    lose_gps(flight, 6.0)
    assert [why for _, why in flight.vehicle("uav2").assignment.runs_broken] == [WITHOUT_FIX]
    assert not is_dead_reckoning(flight.vehicle("uav2")) or flight.vehicle("uav2").sensors.positioning.lost_s is None
