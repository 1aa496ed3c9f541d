"""What may say who changed a mode, and what has failed, into what is known of a vehicle."""

from __future__ import annotations

import math
from dataclasses import replace

from executor.core.interface.messages import (
    CRITICAL,
    Heartbeat,
    ModeChange,
    OrderSeen,
    OwnFailsafe,
    RcChannels,
    StatusText,
    VehicleSetting,
)
from executor.core.state.vehicle_parts import FOLLOWED_LATE_S, ModeEvidence, Orders, SwitchMove
from executor.core.telemetry.failsafe_texts import parse_failure_text

MODE_CHANNEL_SETTINGS = frozenset({"FLTMODE_CH", "MODE_CH", "RC_MAP_FLTMODE"})
"""ArduPilot's, its rovers' and PX4's name of it."""
THROTTLE_LOST_SETTING = "FS_THR_VALUE"
THROTTLE_LOST_US = 975.0
"""Its default; PX4 is told by the receiver itself."""
LEAST_US, MOST_US = 800, 2200
"""What no receiver sends is no channel."""
THROTTLE = 2
STICKS = 4
MOST_CHANNELS = 18
MODE_STEP_US = 80
"""Six positions of a switch are 160 apart: so much is no noise, nor a knob that is turned."""
SWITCH_STEP_US = 200
"""Any other switch has two or three positions; a knob or a gimbal's wheel moves in smaller steps."""
REPEATED_S = 0.8
"""An order that is sent again within this time is the same."""
MOST_ORDERS, MOST_SWITCHES = 24, 4
LATE_ORDER_S = 20.0
"""An older order explains nothing any more."""

EvidenceMessage = OrderSeen | ModeChange | RcChannels | VehicleSetting | OwnFailsafe
"""What is about a vehicle and says nothing of where it is or what it does."""


def record_evidence(known: ModeEvidence, message: EvidenceMessage, now_s: float) -> ModeEvidence:
    """Take what may explain a mode."""
    match message:
        case OrderSeen(custom_mode=mode):
            if any(one.custom_mode == mode and now_s - seen_s < REPEATED_S for one, seen_s in known.others_orders):
                return known
            young = [one for one in known.others_orders if now_s - one[1] < LATE_ORDER_S]
            return replace(known, others_orders=(*young, (message, now_s))[-MOST_ORDERS:])
        case ModeChange():
            return replace(known, recorded=(message, now_s))
        case RcChannels(values_us):
            moved = _find_moved_switch(known, values_us, now_s)
            switched = known.switched if moved is None else (*known.switched, moved)[-MOST_SWITCHES:]
            return replace(known, channels_us=values_us, channels_s=now_s, switched=switched)
        case VehicleSetting(name, value):
            return _record_setting(known, name, value)
        case OwnFailsafe():
            return _record_failure(known, message, now_s)


def may_be_ours(given: Orders, seen: OrderSeen, now_s: float) -> bool:
    """Return whether an order that was seen, or its answer, may be one that was given from here.

    Most ground stations have our number, and old firmware answers without one. Who has ordered nothing lately knows
    that it is another's; who has, does not, and then it proves nothing.
    """
    return seen.by is None and now_s - given.ordered_mode_s <= FOLLOWED_LATE_S


def record_failure_text(known: ModeEvidence, message: StatusText, now_s: float, *, low_acts: bool) -> ModeEvidence:
    """Take what a text says has failed."""
    found = parse_failure_text(message.text, low_acts=low_acts)
    return known if found is None else _record_failure(known, found, now_s)


def record_critical_heartbeat(
    known: ModeEvidence, before: Heartbeat | None, beat: Heartbeat, now_s: float
) -> ModeEvidence:
    """Take a HEARTBEAT: both autopilots call themselves critical as long as a failsafe acts."""
    rises = beat.system_status >= CRITICAL and (before is None or before.system_status < CRITICAL)
    return replace(known, critical_s=now_s) if rises and before is not None else known


def _record_failure(known: ModeEvidence, said: OwnFailsafe, now_s: float) -> ModeEvidence:
    others = tuple(one for one in known.failed if one[0].what != said.what)
    if said.active:
        return replace(known, failed=(*others, (said, now_s)))
    over = tuple((*one, now_s) for one in known.failed if one[0].what == said.what)
    if not over:
        return known
    passed = tuple(one for one in known.passed if one[0].what != said.what)
    return replace(known, failed=others, passed=(*passed, *over))


def _record_setting(known: ModeEvidence, name: str, value: float) -> ModeEvidence:
    if name in MODE_CHANNEL_SETTINGS and 0 <= value <= MOST_CHANNELS and value == int(value):
        return replace(known, mode_channel=int(value))
    if name == THROTTLE_LOST_SETTING and math.isfinite(value):
        return replace(known, throttle_lost_us=value)
    return known


def _find_moved_switch(known: ModeEvidence, now_us: tuple[int, ...], now_s: float) -> SwitchMove | None:
    """Return a switch that was moved since the last report, the one for the modes before others."""
    if _is_transmitter_lost(known, known.channels_us) or _is_transmitter_lost(known, now_us):
        return None  # a receiver that hears nothing puts its channels where it was told to
    mode_channel = known.mode_channel or 0
    moved = [
        SwitchMove(channel, was, now, known.channels_s, now_s)
        for channel, (was, now) in enumerate(zip(known.channels_us, now_us, strict=False), start=1)
        if (channel == mode_channel or channel > STICKS)
        and LEAST_US <= was <= MOST_US
        and LEAST_US <= now <= MOST_US
        and abs(now - was) >= (MODE_STEP_US if channel in {mode_channel, DEFAULT_MODE_CHANNEL} else SWITCH_STEP_US)
    ]
    return min(moved, key=lambda one: one.channel not in {mode_channel, DEFAULT_MODE_CHANNEL}, default=None)


DEFAULT_MODE_CHANNEL = 5
"""FLTMODE_CH of ArduPilot, where nobody has changed it."""


def _is_transmitter_lost(known: ModeEvidence, values_us: tuple[int, ...]) -> bool:
    lost_us = THROTTLE_LOST_US if known.throttle_lost_us is None else known.throttle_lost_us
    return len(values_us) > THROTTLE and LEAST_US <= values_us[THROTTLE] < lost_us
