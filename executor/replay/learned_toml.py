"""What was learned of an aircraft, as TOML that a site file takes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import tomli_w

from executor.errors import LogError
from executor.replay.learning import (
    AircraftNotes,
    LearnedAircraft,
    LearnedFigure,
    estimate_aircraft,
    read_aircraft_notes,
)
from planner import Drone, InstanceError, pct_per_s

DIGITS = 4
LEAST_EFFICIENCY, MOST_EFFICIENCY = 0.01, 1.0
HEAD = """\
# Learned by `faultline replay --learn` from {logs} of one aircraft: {minutes:.1f} minutes in the air.
# Put both tables into its site file, in place of what stands there. [energy] is what plans are made with; [learned] is
# kept beside it. sd is a standard deviation, samples are pieces of flight, pairs of reports, flights or minutes.
"""


def learn_from_logs(paths: Sequence[Path]) -> tuple[int, LearnedAircraft, tuple[int, ...]]:
    """Return what logs say of the vehicle that flies most in them: its system, its figures, and who is left out.

    Raises:
        LogError: a log cannot be read, or no vehicle flies in any.
    """
    notes: Mapping[int, AircraftNotes] = read_aircraft_notes(paths)
    flown = sorted(notes, key=lambda system: -notes[system].flown_s)
    if not flown or not notes[flown[0]].flown_s:
        raise LogError("--learn: expected logs in which a vehicle flies, with its positions")
    others = tuple(system for system in flown[1:] if notes[system].flown_s)
    return flown[0], estimate_aircraft(notes[flown[0]]), others


def format_learned_toml(found: LearnedAircraft, drone: str, base: Drone) -> str:
    """Return the file."""
    logs = f"{found.logs} log" + "s" * (found.logs != 1)
    return "\n".join(
        [
            HEAD.format(logs=logs, minutes=found.minutes),
            *_format_energy(found, drone, base),
            "",
            tomli_w.dumps(build_learned_table(found)),
        ]
    )


def _format_energy(found: LearnedAircraft, drone: str, base: Drone) -> list[str]:
    lines = ["[energy]", f'drone = "{drone}"  # mass, rotors and propellers: not in any log']
    if found.cells is not None:
        lines.append(f"cells = {found.cells}")
        base = replace(base, cells=found.cells)
    capacity = found.capacity_ah.mean if found.capacity_ah is not None else found.told_capacity_ah
    if capacity is None:
        lines.append("# capacity_ah: no counter of charge beside a percentage, and no parameter, was in the logs")
        return lines
    source = "by the autopilot's parameter"
    if found.capacity_ah is not None:
        source = f"give or take {found.capacity_ah.sd:.2f}, from {found.capacity_ah.samples} flights"
        if found.told_capacity_ah is not None:
            source += f"; the autopilot's parameter says {found.told_capacity_ah:g}"
    lines.append(f"capacity_ah = {round(capacity, 3)}  # {source}")
    efficiency = fit_efficiency(found, replace(base, capacity_ah=capacity), capacity)
    if efficiency is None:
        lines.append("# efficiency: too little level flight with a current sensor, or far from what the preset can be")
        return lines
    value, sd = efficiency
    lines.append(
        f"efficiency = {round(value, 4)}  # give or take {sd:.4f}; with the preset's mass and propellers it gives the "
        "consumption that was flown"
    )
    return lines


def fit_efficiency(found: LearnedAircraft, drone: Drone, capacity_ah: float) -> tuple[float, float] | None:
    """Return the efficiency with which the model uses what was used in level flight, and how sure it is."""
    observed = [
        (speed, figure.mean / capacity_ah / 36.0, figure.sd / figure.mean, figure.samples)
        for speed, figure in found.level
    ]
    if not observed:
        return None

    def excess(efficiency: float) -> float:
        tried, total, weights = replace(drone, efficiency=efficiency), 0.0, 0.0
        for speed, used_pct_s, _, samples in observed:
            try:
                model = pct_per_s(tried, speed)
            except InstanceError:
                return math.inf  # more than the pack could give
            total, weights = total + samples * math.log(model / used_pct_s), weights + samples
        return total / weights

    low, high = LEAST_EFFICIENCY, MOST_EFFICIENCY
    if excess(low) < 0 or excess(high) > 0:
        return None
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    weights = sum(samples for *_, samples in observed)
    share = math.sqrt(sum((samples * sd) ** 2 for *_, sd, samples in observed)) / weights
    return low, max(share * low, 10.0**-DIGITS)


def build_learned_table(found: LearnedAircraft) -> dict[str, Any]:
    """Return the table `[learned]`, as a site file has it."""
    capacity = found.capacity_ah.mean if found.capacity_ah is not None else found.told_capacity_ah
    content: dict[str, Any] = {"logs": found.logs, "minutes": round(found.minutes, 2)}
    for name, figure in (
        ("hover_a", found.hover_a), ("hover_w", found.hover_w), ("climb_share", found.climb_share),
        ("capacity_ah", found.capacity_ah), ("resistance_ohm", found.resistance_ohm),
        ("link_loss_pct", found.link_loss_pct),
    ):  # fmt: skip
        if figure is not None:
            content[name] = _build_row(figure)
    if found.switch is not None:
        content["mode_switch"] = asdict(found.switch)
    level = []
    for speed, figure in found.level:
        row: dict[str, Any] = {"speed_m_s": round(speed, 2), "current_a": _build_row(figure)}
        if capacity is not None:
            row["pct_per_min"] = _build_row(figure, times=100.0 / capacity / 60.0)
        level.append(row)
    if level:
        content["level"] = level
    return {"learned": content}


def _build_row(figure: LearnedFigure, times: float = 1.0) -> dict[str, float | int]:
    return {
        "mean": _round_digits(times * figure.mean),
        "sd": _round_digits(times * figure.sd),
        "samples": figure.samples,
    }


def _round_digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def describe_aircraft(system: int, found: LearnedAircraft, others: Sequence[int]) -> list[str]:
    """Return what was found in a few lines."""
    lines = [f"system {system}: {found.minutes:.1f} min in the air, {found.logs} logs"]
    rows = (
        ("hover", found.hover_a, "A"), ("climb, a m/s", found.climb_share, "of level flight"),
        ("capacity", found.capacity_ah, "Ah"), ("resistance", found.resistance_ohm, "ohm"),
        ("frames lost", found.link_loss_pct, "%"),
    )  # fmt: skip
    lines += [
        f"  {name:<13} " + ("not in these logs" if one is None else
                            f"{one.mean:.4g} {unit}, give or take {one.sd:.2g} ({one.samples} samples)")
        for name, one, unit in rows
    ]  # fmt: skip
    lines += [f"  {speed:4.1f} m/s      {one.mean:.4g} A, give or take {one.sd:.2g} ({one.samples} samples)"
              for speed, one in found.level]  # fmt: skip
    if found.switch is not None:
        lines.append(
            f"  mode switch   channel {found.switch.channel} ({found.switch.source}): moved before "
            f"{found.switch.moved} of {found.switch.changes} changes of mode"
        )
    if others:
        lines.append(f"  left out: system {', '.join(map(str, others))}; a file is of one vehicle")
    return lines
