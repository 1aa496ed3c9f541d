"""`faultline replay --learn`: estimate an aircraft's figures from its logs, each with its uncertainty.

A flight is cut into blocks of some seconds. A block with nearly constant speed and climb is one observation of the
power draw of level flight at that speed, or of a climb; resistance comes from load steps between two reports; the rest
is counted. A figure's deviation is the scatter of its observations, between flights if there are several, and never
below the accuracy of current sensors.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from pydantic import ValidationError

from executor.core.interface import messages
from executor.core.state.vehicle_parts import ModeEvidence
from executor.core.telemetry.mode_evidence import record_evidence
from executor.errors import LogError
from executor.replay.log_replay import LogClock, is_known_copter
from executor.replay.open_log import open_log
from executor.site.site_keys import FigureTable, LearnedTable, SpeedTable, SwitchTable
from missions.geo import FloatArray
from missions.validation import format_first_error
from planner import Drone, InstanceError, pct_per_s

BLOCK_S, CLIMB_BLOCK_S = 6.0, 3.0
"""Seconds of a block of level flight, and of a climb, which is short."""
LEAST_REPORTS = 3
HIGH_M = 1.5
"""Least height of samples; below, the vehicle may stand on the ground."""
LEVEL_M_S, CLIMBS_M_S, STEADY_M_S = 0.3, 0.5, 1.5
"""Most climb of level flight, least climb of a climb, and most change of speed or climb within a block."""
BIN_M_S, FIRST_BIN_M_S = 2.0, 0.5
HOVER_M_S = 0.7
FEWEST = 4
"""Least number of observations for a figure."""
SENSOR_SHARE = 0.01
"""Least relative deviation of a current, however often it is read."""
STEP_SHARE = 0.15
"""Least load step for the resistance, as a share of the current: smaller steps are sensor noise."""
STEP_S = 3.0
STALE_S = 4.0
COUNTED_PCT = 5.0
ROUNDED_PCT = 0.41
"""Deviation of the difference of two percentages rounded to integers."""
BEFORE_S, AFTER_S = 3.5, 1.0
RESTS_S = 20
"""Least seconds for which the voltage recovers after a flight."""
FRAMES = 120
"""Least frames of a minute for its loss rate to count."""
FULL_CELL_V, LEAST_CELL_V = 4.25, 3.3
SWITCH_SETTINGS = ("FLTMODE_CH", "RC_MAP_FLTMODE", "RC_MAP_MODE_SW")
DIGITS = 4
LEAST_EFFICIENCY, MOST_EFFICIENCY = 0.01, 1.0
HEAD = """\
# Learned by `faultline replay --learn` from {logs} of one aircraft: {minutes:.1f} minutes in the air.
# Put both tables into its site file, in place of what stands there. [energy] is what plans are made with; [learned] is
# kept beside it. sd is a standard deviation, samples are pieces of flight, pairs of reports, flights or minutes.
"""


FLIGHT, AT_S, VOLTS, AMPERES, CONSUMED_AH, PERCENT, SPEED_M_S, CLIMB_M_S = range(8)
"""Columns of a flight's reports, and of the means of some of them; NaN if not reported."""


@dataclass(slots=True)
class AircraftNotes:
    """Notes on one system while its logs are read."""

    logs: int = 0
    flown_s: float = 0.0
    flights: list[list[tuple[float | None, ...]]] = field(default_factory=list)
    """Reports of each flight, by column."""
    rests_v: list[float] = field(default_factory=list)
    settings: dict[str, float] = field(default_factory=dict)
    changes: int = 0
    """Number of mode changes."""
    moved: Counter[int] = field(default_factory=Counter)
    """Number of mode changes preceded by a moved switch, by its channel."""
    minutes: list[tuple[int, int]] = field(default_factory=list)
    """Frames received and missing, for each minute."""


