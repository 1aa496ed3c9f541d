"""Who changed a vehicle's mode, by all that was heard: its pilot, a ground station, a failsafe, its mission.

A mode that nobody ordered here may be anybody's. What proves the most is asked first: the autopilot's own record, then
an order for that very mode, a switch of the transmitter, and what the autopilot says has failed. What nothing explains
is unknown: both autopilots say in words, or by a critical HEARTBEAT, that a failsafe acts.
"""

from __future__ import annotations

from dataclasses import dataclass

from executor.core.context import VehicleSetup
from executor.core.interface.messages import NO_ITEM, Actor, OwnFailsafe
from executor.core.state.vehicle_parts import ModeEvidence
from executor.core.state.vehicle_state import VehicleState
from executor.core.telemetry.failsafe_texts import has_failsafe_action
from missions.autopilots.dialect import is_home_mode

RECORDED_S = 2.0
"""A mode's record and the HEARTBEAT that shows it come one after the other; the HEARTBEAT up to a second later."""
ORDERED_S = 5.0
"""An order is sent again until it is followed, and its answer may come this long before the HEARTBEAT."""
ANSWERED_S = 3.0
"""An answer that was seen may also come after it."""
SWITCHED_S = 2.5
"""A switch takes the autopilot a moment, and the HEARTBEAT that shows it a second more."""
LATE_CHANNELS_S = 1.0
"""Its channels may be reported after the HEARTBEAT."""
BEAT_S, MOST_LATE_S = 1.0, 15.0
"""A HEARTBEAT comes every second; in a longer gap than this a silence is judged, and no change of mode."""
CRITICAL_S = 2.5
SAID_BEFORE_S, SAID_AFTER_S = 15.0, 4.0
"""A failsafe's text comes before its mode by as long as it holds first, and after it by as long as a text may take."""
NAMED_S = 5.0
OVER_S = 2.0
"""What was over so shortly before a HEARTBEAT showed a mode may have led there: a return ends a breach at once."""
BREACHED_S = 4.0
"""A breach is said once a second or two."""
SETTLED_S = 4.0
"""After so long nothing comes any more that explains a mode."""
GEOFENCE_SENSOR = 0x100000
"""MAV_SYS_STATUS_GEOFENCE."""


@dataclass(frozen=True, slots=True)
class Attribution:
    """Who changed a mode, and what says so."""

    by: Actor
    why: str = ""
    """In words, empty where nothing says it."""
    failed: OwnFailsafe | None = None
    """What has failed, if it was a failsafe that says so."""


def attribute_mode_change(setup: VehicleSetup, vehicle: VehicleState) -> Attribution:
    """Return who put a vehicle into the mode that its newest HEARTBEAT shows."""
    if vehicle.telemetry.heartbeat is None:
        return Attribution(Actor.UNKNOWN)
    mode, known, at_s = vehicle.telemetry.heartbeat.custom_mode, vehicle.evidence, vehicle.telemetry.mode_since_s
    late_s = _mode_delay_s(vehicle)
    if found := _match_record(known, at_s, mode):
        return found
    if _has_foreign_order(known, at_s, late_s, mode):
        return Attribution(Actor.GROUND_STATION, "it was ordered")
    if switch := find_switch_before(known, at_s, late_s):
        return Attribution(Actor.PILOT, switch)
    if found := _match_failsafe(setup, vehicle, at_s, mode):
        return found
    if _has_foreign_order(known, at_s, late_s, None):
        return Attribution(Actor.GROUND_STATION, "an order to change its mode was accepted")
    itself = is_home_mode(setup.dialect, mode) and _is_at_mission_end(setup, vehicle)
    return Attribution(Actor.MISSION, "it was at its last item") if itself else Attribution(Actor.UNKNOWN)


def _mode_delay_s(vehicle: VehicleState) -> float:
    """Return how much earlier than usual its mode may have changed: HEARTBEATs get lost, and nobody saw it."""
    told = vehicle.telemetry
    if told.mode_before_s is None:
        return 0.0
    return min(MOST_LATE_S, max(0.0, told.mode_since_s - told.mode_before_s - BEAT_S))


