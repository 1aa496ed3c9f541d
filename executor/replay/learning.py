"""`faultline replay --learn`: what an aircraft's own logs say of it, each figure with how sure it is.

A flight is cut into blocks of some seconds. A block in which speed and climb hardly change is one observation of what
level flight at its speed, or a climb, draws; resistance is from steps of the load between two reports; the rest is
counted. A figure's deviation is the scatter of its observations, by flights where there are several, and never below
what current sensors are good for.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from statistics import fmean, median, stdev

from executor.core.interface.messages import (
    Battery,
    FlightMessage,
    Heartbeat,
    Position,
    RcChannels,
    SystemStatus,
    Traffic,
    VehicleSetting,
)
from executor.core.state.vehicle_parts import ModeEvidence
from executor.core.telemetry.mode_evidence import record_evidence
from executor.errors import LogError
from executor.replay.log_replay import LogClock, is_known_copter
from executor.replay.open_log import open_log

BLOCK_S, CLIMB_BLOCK_S = 6.0, 3.0
"""Climbs are short."""
LEAST_REPORTS = 3
HIGH_M = 1.5
"""Lower it may stand on the ground."""
LEVEL_M_S, CLIMBS_M_S, STEADY_M_S = 0.3, 0.5, 1.5
"""Level flight, a climb, and how much speed or climb may change within a block."""
BIN_M_S, FIRST_BIN_M_S = 2.0, 0.5
HOVER_M_S = 0.7
FEWEST = 4
"""Observations that a figure needs."""
SENSOR_SHARE = 0.01
"""No current is known better than that, however often it is read."""
STEP_SHARE = 0.15
"""A step of the load from which the resistance is seen, as a share of the current: less is the sensor's noise."""
STEP_S = 3.0
STALE_S = 4.0
COUNTED_PCT = 5.0
ROUNDED_PCT = 0.41
"""Deviation of the difference of two percentages that are whole."""
BEFORE_S, AFTER_S = 3.5, 1.0
RESTS_S = 20
"""After a flight the voltage still rises for so long at least."""
FRAMES = 120
"""A minute with fewer frames says nothing of the loss."""
FULL_CELL_V, LEAST_CELL_V = 4.25, 3.3
SWITCH_SETTINGS = ("FLTMODE_CH", "RC_MAP_FLTMODE", "RC_MAP_MODE_SW")


@dataclass(frozen=True, slots=True)
class LearnedFigure:
    """A figure, how sure it is, and how many observations it is from."""

    mean: float
    sd: float
    samples: int


@dataclass(frozen=True, slots=True)
class SteadyBlock:
    """Some seconds of one flight in which little changed."""

    flight: int
    speed_m_s: float
    climb_m_s: float
    current_a: float
    voltage_v: float | None


@dataclass(frozen=True, slots=True)
class ModeSwitch:
    """The pilot's mode switch."""

    channel: int
    source: str
    moved: int
    changes: int


@dataclass(frozen=True, slots=True)
class LearnedAircraft:
    """What logs say of one vehicle."""

    logs: int
    minutes: float
    cells: int | None
    level: tuple[tuple[float, LearnedFigure], ...]
    """Speed and current of level flight."""
    hover_a: LearnedFigure | None
    hover_w: LearnedFigure | None
    climb_share: LearnedFigure | None
    capacity_ah: LearnedFigure | None
    told_capacity_ah: float | None
    """By the autopilot's own parameter."""
    resistance_ohm: LearnedFigure | None
    link_loss_pct: LearnedFigure | None
    switch: ModeSwitch | None


@dataclass(frozen=True, slots=True)
class _Report:
    at_s: float
    volts: float | None
    amperes: float | None
    consumed_ah: float | None
    percent: float | None
    speed_m_s: float
    climb_m_s: float


