"""Draw the pictures of a plan and of a flight, as PNG files.

Only matplotlib's objects are used, and each figure's own Agg canvas: no window, no state shared by threads.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from executor.analysis.pictures.battery_figure import draw_battery_figure, draw_window_figure
from executor.analysis.pictures.chart_figures import (
    draw_front_figure,
    draw_gantt_figure,
    draw_profile_figure,
    draw_risk_figure,
)
from executor.analysis.pictures.map_figures import draw_network_figure, draw_plan_figure
from executor.analysis.pictures.style import DPI
from missions.files import write_whole


def save_figure(figure: Figure, path: Path) -> None:
    """Write a picture, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    content = BytesIO()
    figure.savefig(content, format="png", dpi=DPI)
    write_whole(path, content.getvalue())
