"""The pictures of a plan and of a flight, as PNG files.

Only matplotlib's objects are used, and each figure's own Agg canvas: no window, no state that threads share.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from executor.analysis.pictures.battery import battery_figure
from executor.analysis.pictures.front import FrontPoint, front_figure
from executor.analysis.pictures.gantt import gantt_figure
from executor.analysis.pictures.maps import map_figure, plan_figure
from executor.analysis.pictures.network import network_figure
from executor.analysis.pictures.profile import profile_figure
from executor.analysis.pictures.risk import risk_figure
from executor.analysis.pictures.style import DPI
from executor.analysis.pictures.window import window_figure
from missions.files import write_whole

__all__ = [
    "FrontPoint",
    "battery_figure",
    "front_figure",
    "gantt_figure",
    "map_figure",
    "network_figure",
    "plan_figure",
    "profile_figure",
    "risk_figure",
    "save",
    "window_figure",
]


def save(figure: Figure, path: Path) -> None:
    """Write a picture, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    content = BytesIO()
    figure.savefig(content, format="png", dpi=DPI)
    write_whole(path, content.getvalue())
