"""What `faultline bench window` shows: on a terminal, as JSON, and as a page of the results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from executor.bench.machine import machine, machine_line
from executor.bench.markdown import figure, markdown_page, markdown_table
from executor.bench.predictionpage import print_table
from executor.bench.store import Json, write_result, write_text
from executor.bench.window import WindowSettings

TITLE = "The re-plan window, flown"
INTRODUCTION = (
    "`{command}`: {segments} segments, {vehicles} vehicles ({autopilot}), batteries of such a size that the dearest "
    "route of the best MinMax plan takes {tightness:.0%} of the budget. A plan chosen for its window claims that any "
    "single vehicle may be lost from {claimed_earliest_s:.0f} s on, of {longest_route_s:.0f} s. Each loss (a crash, "
    "or a link that is silent for good) is a flight of its own in virtual time, at a random time, of a random vehicle"
    " that still flies then. It is finished if everything was inspected and everybody else stands on its pad above "
    "its reserve, by the simulator's own battery."
)


def window_document(settings: WindowSettings, command: str, found: Json) -> Json:
    """Return the content of window.json."""
    return {
        "format": "faultline-bench-window/1",
        "machine": machine(),
        "command": command,
        "seed": settings.seed,
        "network": "default" if settings.network is None else settings.network.name,
        "radius_m": settings.radius_m,
        "vehicles": settings.vehicles,
        "autopilot": settings.autopilot,
        "tightness": settings.tightness,
        **found,
    }


def keep_window(content: Mapping[str, Any], folder: Path) -> None:
    """Write window.json and window.md."""
    write_result(folder / "window.json", content)
    write_text(folder / "window.md", window_page(content))


LOSSES = ("losses", "flown", "finished", "what is left is named")
BROKEN = ("loss", "when", "why not", "left over")
Rows = list[tuple[str, ...]]


def _losses(content: Mapping[str, Any]) -> Rows:
    rows: Rows = [("after the claimed time", str(content["losses_after"]), str(content["finished_after"]), "")]
    if content["losses_before"]:
        missed = content["losses_before"] - content["finished_before"]
        named = f"in {missed - content['unnamed_before']} of {missed}"
        rows.append(("before it", str(content["losses_before"]), str(content["finished_before"]), named))
    return rows


def _broken(content: Mapping[str, Any]) -> Rows:
    return [
        (row["loss"], "after" if row["after"] else "before", "; ".join(row["wrong"]),
         ", ".join(map(str, row["uncovered"])) or "nothing")
        for row in content["rows"] if not row["finished"]
    ]  # fmt: skip


def window_page(content: Mapping[str, Any]) -> str:
    """Return the page."""
    broken = _broken(content)
    least = content["least_pct_after"]
    return markdown_page(
        TITLE,
        machine_line(content["machine"]),
        INTRODUCTION.format_map(content),
        markdown_table(LOSSES, _losses(content)),
        ""
        if least is None
        else f"The least that a survivor landed with after a loss in the window: {figure(least)} %.",
        "## Not finished" if broken else "",
        markdown_table(BROKEN, broken) if broken else "",
        f"{figure(content['flown_s'] / 3600)} hours were flown, {content['flown_s_per_s']} s of flight in a second of "
        "each process.",
    )


def print_window(content: Mapping[str, Any]) -> None:
    """Print the tables."""
    console = Console()
    claim = f"from {content['claimed_earliest_s']:.0f} s on, of {content['longest_route_s']:.0f} s"
    print_table(console, f"{TITLE}: claimed {claim}", LOSSES, _losses(content))
    broken = _broken(content)
    if broken:
        print_table(console, "Not finished", BROKEN, broken)
