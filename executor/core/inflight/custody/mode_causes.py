"""Who changed a vehicle's mode, and who has it: this flight, the vehicle itself, or a person.

A mode that nobody ordered here may be anybody's. What proves the most is asked first: the autopilot's own record, then
an order for that very mode, a switch of the transmitter, and what the autopilot says has failed. What nothing explains
is unknown: both autopilots say in words, or by a critical HEARTBEAT, that a failsafe acts.

Where this flight has a plan, every change of mode has a cause. One that was ordered here is ours; one that a failsafe,
the mission's end or a landing explains is the vehicle's own; whatever is left is a person's, by mode switch, sticks or
another ground station. In doubt it is a person's: then nothing is commanded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from executor.core.context import Scene, VehicleSetup
from executor.core.interface.messages import NO_ITEM, Actor, OwnFailsafe
from executor.core.lines import failsafe, position
from executor.core.state.fleet_state import GroundStationAbsence
from executor.core.state.onboard_fence import describe_fence_departure
from executor.core.state.vehicle_parts import FOLLOWED_LATE_S, ModeCause, ModeEvidence
from executor.core.state.vehicle_position import is_home_by_own_estimate
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.telemetry.mode_evidence import CHANGES_MODE, has_failsafe_action
from missions import Dialect, Phase
from missions.autopilots.dialect import is_home_mode, is_manual_mode, is_mission_mode

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
        return Attribution(Actor.GROUND_STATION, failsafe.ORDERED)
    if switch := find_switch_before(known, at_s, late_s):
        return Attribution(Actor.PILOT, switch)
    if found := _match_failsafe(setup, vehicle, at_s, mode):
        return found
    if _has_foreign_order(known, at_s, late_s, None):
        return Attribution(Actor.GROUND_STATION, failsafe.ORDER_ACCEPTED)
    itself = is_home_mode(setup.dialect, mode) and _is_at_mission_end(setup, vehicle)
    return Attribution(Actor.MISSION, failsafe.LAST_ITEM) if itself else Attribution(Actor.UNKNOWN)


def _mode_delay_s(vehicle: VehicleState) -> float:
    """Return how much earlier than usual its mode may have changed: HEARTBEATs get lost, and nobody saw it."""
    told = vehicle.telemetry
    if told.mode_before_s is None:
        return 0.0
    return min(MOST_LATE_S, max(0.0, told.mode_since_s - told.mode_before_s - BEAT_S))


def _match_record(known: ModeEvidence, at_s: float, mode: int) -> Attribution | None:
    recorded, recorded_s = known.recorded
    if recorded is None or recorded.custom_mode not in {None, mode} or abs(recorded_s - at_s) > RECORDED_S:
        return None
    if recorded.by is Actor.FAILSAFE:
        failed = _find_failure(known, at_s)
        return Attribution(Actor.FAILSAFE, "" if failed is None else failed.words, failed)
    return None if recorded.by is Actor.UNKNOWN else Attribution(recorded.by, failsafe.RECORDED)


def _match_failsafe(setup: VehicleSetup, vehicle: VehicleState, at_s: float, mode: int) -> Attribution | None:
    """Return the failsafe that may have led to a mode: home, down, a hold, or one that needs no position."""
    modes, known = setup.dialect.modes, vehicle.evidence
    safe = is_home_mode(setup.dialect, mode) or mode == modes.hold.custom_mode
    failed = _find_failure(known, at_s)
    if failed is not None and (safe or mode in modes.blind):
        return Attribution(Actor.FAILSAFE, failed.words, failed)
    if safe and abs(known.critical_s - at_s) <= CRITICAL_S:
        return Attribution(Actor.FAILSAFE, failsafe.CRITICAL)
    if safe and (is_fence_breached_near(vehicle, at_s) or vehicle.sensors.unhealthy & GEOFENCE_SENSOR):
        fence = OwnFailsafe("fence", active=True, words="fence breached")
        return Attribution(Actor.FAILSAFE, position.FENCE_WAS_BREACHED, fence)
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
            return failsafe.SWITCHED.format(channel=moved.channel, was_us=moved.was_us, now_us=moved.now_us)
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


SURE_AFTER_S = 1.0
"""A failsafe's text may come after the heartbeat that shows its mode: so long a change of mode is looked at."""
LATE_TEXT_S = 4.0
"""A text this long after a change of mode still explains it."""
OVERTAKEN_S = 3.0
"""A start that was withdrawn is seen to have been followed within two heartbeats, and some of their way."""
CHARGE_CRITICAL, CHARGE_EMERGENCY = 3, 4
"""MAV_BATTERY_CHARGE_STATE."""


