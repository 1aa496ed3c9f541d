"""The page of stages, flags and ticks, and its picture, generated from the program's own tables."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executor.core.fleet_step import PHASES
from executor.core.state.vehicle_state import TRANSITIONS, Stage
from scripts.pages.stage_flags import EVERYWHERE, FLAGS, FlagRule

PAGE, PICTURE = "reference/states.md", "reference/states.svg"
MEANINGS: dict[Stage, str] = {
    Stage.GROUND: "before its start, or with nothing to do",
    Stage.STARTING: "told to arm and to take off",
    Stage.FLYING: "on its mission",
    Stage.RETURNING: "on its way home, or down, and not to fly its mission again",
    Stage.PILOT: "with its pilot, or with another ground station: not commanded from here",
    Stage.LANDED: "on the ground after a flight",
    Stage.DOWN: "on the ground where, when or how it should not be",
    Stage.LOST: "silent for longer than its time-out",
}
PLACES: dict[Stage, tuple[int, int]] = {
    Stage.GROUND: (110, 70), Stage.STARTING: (380, 70), Stage.FLYING: (650, 70), Stage.LOST: (650, 260),
    Stage.RETURNING: (650, 450), Stage.DOWN: (380, 450), Stage.LANDED: (110, 450), Stage.PILOT: (380, 260),
}  # fmt: skip
WIDE, HIGH = 780, 520
HALF_W, HALF_H = 62, 20
BEND = 26
"""Bend of an edge to its left, which separates it from the opposite one."""


def states_page(made: str) -> str:
    """Return the page.

    Args:
        made: The line that warns against editing it.
    """
    lines = [
        made, "", "# The states of a vehicle", "",
        "At any moment a vehicle is in one stage, and may have flags as well. The program uses the first table itself",
        "(`executor/core/state/vehicle_state.py`): it refuses a change of stage that is not in it. Tests check each",
        "step of their flights against the second (`scripts/pages/stage_flags.py`).", "",
        "![The stages of a vehicle, and what may follow what](states.svg)", "",
        "## Stages", "", "| stage | meaning | may become |", "| --- | --- | --- |",
        *(f"| {stage.value} | {MEANINGS[stage]} | {_listed(TRANSITIONS[stage])} |" for stage in Stage), "",
        "## Flags", "", "| flag | meaning | where it may be set | what sets it | what ends it |",
        "| --- | --- | --- | --- | --- |", *map(_row, FLAGS), "",
        "## What happens in each tick", "",
        "In flight each tick runs these phases in this order: the program runs this very table",
        "(`executor/core/fleet_step.py`). A phase sees the changes of the phases before it.", "",
        "| | phase | why it stands here |", "| --- | --- | --- |",
        *(f"| {number} | {phase.name} | {phase.why_here} |" for number, phase in enumerate(PHASES, 1)),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def states_picture() -> str:
    """Return the picture, as SVG."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {HIGH}" font-family="sans-serif" font-size="15">',
        "<title>The stages of a vehicle, and what may follow what</title>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">',
        '<path d="M0 0 10 5 0 10z" fill="#566"/></marker></defs>',
        f'<rect width="{WIDE}" height="{HIGH}" fill="#fff"/>',
        *(_way(one, other) for one in Stage for other in Stage if other in TRANSITIONS[one]),
        *(part for stage in Stage for part in _box(stage)),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _row(rule: FlagRule) -> str:
    return f"| {rule.name} | {rule.meaning} | {_listed(rule.stages)} | {rule.begins} | {rule.ends} |"


def _listed(stages: frozenset[Stage]) -> str:
    if stages == EVERYWHERE:
        return "anywhere"
    return ", ".join(stage.value for stage in Stage if stage in stages)


def _way(one: Stage, other: Stage) -> str:
    (ax, ay), (bx, by) = PLACES[one], PLACES[other]
    far = math.hypot(bx - ax, by - ay)
    between = ((ax + bx) // 2, (ay + by) // 2) in PLACES.values()
    bend = BEND * (1.0 if not between else 3.0 if ay == by else 5.5)  # around a box, which is wider than it is high
    mx, my = (ax + bx) / 2 + bend * (by - ay) / far, (ay + by) / 2 - bend * (bx - ax) / far
    (sx, sy), (ex, ey) = _edge(ax, ay, mx, my), _edge(bx, by, mx, my)
    return (
        f'<path d="M{sx:.0f} {sy:.0f}Q{mx:.0f} {my:.0f} {ex:.0f} {ey:.0f}" fill="none" stroke="#566" '
        'marker-end="url(#tip)"/>'
    )


def _edge(x: float, y: float, to_x: float, to_y: float) -> tuple[float, float]:
    """Return where the line from the centre of a box leaves it."""
    dx, dy = to_x - x, to_y - y
    share = min(HALF_W / abs(dx) if dx else math.inf, HALF_H / abs(dy) if dy else math.inf)
    return x + share * dx, y + share * dy


def _box(stage: Stage) -> Iterator[str]:
    x, y = PLACES[stage]
    yield (
        f'<rect x="{x - HALF_W}" y="{y - HALF_H}" width="{2 * HALF_W}" height="{2 * HALF_H}" rx="6" fill="#eef4f7" '
        'stroke="#234"/>'
    )
    yield f'<text x="{x}" y="{y + 5}" text-anchor="middle">{stage.value}</text>'