@dataclass(slots=True)
class _LogReading:
    """Collect the notes of one system in one log, message by message."""

    notes: AircraftNotes
    beat: messages.Heartbeat | None = None
    """Last heartbeat; None until it is from a copter."""
    place: messages.Position | None = None
    placed_s: float = -math.inf
    flown_until_s: float | None = None
    """Time at which a position last showed flight."""
    disarmed_s: float = -math.inf
    consumed_ah: float | None = None
    has_status: bool = False
    """Whether SYS_STATUS reports the battery; BATTERY_STATUS then adds only the consumption."""
    evidence: ModeEvidence = field(default_factory=ModeEvidence)
    switched: list[tuple[float, int]] = field(default_factory=list)
    """Times of moved switches, and their channels."""
    changed_s: list[float] = field(default_factory=list)
    """Times of mode changes."""
    minutes: dict[int, tuple[int, int]] = field(default_factory=dict)

    def read_message(self, message: messages.FlightMessage, now_s: float) -> None:
        """Take a message of the system; only its parameters until it is known to be a copter."""
        if self.beat is None and not isinstance(message, messages.Heartbeat | messages.VehicleSetting):
            return
        match message:
            case messages.Heartbeat():
                self._read_heartbeat(message, now_s)
            case messages.Position():
                self._read_position(message, now_s)
            case messages.Battery(battery=0) | messages.SystemStatus():
                self._read_battery(message, now_s)
            case messages.VehicleSetting() | messages.RcChannels():
                self._read_transmitter(message, now_s)
            case messages.Traffic(received, missing):
                before = self.minutes.get(minute := int(now_s // 60), (0, 0))
                self.minutes[minute] = (before[0] + received, before[1] + missing)
            case _:
                pass

    def _read_heartbeat(self, beat: messages.Heartbeat, now_s: float) -> None:
        if self.beat is None and not is_known_copter(beat):
            return
        if self.beat is not None and beat.custom_mode != self.beat.custom_mode:
            self.changed_s.append(now_s)
        was_armed, self.beat = self._is_armed(), beat
        if beat.armed and not was_armed:
            self.notes.flights.append([])
        elif was_armed and not beat.armed:
            self.disarmed_s = now_s
        self.flown_until_s = self.flown_until_s if beat.armed else None

    def _read_position(self, place: messages.Position, now_s: float) -> None:
        self.place, self.placed_s = place, now_s
        if not self._is_armed() or place.alt_rel_m <= HIGH_M:
            return
        if self.flown_until_s is not None:
            self.notes.flown_s += min(STALE_S, now_s - self.flown_until_s)
        self.flown_until_s = now_s

    def _read_battery(self, said: messages.Battery | messages.SystemStatus, now_s: float) -> None:
        if isinstance(said, messages.Battery):
            self.consumed_ah = said.consumed_ah
        else:
            self.has_status = True
        if self.has_status == isinstance(said, messages.SystemStatus):
            self._add_report(said, now_s)

    def _read_transmitter(self, said: messages.VehicleSetting | messages.RcChannels, now_s: float) -> None:
        """Note a parameter, which may assign the transmitter's channels, or a moved switch."""
        known, self.evidence = self.evidence, record_evidence(self.evidence, said, now_s)
        if isinstance(said, messages.VehicleSetting):
            self.notes.settings[said.name] = said.value
        elif self.evidence.switched != known.switched:
            self.switched.append((now_s, self.evidence.switched[-1].channel))

    def _is_armed(self) -> bool:
        return self.beat is not None and self.beat.armed

    def _add_report(self, said: messages.Battery | messages.SystemStatus, now_s: float) -> None:
        """Note a battery report in the air, with the motion, or at rest."""
        if not self._is_armed():
            if said.voltage_v and now_s > self.disarmed_s + RESTS_S:
                self.notes.rests_v.append(said.voltage_v)
            return
        place = self.place
        if place is None or now_s - self.placed_s > STALE_S or place.alt_rel_m < HIGH_M:
            return
        flights, speed_m_s = self.notes.flights, math.hypot(place.north_m_s, place.east_m_s)
        flights[-1].append(
            (
                len(flights), now_s, said.voltage_v or None, said.current_a or None, self.consumed_ah,
                said.remaining_pct, speed_m_s, -place.down_m_s,
            )
        )  # fmt: skip

    def end_log(self) -> None:
        """Note what is known only at the end of the log."""
        notes = self.notes
        notes.logs += self.beat is not None
        notes.changes += len(self.changed_s)
        for at_s in self.changed_s:
            notes.moved.update({one for seen_s, one in self.switched if at_s - BEFORE_S <= seen_s <= at_s + AFTER_S})
        notes.minutes += self.minutes.values()


def _integrate_charge(flight: FloatArray) -> FloatArray:
    """Return reports with the consumed charge: from the counter, else from the integrated current."""
    if np.nan_to_num(flight[:, CONSUMED_AH]).any():
        return flight
    drawn_a, lasted_s = np.nan_to_num(flight[:-1, AMPERES]), np.minimum(STALE_S, np.diff(flight[:, AT_S]))
    flight[1:, CONSUMED_AH] = np.where(drawn_a > 0.0, np.cumsum(drawn_a * lasted_s) / 3600.0, np.nan)
    return flight


def read_aircraft_notes(paths: Sequence[Path]) -> dict[int, AircraftNotes]:
    """Read each log once; return the notes by system. If there are several, files that are no logs are skipped.

    Raises:
        ExtraMissing: A log is a ULog, and no reader for it is installed.
        LogError: The only log cannot be read.
    """
    notes: dict[int, AircraftNotes] = {}
    for path in paths:
        with suppress(*(() if len(paths) == 1 else (LogError,))):
            _read_log(path, notes)
    return {system: one for system, one in notes.items() if one.logs}


def _read_log(path: Path, notes: dict[int, AircraftNotes]) -> None:
    file, readings = open_log(path, every_record=True), dict[int, _LogReading]()
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


@dataclass(frozen=True, slots=True)
class LearnedAircraft:
    """Figures of one vehicle from logs."""

    system: int
    others: tuple[int, ...]
    """Other systems that fly in the logs, left out."""
    table: LearnedTable
    cells: int | None
    told_capacity_ah: float | None
    """Capacity from the autopilot's parameter."""


def learn_from_logs(paths: Sequence[Path]) -> LearnedAircraft:
    """Return the figures of the vehicle that flies most in the logs.

    Raises:
        LogError: A log cannot be read, no vehicle flies in any, or the figures are impossible.
    """
    notes = read_aircraft_notes(paths)
    flown = sorted((one for one in notes if notes[one].flown_s), key=lambda system: -notes[system].flown_s)
    if not flown:
        raise LogError("--learn: expected logs in which a vehicle flies, with its positions")
    try:
        return estimate_aircraft(flown[0], notes[flown[0]], tuple(flown[1:]))
    except ValidationError as error:
        raise LogError(f"--learn: {format_first_error(error)}") from error


def estimate_aircraft(system: int, notes: AircraftNotes, others: tuple[int, ...]) -> LearnedAircraft:
    """Return the figures from one vehicle's notes."""
    flights = [_integrate_charge(np.array(one, dtype=np.float64).reshape(-1, 8)) for one in notes.flights]
    blocks, climbs = (
        np.array([block for flight in flights for block in _average_blocks(flight, length_s)]).reshape(-1, 8)
        for length_s in (BLOCK_S, CLIMB_BLOCK_S)
    )
    steady = blocks[np.abs(blocks[:, CLIMB_M_S]) < LEVEL_M_S]
    hovers = steady[steady[:, SPEED_M_S] < HOVER_M_S]
    measured = hovers[~np.isnan(hovers[:, VOLTS])]
    capacity_ah, told_ah = _estimate_capacity(flights), _read_capacity_ah(notes.settings)
    level = _estimate_level_flight(steady, told_ah if capacity_ah is None else capacity_ah.mean)
    table = LearnedTable(
        logs=notes.logs,
        minutes=notes.flown_s / 60,
        hover_a=_estimate_figure(hovers[:, AMPERES], hovers[:, FLIGHT]),
        hover_w=_estimate_figure(measured[:, AMPERES] * measured[:, VOLTS], measured[:, FLIGHT]),
        level=level,
        climb_share=_estimate_climb(climbs, level),
        capacity_ah=capacity_ah,
        resistance_ohm=_estimate_resistance(flights),
        link_loss_pct=_estimate_link_loss(notes.minutes),
        mode_switch=_estimate_switch(notes),
    )
    return LearnedAircraft(system, others, table, _find_cell_count(notes), told_ah)


def _average_blocks(flight: FloatArray, length_s: float) -> Iterator[FloatArray]:
    """Cut a flight into blocks, and yield the means of those with nearly constant speed and climb."""
    begin, times_s = 0, flight[:, AT_S]
    for number in range(1, len(flight)):
        if times_s[number] - times_s[begin] >= length_s:
            block, begin = flight[begin:number], number
            told, changes_m_s = (~np.isnan(block)).sum(axis=0), np.ptp(block[:, [SPEED_M_S, CLIMB_M_S]], axis=0)
            if told[AMPERES] >= LEAST_REPORTS and (changes_m_s <= STEADY_M_S).all():  # false if unknown (NaN)
                with np.errstate(invalid="ignore"):
                    yield np.nansum(block, axis=0) / told
        elif times_s[number] - times_s[number - 1] > STALE_S:
            begin = number


def _build_figure(mean: float, sd: float, samples: int, least_share: float = 0.0) -> FigureTable:
    return FigureTable(mean=mean, sd=max(sd, least_share * abs(mean)), samples=samples)


def _compute_sd_of_mean(values: Sequence[float] | FloatArray) -> float:
    """Return the deviation of a mean; 0 without scatter."""
    return float(np.std(values, ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0


def _estimate_figure(values: FloatArray, flights: FloatArray) -> FigureTable | None:
    """Return the mean over the flights' blocks, with its deviation."""
    if len(values) < FEWEST:
        return None
    # Flights differ by more than their blocks: wind, payload, pack.
    own = [values[flights == flight] for flight in np.unique(flights)]
    whole = [float(those.mean()) for those in own if len(those) >= FEWEST]
    sd = max(_compute_sd_of_mean(values), _compute_sd_of_mean(whole))
    return _build_figure(float(values.mean()), sd, len(values), SENSOR_SHARE)


def _estimate_level_flight(blocks: FloatArray, capacity_ah: float | None) -> tuple[SpeedTable, ...]:
    speeds_m_s, found = blocks[:, SPEED_M_S], []
    bins = np.where(speeds_m_s < HOVER_M_S, 0, 1 + ((speeds_m_s - FIRST_BIN_M_S) / BIN_M_S).astype(np.int64))
    for number in np.unique(bins):
        own = blocks[bins == number]
        drawn = _estimate_figure(own[:, AMPERES], own[:, FLIGHT])
        if drawn is not None:
            share = 0.0 if capacity_ah is None else 100.0 / capacity_ah / 60.0
            used = _build_figure(share * drawn.mean, share * drawn.sd, drawn.samples) if share else None
            found.append(SpeedTable(speed_m_s=float(own[:, SPEED_M_S].mean()), current_a=drawn, pct_per_min=used))
    return tuple(found)


def _estimate_climb(blocks: FloatArray, level: Sequence[SpeedTable]) -> FigureTable | None:
    """Return a climb's draw beyond level flight at its speed: interpolated, or near the last known speed."""
    if not level:
        return None
    known_m_s, drawn_a = [one.speed_m_s for one in level], [one.current_a.mean for one in level]
    climbing = blocks[blocks[:, CLIMB_M_S] > CLIMBS_M_S]
    speeds_m_s = climbing[:, SPEED_M_S]
    near = (known_m_s[0] - BIN_M_S <= speeds_m_s) & (speeds_m_s <= known_m_s[-1] + BIN_M_S)
    extra = climbing[:, AMPERES] / np.interp(speeds_m_s, known_m_s, drawn_a) - 1.0
    shares = (extra / climbing[:, CLIMB_M_S])[near]
    if len(shares) < FEWEST:
        return None
    return _build_figure(float(shares.mean()), _compute_sd_of_mean(shares) + SENSOR_SHARE, len(shares))


def _estimate_capacity(flights: Sequence[FloatArray]) -> FigureTable | None:
    """Return the counter's charge for a full percentage, over the falling stretch of each flight."""
    found: list[tuple[float, float]] = []
    for flight in flights:
        before_pct, after_pct, counted = flight[:-1, PERCENT], flight[1:, PERCENT], ~np.isnan(flight[1:, CONSUMED_AH])
        moving = flight[1:][(after_pct < before_pct) & (before_pct < 100.0) & counted]
        used_pct = used_ah = 0.0
        if len(moving) >= FEWEST:
            used_pct, used_ah = moving[0, PERCENT] - moving[-1, PERCENT], np.ptp(moving[[0, -1], CONSUMED_AH])
        if used_pct >= COUNTED_PCT and used_ah > 0.0:
            capacity = 100.0 * used_ah / used_pct
            found.append((capacity, (used_pct / (ROUNDED_PCT * capacity)) ** 2))
    if not found:
        return None
    capacities, weights = np.array(found).T
    mean = float(np.average(capacities, weights=weights))
    return _build_figure(mean, 1 / math.sqrt(weights.sum()), len(found), SENSOR_SHARE)


def _read_capacity_ah(settings: dict[str, float]) -> float | None:
    value = next((settings[name] for name in ("BATT_CAPACITY", "BAT1_CAPACITY", "BAT_CAPACITY") if name in settings), 0)
    return value / 1e3 if value > 0 else None


def _estimate_resistance(flights: Sequence[FloatArray]) -> FigureTable | None:
    """Return the pack's resistance: the voltage drop for a current step, by least squares."""
    steps = [np.zeros((0, 3))]
    for flight in flights:
        drawn_a = flight[~np.isnan(flight[:, AMPERES]), AMPERES]
        least_a = STEP_SHARE * np.median(drawn_a) if len(drawn_a) else math.inf
        own = np.diff(flight[:, [AT_S, AMPERES, VOLTS]], axis=0)
        steps.append(own[(own[:, 0] <= STEP_S) & (np.abs(own[:, 1]) >= least_a) & ~np.isnan(own[:, 2])])
    _, step, fell = np.concatenate(steps).T
    if len(step) < FEWEST:
        return None
    squares = float(step @ step)
    mean = -float(step @ fell) / squares
    spread = float(np.linalg.norm(step * (fell + mean * step))) / squares
    return _build_figure(mean, spread, len(step), 2 * SENSOR_SHARE) if mean > 0 else None


def _estimate_link_loss(minutes: Sequence[Sequence[int]]) -> FigureTable | None:
    received, missing = sum(one[0] for one in minutes), sum(one[1] for one in minutes)
    full = [100.0 * one[1] / (one[0] + one[1]) for one in minutes if sum(one) >= FRAMES]
    if not full:
        return None
    mean = 100.0 * missing / (received + missing)
    frames = math.sqrt(mean * (100.0 - mean) / (received + missing))
    return _build_figure(mean, max(frames, _compute_sd_of_mean(full)), len(full))


def _find_cell_count(notes: AircraftNotes) -> int | None:
    """Return the number of cells if only one number fits the voltages at rest and in flight."""
    seen = notes.rests_v or [one[VOLTS] or 0.0 for flight in notes.flights for one in flight if one[VOLTS]]
    if not seen:
        return None
    if told := notes.settings.get("BAT1_N_CELLS", notes.settings.get("BAT_N_CELLS", 0)):
        return int(told)
    top = sorted(seen)[int(0.95 * (len(seen) - 1))]
    fewest, most = math.ceil(top / FULL_CELL_V), math.floor(top / LEAST_CELL_V)
    return fewest if fewest == most else None


def _estimate_switch(notes: AircraftNotes) -> SwitchTable | None:
    before, changes = notes.moved, notes.changes
    for name in SWITCH_SETTINGS:
        channel = int(notes.settings.get(name, 0))
        if channel > 0:
            return SwitchTable(channel=channel, source=name, moved=before[channel], changes=changes)
    if not before:
        return None
    channel, moved = before.most_common(1)[0]
    return SwitchTable(channel=channel, source="seen", moved=moved, changes=changes) if moved > 1 else None


def format_learned_toml(found: LearnedAircraft, drone: str, base: Drone) -> str:
    """Return the text of the learned file."""
    logs = f"{found.table.logs} log" + "s" * (found.table.logs != 1)
    return "\n".join(
        [
            HEAD.format(logs=logs, minutes=found.table.minutes),
            *_format_energy(found, drone, base),
            "",
            tomlkit.dumps(build_learned_table(found)),
        ]
    )


def _format_energy(found: LearnedAircraft, drone: str, base: Drone) -> list[str]:
    lines = ["[energy]", f'drone = "{drone}"  # mass, rotors and propellers: not in any log']
    if found.cells is not None:
        lines.append(f"cells = {found.cells}")
        base = replace(base, cells=found.cells)
    learned = found.table.capacity_ah
    capacity = found.told_capacity_ah if learned is None else learned.mean
    if capacity is None:
        lines.append("# capacity_ah: no charge counter together with a percentage, and no parameter, was in the logs")
        return lines
    source = "by the autopilot's parameter"
    if learned is not None:
        source = f"give or take {learned.sd:.2f}, from {learned.samples} flights"
        if found.told_capacity_ah is not None:
            source += f"; the autopilot's parameter says {found.told_capacity_ah:g}"
    lines.append(f"capacity_ah = {round(capacity, 3)}  # {source}")
    efficiency = fit_efficiency(found.table.level, replace(base, capacity_ah=capacity), capacity)
    if efficiency is None:
        lines.append("# efficiency: too little level flight with a current sensor, or far from what the preset can be")
        return lines
    value, sd = efficiency
    lines.append(
        f"efficiency = {round(value, 4)}  # give or take {sd:.4f}; with the preset's mass and propellers it gives the "
        "consumption that was flown"
    )
    return lines


def fit_efficiency(level: Sequence[SpeedTable], drone: Drone, capacity_ah: float) -> tuple[float, float] | None:
    """Return the efficiency with which the model reproduces the draw in level flight, and its deviation."""
    if not level:
        return None
    weights = [one.current_a.samples for one in level]

    def excess(efficiency: float) -> float:
        tried = replace(drone, efficiency=efficiency)
        try:
            times = [pct_per_s(tried, one.speed_m_s) * 36.0 * capacity_ah / one.current_a.mean for one in level]
        except InstanceError:
            return math.inf  # more than the pack could supply
        return float(np.average(np.log(times), weights=weights))

    low, high = LEAST_EFFICIENCY, MOST_EFFICIENCY
    if excess(low) < 0 or excess(high) > 0:
        return None
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    shares = [weight * one.current_a.sd / one.current_a.mean for weight, one in zip(weights, level, strict=True)]
    return low, max(math.hypot(*shares) / sum(weights) * low, 10.0**-DIGITS)


def build_learned_table(found: LearnedAircraft) -> dict[str, Any]:
    """Return the table `[learned]` of a site file."""
    content = found.table.model_dump(exclude_none=True)
    return {"learned": {name: _round_figures(value) for name, value in content.items() if value != ()}}


def _round_figures(value: Any) -> Any:  # noqa: ANN401 - tables in tables
    if isinstance(value, tuple):
        return [_round_figures(one) for one in value]
    if isinstance(value, dict):
        return {
            name: float(f"{one:.{DIGITS}g}") if name in {"mean", "sd"} else _round_figures(one)
            for name, one in value.items()
        }
    return round(value, 2) if isinstance(value, float) else value


def describe_aircraft(found: LearnedAircraft) -> list[str]:
    """Return the findings in a few lines."""
    table = found.table
    lines = [f"system {found.system}: {table.minutes:.1f} min in the air, {table.logs} logs"]
    rows = (
        ("hover", table.hover_a, "A"), ("climb, a m/s", table.climb_share, "of level flight"),
        ("capacity", table.capacity_ah, "Ah"), ("resistance", table.resistance_ohm, "ohm"),
        ("frames lost", table.link_loss_pct, "%"),
        *((f"{one.speed_m_s:4.1f} m/s", one.current_a, "A") for one in table.level),
    )  # fmt: skip
    lines += [
        f"  {name:<13} " + ("not in these logs" if one is None else
                            f"{one.mean:.4g} {unit}, give or take {one.sd:.2g} ({one.samples} samples)")
        for name, one, unit in rows
    ]  # fmt: skip
    if table.mode_switch is not None:
        lines.append(
            f"  mode switch   channel {table.mode_switch.channel} ({table.mode_switch.source}): moved before "
            f"{table.mode_switch.moved} of {table.mode_switch.changes} changes of mode"
        )
    if found.others:
        lines.append(f"  left out: system {', '.join(map(str, found.others))}; a file is of one vehicle")
    return lines
