"""Report congested and weak telemetry radios in flight, and adapt the stream rates behind them.

Streams are thinned by one step after some seconds of congestion, and raised by one after a long time with room. If that
was too early, the next wait is twice as long. Commands and missions come first: no streams are requested while the
transmit buffer is full or a mission upload uses the radio, and congestion meanwhile is no reason to thin.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.formatting import join_first_names
from executor.core.interface.codes import ChannelCode
from executor.core.interface.commands import AskStreams, Command
from executor.core.lines import link
from executor.core.radio_budget import (
    FULL_BUFFER_PCT,
    GLOBAL_POSITION_INT,
    OWN_FACTORS,
    RadioShare,
    list_streams_hz,
)
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.link_quality import COUNT_AGE_S
from executor.core.state.radio_channel import (
    ChannelMeasures,
    ChannelState,
    ChannelTotals,
    choose_streams_hz,
    describe_figures,
    judge_channel,
    measure_channel,
)
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Dialect

EVALUATION_S = 1.0
RAISE_S, CLEAR_S = 6.0, 10.0
"""Times for which a problem must last to be reported, and be absent to count as over."""
REPEAT_S = 60.0
"""Time within which a problem that recurs is not reported again."""
CONGESTED_S, SETTLE_S = 8.0, 20.0
"""Congestion time before streams are thinned, and time to measure the effect before the next step."""
LONGEST_ROOM_S = 960.0
"""Longest wait before streams are raised; the wait is `ROOM_S`, doubled each time that was too early."""
LARGEST_SHARE = 0.8
"""Share of the capacity that the traffic, with the streams raised, must not exceed."""
MOST_NAMES = 4


def watch_channels(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Evaluate every radio once a second."""
    if state.progress.launched_s is None:
        return state, ()
    commands: list[Command] = []
    for share in list_channels(context):
        known = state.channels.get(share.names[0], ChannelState())
        vehicles = [state.vehicles[name] for name in share.names]
        if now_s - known.looked_s < EVALUATION_S or (found := measure_channel(share, vehicles, now_s)) is None:
            continue
        busy = any(one.assignment.pending is not None for one in vehicles)
        missions_s = now_s if busy else max(known.missions_s, state.progress.launched_s)
        known, lines = _evaluate_measurement(replace(known, missions_s=missions_s), found, now_s)
        dialect = context.vehicles[share.names[0]].dialect
        if any(_must_change_streams(vehicle, known.step) for vehicle in vehicles):
            after = known  # the effect is not known yet
        else:
            after = _follow_channel(share, dialect, known, found, busy=busy, now_s=now_s)
        if after.step != known.step:
            lines.append(_describe_step(share, dialect, after.step, raised=after.step < known.step))
        commands += lines
        state = replace(state, channels=MappingProxyType({**state.channels, share.names[0]: after}))
        free_pct = None if found.radio is None else found.radio.free_buffer_pct
        for vehicle in () if busy or (free_pct is not None and free_pct < FULL_BUFFER_PCT) else vehicles:
            state, asked = _request_streams(context, state, vehicle, after.step, now_s)
            commands += asked
            if asked:
                break  # the others follow in the next second
    return state, tuple(commands)


def list_channels(context: Context) -> tuple[RadioShare, ...]:
    """Return each link that may be a radio, with the vehicles behind it."""
    return tuple(dict.fromkeys(setup.radio for setup in context.vehicles.values() if setup.radio.names))


def _describe_step(share: RadioShare, dialect: Dialect, step: int, *, raised: bool) -> Command:
    step = max(step, share.choose_step(dialect, on_radio=True))
    return (link.RAISED if raised else link.THINNED).say(
        vehicles=join_first_names(share.names, MOST_NAMES),
        positions_hz=list_streams_hz(dialect, step)[GLOBAL_POSITION_INT],
    )


def _evaluate_measurement(
    known: ChannelState, found: ChannelMeasures, now_s: float
) -> tuple[ChannelState, list[Command]]:
    """Evaluate one measurement; report a problem once it has lasted, and its end."""
    code, why = judge_channel(found) or (None, "")
    if is_congestion(code) and now_s - known.missions_s < COUNT_AGE_S:
        code, why = None, ""  # the uploads are still in the byte counts
    since_s = known.found_since_s if is_congestion(code) is is_congestion(known.found) else now_s
    totals = _add_totals(known, found, min(now_s - known.looked_s, 2 * EVALUATION_S))
    after = replace(known, looked_s=now_s, found=code, found_since_s=since_s, totals=totals)
    lasted = now_s - since_s >= (CLEAR_S if code is None else RAISE_S)
    if is_congestion(code) is is_congestion(known.told) or not lasted:
        return after, []
    if known.quiet if code is None else now_s - known.told_s < REPEAT_S:
        return replace(after, told=code, quiet=code is not None), []
    line = link.RADIO_CLEAR if code is None else link.CONGESTED if code.is_congestion else link.WEAK
    said = line.say(vehicles=join_first_names(found.vehicles, MOST_NAMES), why=why, figures=describe_figures(found))
    return replace(after, told=code, told_s=now_s), [said]


