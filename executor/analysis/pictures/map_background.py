"""What lies below a map: the relief, a picture of the ground, contour lines and whom they are by."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from executor.analysis.flight_record import Place
from executor.analysis.pictures.label_placement import find_farthest, nearest_distance_m
from executor.analysis.pictures.map_sheet import STRIP_IN, MapSheet
from executor.analysis.pictures.style import PAPER, make_white_edge
from executor.site.ground_view import GroundView
from executor.site.hillshade import Contour
from missions.geo import FloatArray
from missions.readers.background_files import Background, Pixels

SHADE = 0.45
"""How strong the relief is: what is drawn over it must be told from it."""
VEIL = 0.42
"""White over a picture of the ground, for the same reason."""
CONTOUR = "#6b5138"
"""Brown, as on maps; of no vehicle's lightness where it is drawn so thin."""
FAINT_TEXT = "#666666"
BEHIND = -5.0
LABELS = 10
TRIED = 25
"""Places along a contour line that are looked at for its height."""
LABEL_IN = 0.9
"""A contour line that is shorter than this has no room for its height."""
LETTERS_PER_IN = 15.0


def draw_below(sheet: MapSheet, view: GroundView | None, shown_m: FloatArray) -> MapSheet:
    """Draw the ground below all panels, within the corners of what may hold words; returns the sheet as it is then.

    Args:
        sheet: With its panels.
        view: The ground, if anything is known of it.
        shown_m: (n, 2) places that are drawn over it, for words to keep off.
    """
    if view is None or (view.background is None and view.relief is None):
        return sheet
    for axes in sheet.panels:
        limits = axes.get_xlim(), axes.get_ylim()
        clip = Rectangle(sheet.low_m, sheet.high_m[0] - sheet.low_m[0], sheet.high_m[1] - sheet.low_m[1])
        clip.set_transform(axes.transData)
        for artist in _draw_pictures(axes, view):
            artist.set_clip_path(clip)
        if view.background is not None:
            veil = Rectangle(clip.get_xy(), clip.get_width(), clip.get_height(), fc=PAPER, ec="none", alpha=VEIL)
            axes.add_patch(veil).set_zorder(BEHIND + 1.0)
        if view.relief is not None:
            _draw_contours(axes, sheet, view.relief.contours, clip, shown_m)
        _draw_attribution(axes, sheet, describe_ground(view))
        axes.set_xlim(limits[0])
        axes.set_ylim(limits[1])
    return replace(sheet, busy=True)


def describe_ground(view: GroundView) -> str:
    """Return what has to be said of a ground: by whom it is, and how far apart its contour lines are."""
    lines = "" if view.relief is None or not view.relief.contours else f"contours every {view.relief.interval_m:g} m"
    return "; ".join(part for part in (lines, view.attribution) if part)


def _draw_pictures(axes: Axes, view: GroundView) -> Iterator[AxesImage]:
    if view.background is not None:
        yield _show_image(axes, view.background, 1.0)
    elif view.relief is not None:
        light, known = view.relief.shade[..., 0], view.relief.shade[..., 1]
        pixels: Pixels = np.stack((light, light, light, known), axis=2)
        yield _show_image(axes, Background(pixels, view.relief.low_m, view.relief.high_m), SHADE)


def _show_image(axes: Axes, background: Background, alpha: float) -> AxesImage:
    (west, south), (east, north) = background.low_m, background.high_m
    return axes.imshow(
        background.pixels, extent=(west, east, south, north), origin="upper", interpolation="antialiased",
        aspect="auto", alpha=alpha, zorder=BEHIND,
    )  # fmt: skip


def _draw_contours(
    axes: Axes, sheet: MapSheet, contours: Iterable[Contour], clip: Rectangle, shown_m: FloatArray
) -> None:
    for bold, width_pt in ((False, 0.35), (True, 0.8)):
        lines = [np.array(one.places_m) for one in contours if one.bold is bold and len(one.places_m) > 1]
        collection = LineCollection(lines, colors=CONTOUR, linewidths=width_pt, alpha=0.75, zorder=BEHIND + 2.0)
        axes.add_collection(collection, autolim=False)
        collection.set_clip_path(clip)
    for height_m, place_m, turned_deg in _place_labels(sheet, contours, shown_m):
        axes.text(*place_m, f"{height_m:g}", fontsize=6.5, color=CONTOUR, rotation=turned_deg, ha="center",
                  va="center", zorder=BEHIND + 3.0, path_effects=make_white_edge(2.0))  # fmt: skip


def _place_labels(
    sheet: MapSheet, contours: Iterable[Contour], shown_m: FloatArray
) -> Iterator[tuple[float, Place, float]]:
    """Yield heights, where they are written, and how they are turned: on the longest bold lines, off all else."""
    low, high = np.array(sheet.low_m), np.array(sheet.high_m)
    edge = 0.25 * sheet.m_per_in
    found: list[tuple[float, float, FloatArray]] = []
    for one in contours:
        if one.bold:
            places = np.array(one.places_m)
            places = places[((places > low + edge) & (places < high - edge)).all(axis=1)]
            if len(places) > 2:
                found.append((float(np.hypot(*np.diff(places, axis=0).T).sum()), one.height_m, places))
    taken_m = shown_m
    labels = 0
    for length_m, height_m, places in sorted(found, key=lambda row: -row[0])[: 3 * LABELS]:
        tried = np.unique(np.linspace(2, len(places) - 3, TRIED).astype(int).clip(0, len(places) - 1))
        best = int(tried[find_farthest(places[tried], taken_m)])
        crowded = nearest_distance_m(places[best : best + 1], taken_m)[0] < LABEL_IN / 3.0 * sheet.m_per_in
        if length_m < LABEL_IN * sheet.m_per_in or crowded or labels == LABELS:
            continue
        labels += 1
        taken_m = np.concatenate((taken_m, places[best : best + 1]))
        along_m = places[min(best + 2, len(places) - 1)] - places[max(best - 2, 0)]
        turned_deg = math.degrees(math.atan2(along_m[1], along_m[0]))
        yield height_m, (float(places[best, 0]), float(places[best, 1])), (turned_deg + 90.0) % 180.0 - 90.0


def _draw_attribution(axes: Axes, sheet: MapSheet, words: str) -> None:
    """Write in the strip, between scale and north, as much as there is room for."""
    west, east = axes.get_xlim()
    room_in = (east - west) / sheet.m_per_in - 3.2
    most = max(20, int(room_in * LETTERS_PER_IN))
    text = words if len(words) <= most else f"{words[: most - 3]}..."
    if text:
        axes.text(
            east - 0.6 * sheet.m_per_in, sheet.low_m[1] - STRIP_IN / 2.0 * sheet.m_per_in, text.replace("$", r"\$"),
            fontsize=7, color=FAINT_TEXT, ha="right", va="center",
        )  # fmt: skip
