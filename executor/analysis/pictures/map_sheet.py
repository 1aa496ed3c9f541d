"""Lay out a map sheet: scale, background, labels, title and legend."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch, Polygon, Rectangle

from executor.analysis.flight_record import Place
from executor.analysis.pictures.style import FAINT, INK, LOSS, PAPER, WIDTH_IN, make_figure, make_white_edge
from executor.site.ground_view import Contour, GroundView
from missions.geo import FloatArray
from missions.no_fly_areas import Area, AreaKind
from missions.readers.background_files import Background, Pixels

DIRECTIONS = 24
REACHES = (0.7, 1.0, 1.4, 1.9, 2.6, 3.5, 4.6)
"""Distances at which a label is tried, in label widths."""
COVERED = 40.0
"""Cost of one covered point, in label heights of distance."""


class LabelPlacer:
    """Find room for one label after another, each with a leader to its object; each one takes up its room."""

    def __init__(self, taken_m: FloatArray, low_m: Place | FloatArray, high_m: Place | FloatArray) -> None:
        """Start with (n, 2) points that should stay visible, and the corners of the map."""
        self._taken_m = taken_m
        self._words_m = np.zeros((0, 2))
        self._low_m = np.array(low_m)
        self._high_m = np.array(high_m)

    def place_label(self, anchors_m: FloatArray, size_m: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return the start of a label's leader and the middle of the label.

        Args:
            anchors_m: (n, 2) places, any of which the label may name.
            size_m: The label's width and height.
        """
        size = np.array(size_m)
        anchors, middles = self._generate_candidates(anchors_m, size)
        nearness = np.hypot(*(middles - anchors).T) / size[1]
        best, best_price = 0, math.inf
        for index in np.argsort(nearness, kind="stable"):
            if nearness[index] >= best_price:
                break  # any farther one costs more by its distance alone
            price = float(nearness[index]) + COVERED * self._count_hidden(anchors[index], middles[index], size)
            if price < best_price:
                best, best_price = int(index), price
        self._occupy(anchors[best], middles[best], size)
        return anchors[best], middles[best]

    def _generate_candidates(self, anchors_m: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (c, 2) anchors and (c, 2) middles of labels around them, inside the map."""
        angles = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
        ring = np.column_stack((np.cos(angles), np.sin(angles)))
        # Ellipses as flat as the label, yet never nearer than two heights above or below.
        radii = [(reach * size[0], max(reach * size[0] / 2.0, 2.0 * size[1])) for reach in REACHES]
        offsets = np.concatenate([ring * radius for radius in radii])
        anchors = np.repeat(anchors_m, len(offsets), axis=0)
        middles = anchors + np.tile(offsets, (len(anchors_m), 1))
        return anchors, np.clip(middles, self._low_m + size / 2.0, self._high_m - size / 2.0)

    def _count_hidden(self, anchor: FloatArray, middle: FloatArray, size: FloatArray) -> int:
        """Return how many points the label would hide, plus the points of its leader on existing labels."""
        hidden = (np.abs(self._taken_m - middle) <= 0.6 * size).all(axis=1).sum()
        # The sample points of a label are a twelfth of its height apart.
        crossed = nearest_distance_m(_sample_leader_m(anchor, middle), self._words_m) < size[1] / 6.0
        return int(hidden + crossed.sum())

    def _occupy(self, anchor: FloatArray, middle: FloatArray, size: FloatArray) -> None:
        axes = [np.linspace(-0.5, 0.5, 13) * side for side in size]
        box = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) + middle
        self._words_m = np.concatenate((self._words_m, box))
        self._taken_m = np.concatenate((self._taken_m, box, _sample_leader_m(anchor, middle)))


def _sample_leader_m(anchor_m: FloatArray, middle_m: FloatArray) -> FloatArray:
    return np.linspace(anchor_m, middle_m, 24)[1:]


def nearest_distance_m(places_m: FloatArray, others_m: FloatArray) -> FloatArray:
    """Return (n,) float64: distance of each of (n, 2) places from the nearest of (m, 2) others; infinite if none."""
    if len(others_m) == 0:
        return np.full(len(places_m), math.inf)
    apart_m = np.hypot(*(places_m[:, np.newaxis] - others_m).transpose(2, 0, 1))
    return np.asarray(apart_m.min(axis=1), dtype=np.float64)


def find_farthest(candidates_m: FloatArray, others_m: FloatArray) -> int:
    """Return the index of the place in (n, 2) that is farthest from all of (m, 2) others; 0 without others."""
    return int(nearest_distance_m(candidates_m, others_m).argmax())


MARGIN_IN = 0.15
TITLE_IN = 0.5
PANEL_TITLE_IN = 0.3
LEGEND_ROW_IN = 0.21
LEGEND_COLUMNS = 5
STRIP_IN = 0.45
"""Height of the strip below the map for scale and north arrow."""
HEIGHTS_IN = (3.0, 8.0)
"""Least and greatest height of the map."""
ROOM = 0.07
"""Margin around the drawing for labels, as a share."""


@dataclass(frozen=True, slots=True, eq=False)
class MapSheet:
    """Figure and its map, with the scale."""

    figure: Figure
    axes: Axes
    m_per_in: float
    low_m: Place
    """South-western corner of the area for labels; the scale strip lies below."""
    high_m: Place
    busy: bool = False
    """Whether a background is drawn; text over it needs an outline."""


def make_sheet(shown_m: FloatArray, title: str, name: str, handles: Sequence[Artist]) -> MapSheet:
    """Return an empty map, with a name, that shows (n, 2) places, and the legend below it."""
    low, high = shown_m.min(axis=0), shown_m.max(axis=0)
    # A line due east has no height.
    size = np.maximum(high - low, 0.25 * float(max(high - low)) + 1.0)
    middle = (low + high) / 2.0
    size *= 1.0 + 2.0 * ROOM
    width_in = WIDTH_IN - 2.0 * MARGIN_IN
    height_in = min(max(width_in * size[1] / size[0], HEIGHTS_IN[0]), HEIGHTS_IN[1])
    m_per_in = float(max(size[0] / width_in, size[1] / height_in))
    half = m_per_in * np.array([width_in, height_in]) / 2.0
    low, high = middle - half, middle + half

    legend_in = LEGEND_ROW_IN * math.ceil(len(handles) / LEGEND_COLUMNS) + MARGIN_IN
    total_in = TITLE_IN + PANEL_TITLE_IN + height_in + STRIP_IN + MARGIN_IN + legend_in
    bottom_in = legend_in + MARGIN_IN
    figure = make_figure(total_in, title)
    axes = figure.add_axes(
        (MARGIN_IN / WIDTH_IN, bottom_in / total_in, width_in / WIDTH_IN, (height_in + STRIP_IN) / total_in)
    )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1] - STRIP_IN * m_per_in, high[1])
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#cccccc")
    axes.set_title(name, loc="left", fontsize=11, color=INK)
    _draw_scale_and_north(axes, m_per_in)
    figure.legend(
        handles=handles, loc="lower center", ncols=LEGEND_COLUMNS, frameon=False, fontsize=9, borderaxespad=0.3,
        handlelength=3.2, columnspacing=1.6,
    )  # fmt: skip
    return MapSheet(figure, axes, m_per_in, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def draw_ground(axes: Axes, ends_m: FloatArray) -> None:
    """Draw the (n, 2, 2) segments thin and grey with their pylons as dots, and the depot."""
    axes.add_collection(LineCollection(list(ends_m), colors=FAINT, linewidths=0.9, zorder=1), autolim=False)
    pylons = np.unique(np.round(ends_m.reshape(-1, 2), 2), axis=0)
    axes.plot(pylons[:, 0], pylons[:, 1], ls="", marker="o", ms=2.6, color="#555555", zorder=6)
    axes.plot([0.0], [0.0], ls="", marker="*", ms=13, mfc=INK, mec=PAPER, mew=0.8, zorder=8)


def _draw_areas(axes: Axes, areas: Iterable[Area]) -> None:
    """Draw areas hatched, those with a height limit pale, with their names."""
    for area in areas:
        limited = area.kind is AreaKind.HEIGHT_LIMIT
        hatch, alpha = ("", 0.08) if limited else ("///", 0.16)
        for ring in area.polygons_m():
            axes.add_patch(Polygon(ring, facecolor=LOSS, edgecolor="none", alpha=alpha, zorder=0))
            axes.add_patch(
                Polygon(ring, fill=False, edgecolor=LOSS, lw=0.8, ls="--" if limited else "-", hatch=hatch, alpha=0.45,
                        zorder=0.5)
            )  # fmt: skip
        (west, south), (east, north) = np.min(area.edges_m(), axis=(0, 1)), np.max(area.edges_m(), axis=(0, 1))
        axes.text((west + east) / 2, (south + north) / 2, area.name, fontsize=8, color=LOSS, ha="center", va="center",
                  clip_on=True, path_effects=make_white_edge(2.0), zorder=7)  # fmt: skip


def build_area_handles(areas: Sequence[Area]) -> list[Artist]:
    """Return the legend handles for areas; empty if there are none."""
    if not areas:
        return []
    return [Patch(facecolor=LOSS, alpha=0.3, hatch="///", label="areas that flights keep out of")]


def _draw_scale_and_north(axes: Axes, m_per_in: float) -> None:
    (west, east), (south, _) = axes.get_xlim(), axes.get_ylim()
    length_m = round_length_m(1.3 * m_per_in)
    left, base = west + 0.2 * m_per_in, south + 0.2 * m_per_in
    thick = 0.05 * m_per_in
    # Two halves, dark and light, so that half of the length can be read too.
    for begin, colour in ((left, INK), (left + length_m / 2.0, PAPER)):
        box = Rectangle((begin, base), length_m / 2.0, thick, facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=9)
        axes.add_patch(box)
    words = f"{length_m:g} m" if length_m < 1000 else f"{length_m / 1000:g} km"
    axes.text(left + length_m + 0.1 * m_per_in, base + thick / 2, words, fontsize=9, color=INK, va="center")
    x = east - 0.25 * m_per_in
    axes.annotate(
        "",
        xy=(x, south + 0.45 * m_per_in),
        xytext=(x, south + 0.1 * m_per_in),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=9,
    )
    axes.text(x - 0.1 * m_per_in, south + 0.25 * m_per_in, "N", fontsize=10, color=INK, ha="right", va="center",
              path_effects=make_white_edge(2.0))  # fmt: skip


def round_length_m(most_m: float) -> float:
    """Return the longest of 1, 2, 5, 10, 20, 50 ... metres that is no longer than a length.

    >>> round_length_m(487.0)
    200.0
    """
    power = 10.0 ** math.floor(math.log10(most_m))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most_m)


SHADE = 0.45
"""Strength of the relief shading; lines over it must stand out."""
VEIL = 0.42
"""White veil over a background picture, for the same reason."""
CONTOUR = "#6b5138"
"""Brown, as on paper maps; no vehicle's line has this lightness."""
FAINT_TEXT = "#666666"
BEHIND = -5.0
LETTERS_PER_IN = 15.0


def draw_below(sheet: MapSheet, view: GroundView | None, areas: Iterable[Area]) -> MapSheet:
    """Draw areas, and the known background, below the map; return the updated sheet."""
    axes = sheet.axes
    _draw_areas(axes, areas)
    if view is None or (view.background is None and view.relief is None):
        return sheet
    limits = axes.get_xlim(), axes.get_ylim()
    clip = Rectangle(sheet.low_m, sheet.high_m[0] - sheet.low_m[0], sheet.high_m[1] - sheet.low_m[1])
    clip.set_transform(axes.transData)
    for artist in _draw_pictures(axes, view):
        artist.set_clip_path(clip)
    if view.background is not None:
        veil = Rectangle(clip.get_xy(), clip.get_width(), clip.get_height(), fc=PAPER, ec="none", alpha=VEIL)
        axes.add_patch(veil).set_zorder(BEHIND + 1.0)
    if view.relief is not None:
        _draw_contours(axes, sheet, view.relief.contours)
    _draw_attribution(axes, sheet, describe_ground(view))
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])
    return replace(sheet, busy=True)


