"""Decide who changed a vehicle's mode, and which party controls it: this flight, the vehicle, or a person.

A mode we did not command may be anybody's. The strongest evidence comes first: the autopilot's own record, a command
for that mode, a transmitter switch, a reported failure. Without evidence it is unknown: both autopilots report an
active failsafe in a text or by a critical HEARTBEAT.

In a planned flight every mode change has a cause. One that we commanded is ours; one explained by a failsafe, the
mission's end or a landing is the vehicle's own; any other is a person's, by mode switch, sticks or another ground
station. In doubt it is a person's, and nothing is commanded.
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
from executor.core.telemetry.mode_evidence import has_failsafe_action
from missions import Dialect, Phase
from missions.autopilots.dialect import is_home_mode, is_manual_mode, is_mission_mode

RECORDED_S = 2.0
"""Largest distance between a mode's record and its HEARTBEAT, which comes up to a second later."""
ORDERED_S = 5.0
"""Time from a command, which is resent until it takes effect, to the HEARTBEAT that shows it; its acknowledgement may
come in between."""
ANSWERED_S = 3.0
"""Time by which an acknowledgement may come after it."""
SWITCHED_S = 2.5
"""Time from a switch move to the HEARTBEAT that shows its mode: a moment for the autopilot, and a second."""
LATE_CHANNELS_S = 1.0
"""Time by which channels may be reported after the HEARTBEAT."""
BEAT_S, MOST_LATE_S = 1.0, 15.0
"""Interval of HEARTBEATs, and the longest gap over which a mode change is dated; a longer one is judged as a
silence."""
CRITICAL_S = 2.5
SAID_BEFORE_S, SAID_AFTER_S = 15.0, 4.0
"""Times by which a failsafe's text precedes its mode, as it may hold first, and follows it, as a text may be
delayed."""
NAMED_S = 5.0
OVER_S = 2.0
"""Time before the HEARTBEAT within which a failure that is over may have caused its mode: a return ends a breach at
once."""
BREACHED_S = 4.0
"""Tolerance of a breach report, which comes every second or two."""
SETTLED_S = 4.0
"""Time after which no more evidence for a mode arrives."""
GEOFENCE_SENSOR = 0x100000
"""MAV_SYS_STATUS_GEOFENCE."""


@dataclass(frozen=True, slots=True)
class Attribution:
    """The party that changed a mode, and the evidence."""

    by: Actor
    why: str = ""
    """In words; empty without evidence."""
    failed: OwnFailsafe | None = None
    """The failure, for a failsafe that reports one."""


def attribute_mode_change(setup: VehicleSetup, vehicle: VehicleState) -> Attribution:
    """Return the party that set the mode in a vehicle's newest HEARTBEAT."""
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
    """Return by how much earlier than usual its mode may have changed, as HEARTBEATs were lost."""
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
    """Return the failsafe that may have caused a mode: RTL, landing, hold, or a mode without position."""
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
    """Return whether it reported its fence breached around that time, or still does."""
    return vehicle.sensors.fence_breached or abs(vehicle.sensors.breached_s - at_s) <= BREACHED_S


def describe_fence_action(setup: VehicleSetup, vehicle: VehicleState) -> str:
    """Return in words that its fence caused its mode; empty if unknown."""
    who = attribute_mode_change(setup, vehicle)
    named = who.by is Actor.FAILSAFE and who.failed is not None and who.failed.what == "fence"
    return who.why if named else ""


def _is_at_mission_end(setup: VehicleSetup, vehicle: VehicleState) -> bool:
    """Return whether its current item is the last or last but one, as the last may be a return."""
    seq, total = vehicle.telemetry.item or (0, None)
    if not total or total == NO_ITEM or not vehicle.sortie.flew_mission:
        return False
    last = total if setup.dialect.current_counts_home else total - 1
    return seq >= last - 1


def find_switch_before(known: ModeEvidence, at_s: float, late_s: float = 0.0) -> str:
    """Return in words the transmitter switch moved just before a time; empty if none."""
    for moved in reversed(known.switched):
        if moved.from_s <= at_s + LATE_CHANNELS_S and moved.to_s >= at_s - late_s - SWITCHED_S:
            return failsafe.SWITCHED.format(channel=moved.channel, was_us=moved.was_us, now_us=moved.now_us)
    return ""