def update_mode_cause(
    context: Scene, absences: Sequence[GroundStationAbsence], before: VehicleState, after: VehicleState, now_s: float
) -> VehicleState:
    """Return a vehicle with the cause of its mode, after a HEARTBEAT; `absences` are those of the ground station."""
    beat, old = after.telemetry.heartbeat, before.telemetry.heartbeat
    if beat is None:
        return after
    if not beat.armed:
        return after if after.custody.cause is ModeCause.OURS else after.with_custody(cause=ModeCause.OURS)
    armed_now = old is not None and not old.armed
    if old is not None and old.custom_mode == beat.custom_mode and not armed_now:
        return after
    if old is None or (after.stage is Stage.STARTING and old.custom_mode == beat.custom_mode):
        # Heard for the first time, or armed by us in the mode that it stood in: nothing has changed.
        return after.with_custody(cause=ModeCause.OURS)
    cause = determine_mode_cause(context, absences, before, after, now_s)
    certain = cause is ModeCause.PERSON and (
        _must_be_person(context, before, after) or is_set_by_person(context, after)
    )
    left = old.custom_mode in after.orders.ordered_modes and beat.custom_mode not in after.orders.ordered_modes
    # An order that was followed, and left again, explains no later mode.
    return after.with_custody(cause=cause, certain=certain).with_orders(
        ordered_modes=frozenset() if left else after.orders.ordered_modes
    )