def describe_ground(view: GroundView) -> str:
    """Return the caption of a background: attribution and contour interval."""
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


def _draw_contours(axes: Axes, sheet: MapSheet, contours: Iterable[Contour]) -> None:
    """Draw the visible part of contour lines, each bold one with its height."""
    lines: dict[tuple[float, bool], list[FloatArray]] = {}
    for one in contours:
        places_m = np.array(one.places_m)
        inside = np.all((places_m > sheet.low_m) & (places_m < sheet.high_m), axis=1)
        parts = np.split(places_m, np.flatnonzero(np.diff(inside)) + 1)[0 if inside[0] else 1 :: 2]
        lines.setdefault((one.height_m, one.bold), []).extend(part for part in parts if len(part) > 1)
    shown = {level: parts for level, parts in sorted(lines.items()) if parts}
    if shown:
        drawn = ContourSet(
            axes, [height_m for height_m, _ in shown], list(shown.values()), colors=CONTOUR, alpha=0.75,
            linewidths=[0.8 if bold else 0.35 for _, bold in shown], zorder=BEHIND + 2.0,
        )  # fmt: skip
        bold = [height_m for height_m, is_bold in shown if is_bold]
        for label in axes.clabel(drawn, bold, fontsize=6.5, fmt="%g", zorder=6.5):
            label.set_path_effects(make_white_edge(2.0))


def _draw_attribution(axes: Axes, sheet: MapSheet, words: str) -> None:
    """Write the attribution into the strip, between scale and north arrow, as far as there is room."""
    west, east = axes.get_xlim()
    room_in = (east - west) / sheet.m_per_in - 3.2
    most = max(20, int(room_in * LETTERS_PER_IN))
    text = words if len(words) <= most else f"{words[: most - 3]}..."
    if text:
        axes.text(
            east - 0.6 * sheet.m_per_in, sheet.low_m[1] - STRIP_IN / 2.0 * sheet.m_per_in, text.replace("$", r"\$"),
            fontsize=7, color=FAINT_TEXT, ha="right", va="center",
        )  # fmt: skip