def is_attribution_final(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether no more evidence for its mode change is expected."""
    return now_s - vehicle.telemetry.mode_since_s >= SETTLED_S


def _has_foreign_order(known: ModeEvidence, at_s: float, late_s: float, mode: int | None) -> bool:
    """Return whether another station commanded a mode just before a time; None for an unnamed mode."""
    return any(
        order.custom_mode == mode and -ORDERED_S - late_s <= seen_s - at_s <= (ANSWERED_S if mode is None else 1.0)
        for order, seen_s in known.others_orders
    )


def _last_failure_s(known: ModeEvidence) -> float:
    """Return when it last reported a failure on which an autopilot acts."""
    return max((said_s for failed, said_s in known.failed if has_failsafe_action(failed)), default=-math.inf)


def _find_failure(known: ModeEvidence, at_s: float) -> OwnFailsafe | None:
    """Return the failure acted on when the mode changed, one with a named reason first."""
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
"""Time for which a mode change is not yet final; a failsafe's text may follow the HEARTBEAT with its mode."""
LATE_TEXT_S = 4.0
"""Longest delay of a text that explains a mode change."""
OVERTAKEN_S = 3.0
"""Time in which a withdrawn start shows whether it took effect: two HEARTBEATs and their delay."""
CHARGE_CRITICAL, CHARGE_EMERGENCY = 3, 4
"""MAV_BATTERY_CHARGE_STATE."""


def update_mode_cause(
    context: Scene, absences: Sequence[GroundStationAbsence], before: VehicleState, after: VehicleState, now_s: float
) -> VehicleState:
    """Return a vehicle with the cause of its mode after a HEARTBEAT; `absences` are the ground station's."""
    beat, old = after.telemetry.heartbeat, before.telemetry.heartbeat
    if beat is None:
        return after
    if not beat.armed:
        return after if after.custody.cause is ModeCause.OURS else after.with_custody(cause=ModeCause.OURS)
    armed_now = old is not None and not old.armed
    if old is not None and old.custom_mode == beat.custom_mode and not armed_now:
        return after
    if old is None or (after.stage is Stage.STARTING and old.custom_mode == beat.custom_mode):
        # First contact, or armed by us in its present mode: nothing has changed.
        return after.with_custody(cause=ModeCause.OURS)
    cause = determine_mode_cause(context, absences, before, after, now_s)
    certain = cause is ModeCause.PERSON and (
        _must_be_person(context, before, after) or is_set_by_person(context, after)
    )
    left = old.custom_mode in after.orders.ordered_modes and beat.custom_mode not in after.orders.ordered_modes
    # A command that took effect, and whose mode was left again, explains no later mode.
    return after.with_custody(cause=cause, certain=certain).with_orders(
        ordered_modes=frozenset() if left else after.orders.ordered_modes
    )


def review_mode_cause(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> VehicleState:
    """Return a vehicle whose mode change was explained by later evidence, or is no longer explained."""
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
    if vehicle.custody.cause is ModeCause.MISSION and holds:  # where its mission's end would leave it on the ground
        # In its landing a failsafe makes it hold as anywhere, and reports it.
        itself = _is_explained_by_failsafe(context, absences, vehicle, now_s)
        cause = ModeCause.FAILSAFE if itself else ModeCause.PERSON
        return vehicle.with_custody(cause=cause, certain=not itself)
    doubtful = vehicle.custody.cause is ModeCause.PERSON and not vehicle.custody.certain
    if not doubtful or now_s - vehicle.telemetry.mode_since_s > LATE_TEXT_S:
        return vehicle
    itself = _is_explained_by_failsafe(context, absences, vehicle, now_s)
    return vehicle.with_custody(cause=ModeCause.FAILSAFE) if itself else vehicle


CALM_S = 2.5
"""Time for two HEARTBEATs and their delay."""


def is_holding(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it reports a hold."""
    return vehicle.mode == context.vehicles[vehicle.name].dialect.modes.hold.custom_mode


def _is_holding_calmly(context: Scene, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether it holds without a critical HEARTBEAT, which an active failsafe would cause.

    PX4 reports CRITICAL while a failsafe has changed its mode, ArduPilot while any but the fence's has. A text, which
    anybody can send, or a silence explains a hold for a moment only.
    """
    beat_s = vehicle.link.heartbeat_s
    if beat_s is None or not is_holding(context, vehicle) or not vehicle.armed:
        return False
    if vehicle.is_critical or vehicle.sensors.fence_breached:
        return False
    # By a HEARTBEAT late enough: the first one with the mode may precede the failsafe's flag.
    return beat_s - vehicle.telemetry.mode_since_s >= CALM_S and now_s >= beat_s


HOVERS_S = 2.5
"""Time after which a vehicle that holds at its mission's end should report on ground, as it does every second."""


def determine_mode_cause(  # noqa: PLR0911 - one return for each cause
    context: Scene, absences: Sequence[GroundStationAbsence], before: VehicleState, vehicle: VehicleState, now_s: float
) -> ModeCause:
    """Return the cause of the mode in a vehicle's newest HEARTBEAT."""
    dialect, mode = context.vehicles[vehicle.name].dialect, vehicle.mode
    if mode is None:
        return ModeCause.OURS
    if vehicle.is_on_base and not has_never_landed(context, vehicle):
        # It armed without a command of ours, or its start was withdrawn too late.
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
        return before.custody.cause  # an RTL ends in a landing
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
    """Return whether the cause of the previous mode rules out any but a person."""
    dialect = context.vehicles[vehicle.name].dialect
    if not before.armed or vehicle.mode is None:
        return False
    if before.custody.cause is ModeCause.PERSON:
        # A person who has it changes its mode again, unless it newly reports an action of its own.
        return _last_failure_s(vehicle.evidence) < before.telemetry.mode_since_s
    if not is_holding(context, vehicle) or not is_home_mode(dialect, before.mode):
        return False
    # A failsafe holds before it returns, never after; in a commanded RTL only one that holds first can.
    holds_first = dialect.ground_station_failsafe.pause is not None or vehicle.sensors.fence_breached
    return before.custody.cause is ModeCause.FAILSAFE or (before.custody.cause is ModeCause.OURS and not holds_first)


def is_set_by_person(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a pilot's switch or another station's command coincided with its mode change.

    That may be chance: then a failsafe is left to a person watching it, rather than the reverse.
    """
    return attribute_mode_change(context.vehicles[vehicle.name], vehicle).by in {Actor.PILOT, Actor.GROUND_STATION}


def has_never_landed(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a vehicle counted as landed is armed high in the air, where no start happens."""
    fix = vehicle.motion.fix
    if vehicle.stage is not Stage.LANDED or not vehicle.armed or not vehicle.sortie.took_off or fix is None:
        return False
    fresh = abs((vehicle.link.heartbeat_s or 0.0) - fix.at_s) < SURE_AFTER_S
    return fresh and fix.alt_rel_m > context.limits.off_pad_up_m


def may_arm_late(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle kept on the ground may still arm, as its start was in transit."""
    left_s = vehicle.sortie.left_s
    told = vehicle.stage is Stage.LANDED and not vehicle.sortie.took_off and left_s is not None
    return told and now_s - (left_s or 0.0) <= OVERTAKEN_S


def _is_landing_after_return(dialect: Dialect, before: VehicleState, vehicle: VehicleState) -> bool:
    return is_home_mode(dialect, before.mode) and vehicle.mode == dialect.modes.land.custom_mode


def _is_return_after_landing(dialect: Dialect, before: VehicleState, mode: int) -> bool:
    """Return whether it leaves a landing for the RTL that it was part of, which none does by itself."""
    return (
        before.armed
        and before.mode == dialect.modes.land.custom_mode != mode
        and before.orders.ordered_mode_s < before.telemetry.mode_since_s
        and is_home_mode(dialect, mode)
    )


def _is_landing_elsewhere(context: Scene, before: VehicleState, vehicle: VehicleState) -> bool:
    """Return whether it breaks off its RTL for a landing on the way: commanded by another party, or explained.

    An old position does not show that it has reached its pad.
    """
    dialect, modes = context.vehicles[vehicle.name].dialect, vehicle.orders.ordered_modes
    if not before.armed or before.mode == vehicle.mode or not _is_landing_after_return(dialect, before, vehicle):
        return False
    # A followed RTL command explains no landing elsewhere; a landing command does.
    ordered = vehicle.mode in modes and before.mode not in modes
    fix, limits = vehicle.motion.fix, context.limits
    home = fix is None or (
        vehicle.telemetry.mode_since_s - fix.at_s <= limits.link_stale_s and is_home_by_own_estimate(context, vehicle)
    )
    return not ordered and not home


def _is_mission_end(context: Scene, before: VehicleState, vehicle: VehicleState, mode: int) -> bool:
    """Return whether the last items of a mission lead to this mode.

    PX4 leaves mission mode for a landing, and holds once on the ground: nothing follows that.
    """
    dialect, leg = context.vehicles[vehicle.name].dialect, vehicle.leg
    if vehicle.stage is not Stage.FLYING or leg is None or not dialect.ends_in_other_mode:
        return False
    fix = vehicle.motion.fix
    low = fix is not None and fix.alt_rel_m <= context.limits.airborne_m
    # A failsafe makes it hold in its landing as anywhere.
    ends_in_hold = is_holding(context, vehicle) and low and not vehicle.is_critical
    itself = ends_in_hold or (is_home_mode(dialect, mode) and not is_holding(context, before))
    return itself and leg.phase is Phase.LAND


def _is_explained_by_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    setup, mode = context.vehicles[vehicle.name], vehicle.mode
    if mode is None or not (is_home_mode(setup.dialect, mode) or is_holding(context, vehicle)):
        return False
    return (
        _match_failsafe(setup, vehicle, vehicle.telemetry.mode_since_s, mode) is not None
        or _is_newly_critical(vehicle, context.limits.alarm_s)
        or bool(describe_fence_departure(vehicle, now_s, context.limits.link_stale_s))
        or vehicle.power.battery.charge_state >= CHARGE_EMERGENCY
        or (_is_unseen_change(vehicle) and _may_follow_silence(context, vehicle))
        or is_gcs_absence_failsafe(context, absences, vehicle, now_s)
    )


def _is_newly_critical(vehicle: VehicleState, within_s: float) -> bool:
    """Return whether a failsafe is active that began about when the mode changed.

    An older one explains nothing: ArduPilot's stays active after one whose action was to warn, or to continue the
    mission.
    """
    since_s = vehicle.telemetry.critical_since_s
    return vehicle.is_critical and (since_s is None or vehicle.telemetry.mode_since_s - since_s <= within_s)


def is_unseen_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether it was found holding after longer than a failsafe that only holds first would.

    By the vehicle's clock: messages queued while the ground station paused arrive late.
    """
    fix, from_s = vehicle.motion.fix, vehicle.custody.unseen_from_boot_s
    if not is_holding(context, vehicle) or not _is_unseen_change(vehicle):
        return False
    if fix is None or from_s is None or fix.at_s < vehicle.telemetry.mode_since_s:
        return False
    unseen_s = fix.boot_s - (fix.at_s - vehicle.telemetry.mode_since_s) - from_s
    failsafe_s = context.vehicles[vehicle.name].failsafe_s  # until it returns; its hold is included
    return unseen_s >= (max_failsafe_hold_s(context, vehicle.name) if failsafe_s is None else failsafe_s + HOLDS_ON_S)


def max_failsafe_hold_s(context: Scene, name: str) -> float:
    """Return how long a vehicle may hold before its own failsafe acts; COM_FAIL_ACT_T may be up to 25 s."""
    limits = context.limits
    return max(limits.failsafe_hold_s, context.vehicles[name].holds_s + limits.failsafe_late_s)


def is_long_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether its HEARTBEATs show a hold longer than any failsafe that only holds first.

    A silent vehicle may have paused, and its clock too; one without HEARTBEATs may have left the hold.
    """
    link = vehicle.link
    if not is_holding(context, vehicle):
        return False
    from_s = max(vehicle.telemetry.mode_since_s, link.excused_s, link.regained_s or 0.0)
    return (link.heartbeat_s or 0.0) - from_s >= max_failsafe_hold_s(context, vehicle.name)


def is_failsafe_in_hold(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether a failsafe that holds first began in a hold of ours, where the mode does not show it."""
    told = vehicle.telemetry
    if context.vehicles[vehicle.name].dialect.ground_station_failsafe.pause is None:
        return False
    began_s = max(told.critical_since_s or -math.inf, _last_failure_s(vehicle.evidence))
    holds = is_holding(context, vehicle) and began_s > told.mode_since_s
    return holds and (vehicle.link.heartbeat_s or 0.0) - began_s < max_failsafe_hold_s(context, vehicle.name)


def _is_hold_after_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    """Return whether a failsafe that holds first has not acted, as another party commanded a hold meanwhile.

    In PX4 that ends the failsafe's action, and no HEARTBEAT shows it: the mode is the same (framework.cpp). A fence
    breach, or a lost ground station without RTL as its action, may end in a hold; an empty battery never does.
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
    """Return whether it reports itself that a person took over during its failsafe's hold, as PX4 does by an event."""
    (recorded, recorded_s), since_s = vehicle.evidence.recorded, vehicle.telemetry.mode_since_s
    if not is_holding(context, vehicle) or vehicle.orders.ordered_mode_s >= since_s:
        return False  # our own command counts as a takeover too
    return recorded is not None and recorded.by is Actor.PILOT and recorded_s >= since_s


def _is_unseen_change(vehicle: VehicleState) -> bool:
    """Return whether the mode changed during a silence of its link, as failsafes are for."""
    until_s = vehicle.custody.unseen_until_s
    return until_s is not None and vehicle.telemetry.mode_since_s == until_s


def _may_follow_silence(context: Scene, vehicle: VehicleState) -> bool:
    """Return whether its GCS failsafe leads to its mode, as far as known; or its mission does, over its pad."""
    setup = context.vehicles[vehicle.name]
    dialect = setup.dialect
    if not setup.returns:
        return True
    if vehicle.mode == dialect.modes.land.custom_mode:
        return dialect.ends_in_other_mode and is_home_by_own_estimate(context, vehicle)
    return not is_holding(context, vehicle) or dialect.ground_station_failsafe.pause is not None


HOLDS_ON_S = 5.0
"""Tolerance between PX4's clock and ours, for link delays."""
REACTS_S = 30.0
"""Time for PX4 to hold, return, and report the mode change a second later."""
AT_ONCE_S = 5.0
"""Time in which it acts on our absence, or begins its hold, and reports it."""
COMES_LATE_S = 2.5
"""Time for two HEARTBEATs and their delay, after our return."""


def is_gcs_absence_failsafe(
    context: Scene, absences: Sequence[GroundStationAbsence], vehicle: VehicleState, now_s: float
) -> bool:
    """Return whether its GCS failsafe acts on an absence of the ground station, or a failure of our radio."""
    if not absences or (vehicle.mode is not None and not _may_follow_silence(context, vehicle)):
        return False
    away = absences[-1]
    failsafe_s = context.vehicles[vehicle.name].failsafe_s
    if failsafe_s is None and away.deaf and _is_unseen_change(vehicle):
        failsafe_s = BEAT_S  # it did not report one, and has one
    began_s = away.until_s - away.pause_s
    dialect, mode_before = context.vehicles[vehicle.name].dialect, vehicle.telemetry.mode_before
    holds = dialect.ground_station_failsafe.pause is not None
    straight = not holds or (mode_before is not None and is_mission_mode(dialect, mode_before))
    due_s, since_s = began_s + (failsafe_s or 0.0) + AT_ONCE_S, vehicle.telemetry.mode_since_s
    if straight and not _is_unseen_change(vehicle) and since_s > max(due_s, away.until_s + COMES_LATE_S):
        return False  # received on its mission since: its failsafe would have acted or held by then
    acted = failsafe_s is not None and away.pause_s >= failsafe_s - BEAT_S
    return acted and since_s >= began_s and now_s - away.until_s <= REACTS_S


def is_taken_over(vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a person has certainly taken it."""
    sure = now_s - vehicle.telemetry.mode_since_s >= SURE_AFTER_S
    return sure and vehicle.armed and vehicle.custody.cause is ModeCause.PERSON