def _match_record(known: ModeEvidence, at_s: float, mode: int) -> Attribution | None:
    """Return what the autopilot's own record of a change of mode says."""
    recorded, recorded_s = known.recorded
    if recorded is None or recorded.custom_mode not in {None, mode} or abs(recorded_s - at_s) > RECORDED_S:
        return None
    if recorded.by is Actor.FAILSAFE:
        failed = _find_failure(known, at_s)
        return Attribution(Actor.FAILSAFE, "" if failed is None else failed.words, failed)
    return None if recorded.by is Actor.UNKNOWN else Attribution(recorded.by, "its own record")


def _match_failsafe(setup: VehicleSetup, vehicle: VehicleState, at_s: float, mode: int) -> Attribution | None:
    """Return the failsafe that may have led to a mode: home, down, a hold, or one that needs no position."""
    modes, known = setup.dialect.modes, vehicle.evidence
    safe = is_home_mode(setup.dialect, mode) or mode == modes.hold.custom_mode
    failed = _find_failure(known, at_s)
    if failed is not None and (safe or mode in modes.blind):
        return Attribution(Actor.FAILSAFE, failed.words, failed)
    if safe and abs(known.critical_s - at_s) <= CRITICAL_S:
        return Attribution(Actor.FAILSAFE, "its HEARTBEAT is critical")
    if safe and (is_fence_breached_near(vehicle, at_s) or vehicle.sensors.unhealthy & GEOFENCE_SENSOR):
        fence = OwnFailsafe("fence", active=True, words="fence breached")
        return Attribution(Actor.FAILSAFE, "its fence was breached", fence)
    return None


def is_fence_breached_near(vehicle: VehicleState, at_s: float) -> bool:
    """Return whether it said about then that its fence is breached, or still says so."""
    return vehicle.sensors.fence_breached or abs(vehicle.sensors.breached_s - at_s) <= BREACHED_S


def describe_fence_action(setup: VehicleSetup, vehicle: VehicleState) -> str:
    """Return in words that its fence put it into its mode; nothing if that is not known."""
    who = attribute_mode_change(setup, vehicle)
    named = who.by is Actor.FAILSAFE and who.failed is not None and who.failed.what == "fence"
    return who.why if named else ""


def _is_at_mission_end(setup: VehicleSetup, vehicle: VehicleState) -> bool:
    """Return whether the item that it flies to is the last of its mission but one: its last may be a return."""
    seq, total = vehicle.telemetry.item or (0, None)
    if not total or total == NO_ITEM or not vehicle.sortie.flew_mission:
        return False
    last = total if setup.dialect.current_counts_home else total - 1
    return seq >= last - 1


def find_switch_before(known: ModeEvidence, at_s: float, late_s: float = 0.0) -> str:
    """Return in words which switch of its transmitter was moved just before a moment; nothing if none was."""
    for moved in reversed(known.switched):
        if moved.from_s <= at_s + LATE_CHANNELS_S and moved.to_s >= at_s - late_s - SWITCHED_S:
            return f"channel {moved.channel} of its transmitter went from {moved.was_us} to {moved.now_us}"
    return ""


def is_attribution_final(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether nothing more is to be expected that says who changed its mode."""
    return now_s - vehicle.telemetry.mode_since_s >= SETTLED_S


def _has_foreign_order(known: ModeEvidence, at_s: float, late_s: float, mode: int | None) -> bool:
    """Return whether a mode was ordered just before a moment; None for one that nobody named."""
    return any(
        order.custom_mode == mode and -ORDERED_S - late_s <= seen_s - at_s <= (ANSWERED_S if mode is None else 1.0)
        for order, seen_s in known.others_orders
    )


def _find_failure(known: ModeEvidence, at_s: float) -> OwnFailsafe | None:
    """Return what an autopilot says failed, and acts, about when its mode changed, what names its reason first."""
    lasted = [(failed, said_s) for failed, said_s, over_s in known.passed if over_s >= at_s - OVER_S]
    young = [
        one for one in (*known.failed, *lasted)
        if -SAID_BEFORE_S <= one[1] - at_s <= SAID_AFTER_S and has_failsafe_action(one[0])
    ]  # fmt: skip
    if not young:
        return None
    last_s = max(said_s for _, said_s in young)
    named = [one for one in young if one[0].what != "other" and last_s - one[1] <= NAMED_S]
    return max(named or young, key=lambda one: one[1])[0]
