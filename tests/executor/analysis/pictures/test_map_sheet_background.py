"""The background of the maps: in place, with attribution, and nothing drawn over it is hidden."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from PIL import Image

from executor.analysis.pictures import draw_plan_figure, save_figure
from executor.analysis.pictures.map_sheet import describe_ground
from executor.analysis.pictures.style import DPI
from executor.site.ground_view import GroundView, compute_shown_area
from missions.readers.background_files import Background
from tests.executor.flights import first_plan_file
from tests.executor.grounds import Hills, ground_about

PLACES_M = first_plan_file().ends_m.reshape(-1, 2)


def drawn(figure: Figure) -> npt.NDArray[np.uint8]:
    """Return the figure's pixels."""
    figure.set_dpi(DPI)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DPI)
    return np.asarray(Image.open(file).convert("RGB"), dtype=np.uint8)


def colour_at(figure: Figure, axes: Axes, place_m: tuple[float, float]) -> list[int]:
    pixels = drawn(figure)
    x, y = axes.transData.transform(place_m)
    colour: list[int] = pixels[pixels.shape[0] - 1 - round(y), round(x)].tolist()
    return colour


def halves() -> GroundView:
    """Return ground that is red in the north and blue in the south."""
    low_m, high_m = compute_shown_area(PLACES_M)
    pixels = np.full((100, 100, 4), 255, dtype=np.uint8)
    north = np.linspace(high_m[1], low_m[1], 201)[1::2] > 0.0
    pixels[north, :, 1:3] = 0
    pixels[~north, :, :2] = 0
    return GroundView(low_m, high_m, Background(pixels, low_m, high_m), attribution="© Land survey")


def test_a_picture_lies_where_it_belongs_under_a_veil() -> None:
    figure = draw_plan_figure(first_plan_file(), halves())
    [axes] = figure.axes
    red, blue = (colour_at(figure, axes, (350.0, north_m)) for north_m in (60.0, -60.0))
    assert red[0] > red[2] + 100
    assert blue[2] > blue[0] + 100
    assert min(*red, *blue) > 90  # what is drawn over it can be told from it


def test_the_view_stays_as_it_is_without_ground() -> None:
    for view in (ground_about(PLACES_M, hills=Hills()), ground_about(PLACES_M, photo=False, hills=Hills())):
        plain, over = draw_plan_figure(first_plan_file()), draw_plan_figure(first_plan_file(), view)
        for one, other in zip(plain.axes, over.axes, strict=True):
            assert (one.get_xlim(), one.get_ylim()) == (other.get_xlim(), other.get_ylim())
    nothing = GroundView(*compute_shown_area(PLACES_M))
    assert (drawn(draw_plan_figure(first_plan_file())) == drawn(draw_plan_figure(first_plan_file(), nothing))).all()


def test_the_strip_with_scale_and_north_stays_white() -> None:
    figure = draw_plan_figure(first_plan_file(), halves())
    for axes in figure.axes:
        west, east = axes.get_xlim()
        south, _ = axes.get_ylim()
        assert colour_at(figure, axes, (west + 0.5 * (east - west), south + 3.0)) == [255, 255, 255]


def test_contour_lines_are_drawn_with_their_heights() -> None:
    view = ground_about(PLACES_M, photo=False, hills=Hills())
    assert view.relief is not None
    figure = draw_plan_figure(first_plan_file(), view)
    for axes in figure.axes:
        [lines] = [one for one in axes.collections if isinstance(one, ContourSet)]
        assert len(lines.allsegs) > 5
        assert all(len(parts) > 0 for parts in lines.allsegs)
        heights = {one.get_text() for one in axes.texts} & {"450", "500"}
        assert heights == {"450", "500"}
        assert any("contours every 10 m" in one.get_text() for one in axes.texts)


def test_the_attribution_of_the_ground_fits_into_the_strip() -> None:
    long = GroundView(*compute_shown_area(PLACES_M), halves().background, attribution="© " + "a very long name " * 30)
    figure = draw_plan_figure(first_plan_file(), long)
    drawn(figure)
    for axes in figure.axes:
        [text] = [one for one in axes.texts if "©" in one.get_text()]
        box, scale = text.get_window_extent(), next(one for one in axes.texts if one.get_text().endswith(" m"))
        assert box.x0 > scale.get_window_extent().x1
        assert box.x1 < axes.get_window_extent().x1
        assert text.get_text().endswith("...")
    assert describe_ground(halves()) == "© Land survey"


def test_a_large_picture_is_drawn_into_a_file(tmp_path: Path) -> None:
    save_figure(draw_plan_figure(first_plan_file(), ground_about(PLACES_M, hills=Hills())), tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 100_000