@dataclass(slots=True)
class AircraftNotes:
    """What is noted of one system while its logs are read."""

    logs: int = 0
    flown_s: float = 0.0
    flights: list[list[_Report]] = field(default_factory=list)
    rests_v: list[float] = field(default_factory=list)
    settings: dict[str, float] = field(default_factory=dict)
    changes: int = 0
    """Of mode."""
    moved: Counter[int] = field(default_factory=Counter)
    """How many of them a switch was moved before, by its channel."""
    minutes: list[tuple[int, int]] = field(default_factory=list)
    """Frames received and missing, of each minute."""


@dataclass(slots=True)
class _LogReading:
    """One system in one log, message by message into its notes."""

    notes: AircraftNotes
    is_copter: bool = False
    beat: Heartbeat | None = None
    place: Position | None = None
    placed_s: float = -math.inf
    flown_until_s: float | None = None
    """When a position showed last that it flies."""
    disarmed_s: float = -math.inf
    consumed_ah: float | None = None
    has_status: bool = False
    """Whether SYS_STATUS reports its battery: beside it BATTERY_STATUS says what was used."""
    evidence: ModeEvidence = field(default_factory=ModeEvidence)
    switched: list[tuple[float, int]] = field(default_factory=list)
    """When a switch was moved, and its channel."""
    changed_s: list[float] = field(default_factory=list)
    """When the mode changed."""
    minutes: dict[int, tuple[int, int]] = field(default_factory=dict)

    def read_message(self, message: FlightMessage, now_s: float) -> None:
        """Take what the system says; until it is known to be a copter only its settings."""
        if not self.is_copter and not isinstance(message, Heartbeat | VehicleSetting):
            return
        match message:
            case Heartbeat():
                self._read_heartbeat(message, now_s)
            case Position():
                self._read_position(message, now_s)
            case Battery(battery=0) | SystemStatus():
                self._read_battery(message, now_s)
            case VehicleSetting() | RcChannels():
                self._read_transmitter(message, now_s)
            case Traffic(received, missing):
                before = self.minutes.get(minute := int(now_s // 60), (0, 0))
                self.minutes[minute] = (before[0] + received, before[1] + missing)
            case _:
                pass

    def _read_heartbeat(self, beat: Heartbeat, now_s: float) -> None:
        self.is_copter = self.is_copter or is_known_copter(beat)
        if not self.is_copter:
            return
        before, self.beat = self.beat, beat
        if before is not None and beat.custom_mode != before.custom_mode:
            self.changed_s.append(now_s)
        was_armed = before is not None and before.armed
        if beat.armed and not was_armed:
            self.notes.flights.append([])
        elif was_armed and not beat.armed:
            self.disarmed_s = now_s
        self.flown_until_s = self.flown_until_s if beat.armed else None

    def _read_position(self, place: Position, now_s: float) -> None:
        self.place, self.placed_s = place, now_s
        if not self._is_armed() or place.alt_rel_m <= HIGH_M:
            return
        if self.flown_until_s is not None:
            self.notes.flown_s += min(STALE_S, now_s - self.flown_until_s)
        self.flown_until_s = now_s

    def _read_battery(self, said: Battery | SystemStatus, now_s: float) -> None:
        if isinstance(said, Battery):
            self.consumed_ah = said.consumed_ah
        else:
            self.has_status = True
        if self.has_status == isinstance(said, SystemStatus):
            self._add_report(said, now_s)

    def _read_transmitter(self, said: VehicleSetting | RcChannels, now_s: float) -> None:
        """Note a setting, of which some say what its channels mean, or a switch that was moved."""
        known, self.evidence = self.evidence, record_evidence(self.evidence, said, now_s)
        if isinstance(said, VehicleSetting):
            self.notes.settings[said.name] = said.value
        elif self.evidence.switched != known.switched:
            self.switched.append((now_s, self.evidence.switched[-1].channel))

    def _is_armed(self) -> bool:
        return self.beat is not None and self.beat.armed

    def _add_report(self, said: Battery | SystemStatus, now_s: float) -> None:
        """Note what the battery says in the air, with how it flies, or at rest."""
        if not self._is_armed():
            if said.voltage_v and now_s > self.disarmed_s + RESTS_S:
                self.notes.rests_v.append(said.voltage_v)
            return
        place = self.place
        if place is None or now_s - self.placed_s > STALE_S or place.alt_rel_m < HIGH_M:
            return
        speed_m_s = math.hypot(place.north_m_s, place.east_m_s)
        self.notes.flights[-1].append(
            _Report(
                now_s, said.voltage_v, said.current_a, self.consumed_ah, said.remaining_pct, speed_m_s,
                -place.down_m_s,
            )
        )  # fmt: skip

    def end_log(self) -> None:
        """Note what shows only once the log has ended."""
        notes = self.notes
        notes.logs += self.is_copter
        notes.changes += len(self.changed_s)
        for at_s in self.changed_s:
            notes.moved.update({one for seen_s, one in self.switched if at_s - BEFORE_S <= seen_s <= at_s + AFTER_S})
        notes.minutes += self.minutes.values()


def _integrate_charge(reports: list[_Report]) -> list[_Report]:
    """Return reports with the charge that was used: by the counter, or else by the currents, added up."""
    if any(one.consumed_ah for one in reports):
        return reports
    used_ah, counted = 0.0, reports[:1]
    for before, after in pairwise(reports):
        used_ah += (before.amperes or 0.0) * min(STALE_S, after.at_s - before.at_s) / 3600.0
        counted.append(replace(after, consumed_ah=used_ah if before.amperes else None))
    return counted


def read_aircraft_notes(paths: Sequence[Path]) -> dict[int, AircraftNotes]:
    """Read logs, each once; returns what was noted, by system. Of many one that is no log costs nothing.

    Raises:
        ExtraMissing: there is a ULog, and nothing is installed to read it with.
        LogError: the only log cannot be read.
    """
    notes: dict[int, AircraftNotes] = {}
    for path in paths:
        with suppress(*(() if len(paths) == 1 else (LogError,))):
            _read_log(path, notes)
    return {system: one for system, one in notes.items() if one.logs}


def _read_log(path: Path, notes: dict[int, AircraftNotes]) -> None:
    file, readings = open_log(path, every_record=True).file, dict[int, _LogReading]()
    clock = LogClock(file.skipped)
    for t_usec, system, message in file.read_records():
        now_s = clock.advance(t_usec)
        if not system or message is None:
            continue
        if system not in readings:
            readings[system] = _LogReading(notes.setdefault(system, AircraftNotes()))
        readings[system].read_message(message, now_s)
    for reading in readings.values():
        reading.end_log()


def estimate_aircraft(notes: AircraftNotes) -> LearnedAircraft:
    """Return what the notes of one vehicle say of it."""
    flights = [_integrate_charge(flight) for flight in notes.flights]
    blocks, climbs = (
        [block for number, flight in enumerate(flights) for block in _cut_blocks(number, flight, length_s)]
        for length_s in (BLOCK_S, CLIMB_BLOCK_S)
    )
    steady = [one for one in blocks if abs(one.climb_m_s) < LEVEL_M_S]
    level = _estimate_level_flight(steady)
    hovers = [one for one in steady if one.speed_m_s < HOVER_M_S]
    return LearnedAircraft(
        logs=notes.logs,
        minutes=notes.flown_s / 60,
        cells=_find_cell_count(notes),
        level=level,
        hover_a=_estimate_figure(hovers, lambda one: one.current_a),
        hover_w=_estimate_figure(
            [one for one in hovers if one.voltage_v], lambda one: one.current_a * (one.voltage_v or 0.0)
        ),
        climb_share=_estimate_climb(climbs, level),
        capacity_ah=_estimate_capacity(flights),
        told_capacity_ah=_read_capacity_ah(notes.settings),
        resistance_ohm=_estimate_resistance(flights),
        link_loss_pct=_estimate_link_loss(notes.minutes),
        switch=_estimate_switch(notes),
    )  # fmt: skip


def _cut_blocks(flight: int, reports: Sequence[_Report], length_s: float) -> Iterable[SteadyBlock]:
    """Cut a flight into blocks, and keep those in which speed and climb hardly change."""
    block: list[_Report] = []
    for report in reports:
        if block and report.at_s - block[0].at_s >= length_s:
            yield from _build_block(flight, block)
            block = []
        if block and report.at_s - block[-1].at_s > STALE_S:
            block = []
        block.append(report)


def _build_block(flight: int, reports: Sequence[_Report]) -> Iterable[SteadyBlock]:
    drawn = [one.amperes for one in reports if one.amperes]
    if len(drawn) < LEAST_REPORTS:
        return
    for values in ([one.speed_m_s for one in reports], [one.climb_m_s for one in reports]):
        if not max(values) - min(values) <= STEADY_M_S:  # nor where it is unknown
            return
    volts = [one.volts for one in reports if one.volts]
    yield SteadyBlock(
        flight, fmean(one.speed_m_s for one in reports), fmean(one.climb_m_s for one in reports), fmean(drawn),
        fmean(volts) if volts else None,
    )  # fmt: skip


def _estimate_figure(blocks: Sequence[SteadyBlock], value: Callable[[SteadyBlock], float]) -> LearnedFigure | None:
    """Return the mean of what blocks say, with the deviation of that mean."""
    if len(blocks) < FEWEST:
        return None
    values = [value(one) for one in blocks]
    mean = fmean(values)
    sd = stdev(values) / math.sqrt(len(values))
    flights: dict[int, list[float]] = {}
    for one in blocks:
        flights.setdefault(one.flight, []).append(value(one))
    whole = [fmean(those) for those in flights.values() if len(those) >= FEWEST]
    if len(whole) > 1:  # flights differ by more than their blocks: wind, payload, pack
        sd = max(sd, stdev(whole) / math.sqrt(len(whole)))
    return LearnedFigure(mean, max(sd, SENSOR_SHARE * abs(mean)), len(values))


def _estimate_level_flight(blocks: Sequence[SteadyBlock]) -> tuple[tuple[float, LearnedFigure], ...]:
    bins: dict[int, list[SteadyBlock]] = {}
    for one in blocks:
        number = 0 if one.speed_m_s < HOVER_M_S else 1 + int((one.speed_m_s - FIRST_BIN_M_S) / BIN_M_S)
        bins.setdefault(number, []).append(one)
    found = []
    for number in sorted(bins):
        figure = _estimate_figure(bins[number], lambda one: one.current_a)
        if figure is not None:
            found.append((fmean(one.speed_m_s for one in bins[number]), figure))
    return tuple(found)


def interpolate_current_a(level: Sequence[tuple[float, LearnedFigure]], speed_m_s: float) -> float | None:
    """Return the current of level flight at a speed, between two that are known; nothing outside."""
    for (slow, low), (fast, high) in pairwise(level):
        if slow <= speed_m_s <= fast:
            share = (speed_m_s - slow) / (fast - slow)
            return low.mean + share * (high.mean - low.mean)
    nearest = min(level, key=lambda one: abs(one[0] - speed_m_s), default=None)
    return nearest[1].mean if nearest is not None and abs(nearest[0] - speed_m_s) <= BIN_M_S else None


def _estimate_climb(
    blocks: Sequence[SteadyBlock], level: Sequence[tuple[float, LearnedFigure]]
) -> LearnedFigure | None:
    shares = []
    for one in blocks:
        usual = interpolate_current_a(level, one.speed_m_s)
        if one.climb_m_s > CLIMBS_M_S and usual:
            shares.append((one.current_a / usual - 1.0) / one.climb_m_s)
    if len(shares) < FEWEST:
        return None
    return LearnedFigure(fmean(shares), stdev(shares) / math.sqrt(len(shares)) + SENSOR_SHARE, len(shares))


def _estimate_capacity(flights: Sequence[Sequence[_Report]]) -> LearnedFigure | None:
    """Return what the counter gives for a full percentage, over the stretch of each flight in which it falls."""
    weights = total = 0.0
    count = 0
    for flight in flights:
        moving = [
            after
            for before, after in pairwise(flight)
            if before.percent is not None and after.percent is not None and after.consumed_ah is not None
            and after.percent < before.percent < 100.0
        ]  # fmt: skip
        if len(moving) < FEWEST:
            continue
        first, last = moving[0], moving[-1]
        used_pct = (first.percent or 0.0) - (last.percent or 0.0)
        used_ah = (last.consumed_ah or 0.0) - (first.consumed_ah or 0.0)
        if used_pct < COUNTED_PCT or used_ah <= 0.0:
            continue
        capacity = 100.0 * used_ah / used_pct
        weight = (used_pct / (ROUNDED_PCT * capacity)) ** 2
        weights, total, count = weights + weight, total + weight * capacity, count + 1
    if not count:
        return None
    mean = total / weights
    return LearnedFigure(mean, max(1 / math.sqrt(weights), SENSOR_SHARE * mean), count)


def _read_capacity_ah(settings: dict[str, float]) -> float | None:
    value = next((settings[name] for name in ("BATT_CAPACITY", "BAT1_CAPACITY", "BAT_CAPACITY") if name in settings), 0)
    return value / 1e3 if value > 0 else None


def _estimate_resistance(flights: Sequence[Sequence[_Report]]) -> LearnedFigure | None:
    """Return the pack's resistance: how much the voltage falls for a step of the current, by least squares."""
    steps: list[tuple[float, float]] = []
    for flight in flights:
        drawn = [one.amperes for one in flight if one.amperes]
        least = STEP_SHARE * median(drawn) if drawn else math.inf
        for before, after in pairwise(flight):
            if None in {before.volts, after.volts, before.amperes, after.amperes} or after.at_s - before.at_s > STEP_S:
                continue
            step = (after.amperes or 0.0) - (before.amperes or 0.0)
            if abs(step) >= least:
                steps.append((step, (after.volts or 0.0) - (before.volts or 0.0)))
    if len(steps) < FEWEST:
        return None
    squares = sum(step * step for step, _ in steps)
    mean = -sum(step * fell for step, fell in steps) / squares
    spread = math.sqrt(sum((step * (fell + mean * step)) ** 2 for step, fell in steps)) / squares
    return LearnedFigure(mean, max(spread, 2 * SENSOR_SHARE * mean), len(steps)) if mean > 0 else None


def _estimate_link_loss(minutes: Sequence[Sequence[int]]) -> LearnedFigure | None:
    received, missing = sum(one[0] for one in minutes), sum(one[1] for one in minutes)
    full = [100.0 * one[1] / (one[0] + one[1]) for one in minutes if sum(one) >= FRAMES]
    if not full:
        return None
    mean = 100.0 * missing / (received + missing)
    frames = math.sqrt(mean * (100.0 - mean) / (received + missing))
    spread = stdev(full) / math.sqrt(len(full)) if len(full) > 1 else 0.0
    return LearnedFigure(mean, max(frames, spread), len(full))


def _find_cell_count(notes: AircraftNotes) -> int | None:
    """Return the number of cells, where one number alone fits what the pack showed at rest and in flight."""
    seen = notes.rests_v or [one.volts for flight in notes.flights for one in flight if one.volts]
    if not seen:
        return None
    top = sorted(seen)[int(0.95 * (len(seen) - 1))]
    fewest, most = math.ceil(top / FULL_CELL_V), math.floor(top / LEAST_CELL_V)
    told = notes.settings.get("BAT1_N_CELLS", notes.settings.get("BAT_N_CELLS", 0))
    if told:
        return int(told)
    return fewest if fewest == most else None


def _estimate_switch(notes: AircraftNotes) -> ModeSwitch | None:
    before, changes = notes.moved, notes.changes
    for name in SWITCH_SETTINGS:
        channel = int(notes.settings.get(name, 0))
        if channel > 0:
            return ModeSwitch(channel, name, before[channel], changes)
    if not before:
        return None
    channel, moved = before.most_common(1)[0]
    return ModeSwitch(channel, "seen", moved, changes) if moved > 1 else None