def review_mode_cause(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> VehicleState:
    """Return a vehicle whose change of mode may be explained by what it said since, or may not be any more."""
    if vehicle.custody.cause is ModeCause.FAILSAFE and (
        is_unseen_hold(context, vehicle)
        or _is_hold_after_failsafe(context, absences, vehicle, now_s)
        or _has_reported_takeover(context, vehicle)
        or _is_holding_calmly(context, vehicle, now_s)
        or is_set_by_person(context, vehicle)
    ):
        return vehicle.with_custody(cause=ModeCause.PERSON, certain=True)
    aloft = vehicle.armed and vehicle.telemetry.on_ground is False
    holds = aloft and is_holding(context, vehicle) and now_s - vehicle.telemetry.mode_since_s >= HOVERS_S
    if vehicle.custody.cause is ModeCause.MISSION and holds:  # where its mission's end would have it on the ground
        # In its landing a failsafe holds it as anywhere else, and says so.
        itself = _is_explained_by_failsafe(context, absences, vehicle, now_s)
        cause = ModeCause.FAILSAFE if itself else ModeCause.PERSON
        return vehicle.with_custody(cause=cause, certain=not itself)
    doubtful = vehicle.custody.cause is ModeCause.PERSON and not vehicle.custody.certain
    if not doubtful or now_s - vehicle.telemetry.mode_since_s > LATE_TEXT_S:
        return vehicle
    itself = _is_explained_by_failsafe(context, absences, vehicle, now_s)
    return vehicle.with_custody(cause=ModeCause.FAILSAFE) if itself else vehicle


CALM_S = 2.5
"""Two heartbeats, and some of their way."""


def is_holding(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it says that it holds where it is."""
    return vehicle.mode == context.vehicles[vehicle.name].dialect.modes.hold.custom_mode


def _is_holding_calmly(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether it holds and its heartbeats know of nothing: a failsafe that acts makes them critical.

    PX4 says so while a failsafe has changed its mode, ArduPilot while any but the fence's has. A text, which anybody
    can send, or a silence explains a hold for a moment only.
    """
    beat_s = vehicle.link.heartbeat_s
    if beat_s is None or not is_holding(context, vehicle) or not vehicle.armed:
        return False
    if vehicle.is_critical or vehicle.sensors.fence_breached:
        return False
    # Of a heartbeat that came late enough: the one that first shows the mode may be older than its failsafe's flag.
    return beat_s - vehicle.telemetry.mode_since_s >= CALM_S and now_s >= beat_s


HOVERS_S = 2.5
"""A vehicle that holds at the end of a mission stands on the ground, and says so every second."""


def determine_mode_cause(  # noqa: PLR0911 - one return for each cause
    context: Scene, absences: Sequence[GroundStationAbsence], before: VehicleState, vehicle: VehicleState, now_s: float
) -> ModeCause:
    """Return why a vehicle is in the mode that its newest heartbeat shows."""
    dialect, mode = context.vehicles[vehicle.name].dialect, vehicle.mode
    if mode is None:
        return ModeCause.OURS
    if vehicle.stage in {Stage.GROUND, Stage.LANDED} and not has_never_landed(context, vehicle):
        # It arms, and nobody here said so; or what was said overtook its start.
        return ModeCause.OURS if may_arm_late(vehicle, now_s) else ModeCause.PERSON
    if is_manual_mode(dialect, mode):
        return ModeCause.PERSON
    late = now_s - vehicle.orders.ordered_mode_s > FOLLOWED_LATE_S or _is_return_after_landing(dialect, before, mode)
    if mode in vehicle.orders.ordered_modes and not late and not _is_landing_elsewhere(context, before, vehicle):
        return ModeCause.OURS
    if is_mission_mode(dialect, mode) and vehicle.stage in {Stage.STARTING, Stage.FLYING, Stage.LOST}:
        return ModeCause.OURS
    goes_down = dialect.ends_in_other_mode and _is_landing_after_return(dialect, before, vehicle)
    if goes_down and not _is_landing_elsewhere(context, before, vehicle):
        return before.custody.cause  # a return ends in a landing
    if before.custody.cause is not ModeCause.PERSON and _is_mission_end(context, before, vehicle, mode):
        return ModeCause.MISSION
    if _must_be_person(context, before, vehicle) or is_set_by_person(context, vehicle):
        return ModeCause.PERSON
    goes_on = before.custody.cause is ModeCause.FAILSAFE and vehicle.is_critical  # it holds before it returns
    explained = (goes_on and is_home_mode(dialect, mode)) or _is_explained_by_failsafe(
        context, absences, vehicle, now_s
    )
    return ModeCause.FAILSAFE if explained else ModeCause.PERSON


def _must_be_person(context: Scene, before: VehicleState, vehicle: VehicleState) -> bool:
    """Return whether what explained the mode before explains no other one."""
    dialect = context.vehicles[vehicle.name].dialect
    if not before.armed or vehicle.mode is None:
        return False
    if before.custody.cause is ModeCause.PERSON:
        # Who has it changes its mode again, unless it says anew what it does by itself.
        text, said_s = vehicle.telemetry.alarm
        return not (CHANGES_MODE.search(text) and said_s >= before.telemetry.mode_since_s)
    if not is_holding(context, vehicle) or not is_home_mode(dialect, before.mode):
        return False
    # A failsafe holds before it returns, and never after; on a return that was ordered only one that holds first.
    holds_first = dialect.ground_station_failsafe.pause is not None or vehicle.sensors.fence_breached
    return before.custody.cause is ModeCause.FAILSAFE or (before.custody.cause is ModeCause.OURS and not holds_first)


def is_set_by_person(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether its pilot's switch was moved, or another station ordered its mode, when it changed.

    That may be by chance: then a failsafe is left to a person who looks at it, and not the other way round.
    """
    return attribute_mode_change(context.vehicles[vehicle.name], vehicle).by in {Actor.PILOT, Actor.GROUND_STATION}


def has_never_landed(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle that was taken to have landed is armed high in the air: nobody starts it there."""
    fix = vehicle.motion.fix
    if vehicle.stage is not Stage.LANDED or not vehicle.armed or not vehicle.sortie.took_off or fix is None:
        return False
    fresh = abs((vehicle.link.heartbeat_s or 0.0) - fix.at_s) < SURE_AFTER_S
    return fresh and fix.alt_rel_m > context.limits.off_pad_up_m


def may_arm_late(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle that was told to stay on the ground may arm all the same: its start was on the way."""
    left_s = vehicle.sortie.left_s
    told = vehicle.stage is Stage.LANDED and not vehicle.sortie.took_off and left_s is not None
    return told and now_s - (left_s or 0.0) <= OVERTAKEN_S


def _is_landing_after_return(dialect: Dialect, before: VehicleState, vehicle: VehicleState) -> bool:
    return is_home_mode(dialect, before.mode) and vehicle.mode == dialect.modes.land.custom_mode


def _is_return_after_landing(dialect: Dialect, before: VehicleState, mode: int) -> bool:
    """Return whether it leaves a landing for the return that it was a part of: none does so by itself."""
    return (
        before.armed
        and before.mode == dialect.modes.land.custom_mode != mode
        and before.orders.ordered_mode_s < before.telemetry.mode_since_s
        and is_home_mode(dialect, mode)
    )


def _is_landing_elsewhere(context: Scene, before: VehicleState, vehicle: VehicleState) -> bool:
    """Return whether it breaks off its return for a landing on its way: somebody told it to, or it says why.

    Where it was some time ago is no place that it lands at: nobody knows then that it has come home.
    """
    dialect, modes = context.vehicles[vehicle.name].dialect, vehicle.orders.ordered_modes
    if not before.armed or before.mode == vehicle.mode or not _is_landing_after_return(dialect, before, vehicle):
        return False
    # An order to return that is followed explains no landing elsewhere; one to land does.
    ordered = vehicle.mode in modes and before.mode not in modes
    fix, limits = vehicle.motion.fix, context.limits
    home = fix is None or (
        vehicle.telemetry.mode_since_s - fix.at_s <= limits.link_stale_s and is_home_by_own_estimate(context, vehicle)
    )
    return not ordered and not home


def _is_mission_end(context: Scene, before: VehicleState, vehicle: VehicleState, mode: int) -> bool:
    """Return whether a mission's own last items lead to this mode.

    PX4 leaves mission mode for a landing, and holds when it stands on the ground: nothing follows on that.
    """
    dialect, leg = context.vehicles[vehicle.name].dialect, vehicle.leg
    if vehicle.stage is not Stage.FLYING or leg is None or not dialect.ends_in_other_mode:
        return False
    fix = vehicle.motion.fix
    low = fix is not None and fix.alt_rel_m <= context.limits.airborne_m
    # A failsafe holds it in its landing as anywhere else.
    ends_in_hold = is_holding(context, vehicle) and low and not vehicle.is_critical
    itself = ends_in_hold or (is_home_mode(dialect, mode) and not is_holding(context, before))
    return itself and leg.phase is Phase.LAND


def _is_explained_by_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    if not is_home_mode(context.vehicles[vehicle.name].dialect, vehicle.mode) and not is_holding(context, vehicle):
        return False
    text, said_s = vehicle.telemetry.alarm
    return (
        (bool(CHANGES_MODE.search(text)) and abs(vehicle.telemetry.mode_since_s - said_s) <= context.limits.alarm_s)
        or _is_newly_critical(vehicle, context.limits.alarm_s)
        or is_fence_breached_near(vehicle, vehicle.telemetry.mode_since_s)
        or bool(describe_fence_departure(vehicle, now_s, context.limits.link_stale_s))
        or vehicle.power.battery.charge_state >= CHARGE_EMERGENCY
        or (_is_unseen_change(vehicle) and _may_follow_silence(context, vehicle))
        or is_gcs_absence_failsafe(context, absences, vehicle, now_s)
    )


def _is_newly_critical(vehicle: VehicleState, within_s: float) -> bool:
    """Return whether a failsafe is in force that began about when the mode changed.

    One that was in force long before explains nothing: ArduPilot's stays so after a failsafe whose action was to warn,
    or to go on with the mission.
    """
    since_s = vehicle.telemetry.critical_since_s
    return vehicle.is_critical and (since_s is None or vehicle.telemetry.mode_since_s - since_s <= within_s)


def is_unseen_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it was found to hold after so long that a failsafe which only holds first would have gone on.

    By its own clock: what waited for a ground station that stood still comes late, all of it.
    """
    fix, from_s = vehicle.motion.fix, vehicle.custody.unseen_from_boot_s
    if not is_holding(context, vehicle) or not _is_unseen_change(vehicle):
        return False
    if fix is None or from_s is None or fix.at_s < vehicle.telemetry.mode_since_s:
        return False
    unseen_s = fix.boot_s - (fix.at_s - vehicle.telemetry.mode_since_s) - from_s
    failsafe_s = context.vehicles[vehicle.name].failsafe_s  # until it returns: what it holds before is a part of it
    return unseen_s >= (max_failsafe_hold_s(context, vehicle.name) if failsafe_s is None else failsafe_s + HOLDS_ON_S)


def max_failsafe_hold_s(context: Scene, name: str) -> float:
    """Return how long a vehicle may hold before a failsafe of its own acts: COM_FAIL_ACT_T may be set to 25 s."""
    limits = context.limits
    return max(limits.failsafe_hold_s, context.vehicles[name].holds_s + limits.failsafe_late_s)


def is_long_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it was heard to hold for longer than any failsafe that only holds first, by its HEARTBEATs.

    Who was silent may have stood still, and its clock with it; who sends no HEARTBEAT may have gone on.
    """
    link = vehicle.link
    if not is_holding(context, vehicle):
        return False
    from_s = max(vehicle.telemetry.mode_since_s, link.excused_s, link.regained_s or 0.0)
    return (link.heartbeat_s or 0.0) - from_s >= max_failsafe_hold_s(context, vehicle.name)


def is_failsafe_in_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a failsafe that holds first has begun in a hold of ours: the mode does not show it."""
    told = vehicle.telemetry
    if context.vehicles[vehicle.name].dialect.ground_station_failsafe.pause is None:
        return False
    text, said_s = told.alarm
    began_s = max(told.critical_since_s or -math.inf, said_s if CHANGES_MODE.search(text) else -math.inf)
    holds = is_holding(context, vehicle) and began_s > told.mode_since_s
    return holds and (vehicle.link.heartbeat_s or 0.0) - began_s < max_failsafe_hold_s(context, vehicle.name)


def _is_hold_after_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    """Return whether a failsafe that holds before it acts has not acted: somebody told it to hold meanwhile.

    On PX4 that ends what the failsafe had in mind, and no HEARTBEAT shows it: the mode is the same (framework.cpp). A
    fence, or a lost ground station where no return is set for that, may be answered by a hold alone; an empty battery
    never is.
    """
    setup = context.vehicles[vehicle.name]
    if setup.dialect.ground_station_failsafe.pause is None or not is_long_hold(context, vehicle):
        return False
    if vehicle.power.battery.charge_state >= CHARGE_CRITICAL:
        return True
    failed = attribute_mode_change(setup, vehicle).failed
    what = "" if failed is None else failed.what
    off = describe_fence_departure(vehicle, now_s, context.limits.link_stale_s)
    by_fence = vehicle.sensors.fence_breached or bool(off)
    by_link = what == "ground station" or _is_unseen_change(vehicle)
    by_link = by_link or is_gcs_absence_failsafe(context, absences, vehicle, now_s)
    return not by_fence and what != "fence" and (setup.returns or not by_link)


def _has_reported_takeover(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it says itself that somebody took over while its failsafe held it: PX4 does, by an event."""
    (recorded, recorded_s), since_s = vehicle.evidence.recorded, vehicle.telemetry.mode_since_s
    if not is_holding(context, vehicle) or vehicle.orders.ordered_mode_s >= since_s:
        return False  # what is ordered here is one who takes over, too
    return recorded is not None and recorded.by is Actor.PILOT and recorded_s >= since_s


def _is_unseen_change(vehicle: VehicleState) -> bool:
    """Return whether the mode changed in a silence of the vehicle's link, which is what failsafes are for."""
    until_s = vehicle.custody.unseen_until_s
    return until_s is not None and vehicle.telemetry.mode_since_s == until_s


def _may_follow_silence(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether its GCS failsafe leads to a mode, as far as it is known; or its mission, over its pad."""
    setup = context.vehicles[vehicle.name]
    dialect = setup.dialect
    if not setup.returns:
        return True
    if vehicle.mode == dialect.modes.land.custom_mode:
        return dialect.ends_in_other_mode and is_home_by_own_estimate(context, vehicle)
    return not is_holding(context, vehicle) or dialect.ground_station_failsafe.pause is not None


HOLDS_ON_S = 5.0
"""PX4's clock and ours differ by what its link adds."""
REACTS_S = 30.0
"""PX4 holds before it returns, and reports the change of mode a second later."""
AT_ONCE_S = 5.0
"""What it does because we were away it does, or begins with a hold, when its time is over, and reports it by then."""
COMES_LATE_S = 2.5
"""What it did while we were away comes late: two heartbeats, and some of their way."""


def is_gcs_absence_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    """Return whether a vehicle's GCS failsafe acts because the ground station was not there, or could not be heard."""
    if not absences or (vehicle.mode is not None and not _may_follow_silence(context, vehicle)):
        return False
    away = absences[-1]
    failsafe_s = context.vehicles[vehicle.name].failsafe_s
    if failsafe_s is None and away.deaf and _is_unseen_change(vehicle):
        failsafe_s = BEAT_S  # it did not say whether it has one, and it has
    began_s = away.until_s - away.pause_s
    dialect, mode_before = context.vehicles[vehicle.name].dialect, vehicle.telemetry.mode_before
    holds = dialect.ground_station_failsafe.pause is not None
    straight = not holds or (mode_before is not None and is_mission_mode(dialect, mode_before))
    due_s, since_s = began_s + (failsafe_s or 0.0) + AT_ONCE_S, vehicle.telemetry.mode_since_s
    if straight and not _is_unseen_change(vehicle) and since_s > max(due_s, away.until_s + COMES_LATE_S):
        return False  # it was heard on its mission since: its failsafe would have acted, or held it first
    acted = failsafe_s is not None and away.pause_s >= failsafe_s - BEAT_S
    return acted and since_s >= began_s and now_s - away.until_s <= REACTS_S


def is_under_foreign_control(vehicle: VehicleState) -> bool:
    """Return whether a person has it, or may have: nothing is commanded then."""
    return vehicle.custody.taken is not None or (vehicle.armed and vehicle.custody.cause is ModeCause.PERSON)


def is_in_manual_mode(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it stands in a mode that only a person flies in."""
    return is_manual_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)


def is_taken_over(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether it is certain that a person has taken it."""
    sure = now_s - vehicle.telemetry.mode_since_s >= SURE_AFTER_S
    return sure and vehicle.armed and vehicle.custody.cause is ModeCause.PERSON