def is_congestion(code: ChannelCode | None) -> bool | None:
    """Return whether a problem is congestion, as opposed to a weak signal; None without a problem."""
    return None if code is None else code.is_congestion


def _add_totals(known: ChannelState, found: ChannelMeasures, elapsed_s: float) -> ChannelTotals:
    before, trip_s = known.totals, found.round_trip_s
    return ChannelTotals(
        before.seconds + elapsed_s,
        before.bytes + found.bytes_s * elapsed_s,
        max(before.most_bytes_s, found.bytes_s),
        before.most_round_trip_s if trip_s is None else max(before.most_round_trip_s or 0.0, trip_s),
        before.lost_s + (found.lost or 0.0) * elapsed_s,
        before.congested_s + (elapsed_s if is_congestion(known.told) else 0.0),
        before.weak_s + (elapsed_s if is_congestion(known.told) is False else 0.0),
        max(before.most_step, known.step),
    )


def _follow_channel(
    share: RadioShare, dialect: Dialect, known: ChannelState, found: ChannelMeasures, *, busy: bool, now_s: float
) -> ChannelState:
    """Decide by how many steps the streams behind a radio are thinned.

    Args:
        share: The radio's share of each vehicle behind it.
        dialect: The dialect of the vehicles.
        known: The state of the radio.
        found: The new measurement.
        busy: Whether a mission upload uses the radio.
        now_s: The time.
    """
    if busy or known.found is not None:
        known = replace(known, room_since_s=None)
    if busy:
        return replace(known, crowded_since_s=None)
    base = share.choose_step(dialect, on_radio=True)
    step = max(known.step, base)
    if is_congestion(known.found):
        since_s = now_s if known.crowded_since_s is None else known.crowded_since_s
        known = replace(known, crowded_since_s=since_s)
        if step == len(OWN_FACTORS) - 1 or now_s - since_s < CONGESTED_S or now_s - known.stepped_s < SETTLE_S:
            return known
        early = now_s - known.raised_s < known.patience_s
        patience_s = min(LONGEST_ROOM_S, 2 * known.patience_s) if early else known.patience_s
        return replace(known, step=step + 1, stepped_s=now_s, patience_s=patience_s, crowded_since_s=None)
    known = replace(known, crowded_since_s=None)
    more_bytes_s = share.sum_bytes_s(dialect, step - 1) - share.sum_bytes_s(dialect, step) if step > base else 0.0
    if step <= base or found.bytes_s + more_bytes_s > LARGEST_SHARE * found.capacity_bytes_s or known.found is not None:
        return replace(known, room_since_s=None)
    since_s = now_s if known.room_since_s is None else known.room_since_s
    if now_s - since_s < known.patience_s:
        return replace(known, room_since_s=since_s)
    lower = 0 if step - 1 <= base else step - 1
    return replace(known, step=lower, stepped_s=now_s, raised_s=now_s, room_since_s=None)


def _must_change_streams(vehicle: VehicleState, step: int) -> bool:
    """Return whether a vehicle's streams differ from those decided, and may be requested now."""
    ours = vehicle.stage is not Stage.PILOT and not vehicle.is_under_foreign_control
    return vehicle.orders.stream_step != step and ours and not vehicle.link.stale and vehicle.orders.errand is None


def _request_streams(context: Context, state: FleetState, vehicle: VehicleState, step: int, now_s: float) -> Stepped:
    """Request a vehicle's streams where the rates requested before differ from those decided."""
    if not _must_change_streams(vehicle, step):
        return state, ()
    setup = context.vehicles[vehicle.name]
    before = choose_streams_hz(setup, vehicle)
    vehicle = vehicle.with_orders(stream_step=step, streams_asked_s=now_s)
    after = choose_streams_hz(setup, vehicle)
    changed = tuple(message for message, rate_hz in after.items() if rate_hz != before[message])
    return state.put(vehicle), (AskStreams(vehicle.name, changed),) if changed else ()
