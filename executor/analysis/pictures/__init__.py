"""The pictures of a plan and of a flight, as PNG files.

Only matplotlib's objects are used, and each figure's own Agg canvas: no window, no state that threads share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from executor.analysis.flight_record import FlightRecord
from executor.analysis.pictures.battery import battery_figure
from executor.analysis.pictures.front import FrontPoint, front_figure
from executor.analysis.pictures.gantt import gantt_figure
from executor.analysis.pictures.maps import map_figure, plan_figure
from executor.analysis.pictures.network import network_figure
from executor.analysis.pictures.profile import profile_figure
from executor.analysis.pictures.risk import risk_figure
from executor.analysis.pictures.style import DPI
from executor.analysis.pictures.window import window_figure
from executor.analysis.profile import Profile
from executor.site.ground_view import GroundView
from missions import DayPlanFile, PlanFile, Understood
from planner import LossRepair, ReplanWindow, Risk

__all__ = [
    "FrontPoint",
    "battery_figure",
    "draw_battery",
    "draw_day",
    "draw_front",
    "draw_map",
    "draw_network",
    "draw_plan",
    "draw_profile",
    "draw_risk",
    "draw_window",
    "front_figure",
    "gantt_figure",
    "map_figure",
    "network_figure",
    "plan_figure",
    "profile_figure",
    "risk_figure",
    "window_figure",
]


def draw_plan(content: PlanFile, path: Path, ground: GroundView | None = None) -> None:
    """Write the map of a plan, over the ground if that is known.

    Raises:
        OSError: the file cannot be written.
    """
    _save(plan_figure(content, ground), path)


def draw_profile(profiles: Sequence[Profile], path: Path) -> None:
    """Write flights from the side, over the ground that a raster knows.

    Raises:
        OSError: the file cannot be written.
    """
    _save(profile_figure(profiles), path)


def draw_day(content: DayPlanFile, path: Path) -> None:
    """Write who flies when, from which base, of a plan of many sorties.

    Raises:
        OSError: the file cannot be written.
    """
    _save(gantt_figure(content), path)


def draw_network(understood: Understood, path: Path) -> None:
    """Write the map of a network as it was understood from its file.

    Raises:
        OSError: the file cannot be written.
    """
    _save(network_figure(understood), path)


def draw_map(record: FlightRecord, path: Path, ground: GroundView | None = None) -> None:
    """Write the map of a flight: the first plan, and what was flown; over the ground if that is known.

    Raises:
        OSError: the file cannot be written.
    """
    _save(map_figure(record, ground), path)


def draw_battery(record: FlightRecord, path: Path) -> None:
    """Write the battery consumption of a flight over time.

    Raises:
        OSError: the file cannot be written.
    """
    _save(battery_figure(record), path)


def draw_risk(swept: Sequence[Risk], given: Risk, path: Path) -> None:
    """Write the chance of finishing over the mean time between failures.

    Raises:
        OSError: the file cannot be written.
    """
    _save(risk_figure(swept, given), path)


def draw_window(content: PlanFile, found: ReplanWindow, repairs: Sequence[LossRepair], path: Path) -> None:
    """Write a plan's battery consumption with its re-plan window and the re-plans at its beginning.

    Args:
        content: the plan.
        found: its window.
        repairs: the answers to the losses at ``found.earliest_s``.
        path: of the PNG file.

    Raises:
        OSError: the file cannot be written.
    """
    _save(window_figure(content, found, repairs), path)


def draw_front(front: Sequence[FrontPoint], references: Mapping[str, FrontPoint], path: Path) -> None:
    """Write the plans that no other one beats, by longest route, earliest loss and energy.

    Args:
        front: numbered from 1 in this order.
        references: other plans by their names, to compare with.
        path: of the PNG file.

    Raises:
        OSError: the file cannot be written.
    """
    _save(front_figure(front, references), path)


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, format="png", dpi=DPI)
