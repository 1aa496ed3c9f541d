"""The pictures' content, and that nothing in them lies on anything else."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox, BboxBase

from executor.analysis.flight_record import FlightRecord, read_run
from executor.analysis.pictures import (
    draw_battery_figure,
    draw_front_figure,
    draw_plan_figure,
    draw_window_figure,
    save_figure,
)
from executor.analysis.pictures.battery_figure import spread_heights
from executor.analysis.pictures.map_sheet import LabelPlacer, find_farthest, round_length_m
from executor.analysis.pictures.style import COLOURS, DPI, INK, LOSS, style_of
from missions import PlanFile, Window
from missions.geo import FloatArray
from missions.geometry import sample_leg
from planner import find_repairs_at, replan_window
from tests.executor.flights import first_plan_file, write_run

PNG = b"\x89PNG\r\n\x1a\n"
FLEET = 56
"""As many vehicles as have a look of their own."""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> FlightRecord:
    """Return the flight in `flights` that finishes."""
    run = tmp_path_factory.mktemp("finished")
    write_run(run)
    return read_run(run)


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> FlightRecord:
    """Return the one that does not."""
    run = tmp_path_factory.mktemp("unfinished")
    write_run(run, finished=False)
    return read_run(run)


@pytest.fixture(scope="module")
def drawn(record: FlightRecord, unfinished: FlightRecord) -> list[Figure]:
    """Return all kinds of figures as they are when they have been drawn."""
    figures = [
        draw_battery_figure(record),
        draw_battery_figure(unfinished),
        draw_plan_figure(first_plan_file()),
    ]
    for figure in figures:
        figure.set_dpi(DPI)
        figure.draw_without_rendering()
    return figures


def test_two_files_of_the_promised_size(record: FlightRecord, tmp_path: Path) -> None:
    save_figure(draw_plan_figure(first_plan_file()), tmp_path / "plan.png")
    save_figure(draw_battery_figure(record), tmp_path / "battery.png")
    for name in ("plan.png", "battery.png"):
        content = (tmp_path / name).read_bytes()
        assert content.startswith(PNG)
        assert int.from_bytes(content[16:20], "big") == 1800


def test_a_picture_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        save_figure(draw_plan_figure(first_plan_file()), tmp_path / "nowhere" / "plan.png")


def test_the_map_of_a_plan_names_its_vehicles_and_draws_inspections_wide() -> None:
    figure = draw_plan_figure(first_plan_file())
    (axes,) = figure.axes
    assert axes.get_title(loc="left") == "Plan"
    assert _words(axes) == {"uav1", "uav2"}
    assert _legend_words(figure) >= {"uav1", "uav2", "uav3", "planned inspection", "planned transit", "depot"}
    routes = [line for line in axes.lines if line.get_color() in COLOURS]
    assert [line.get_linewidth() for line in routes] == [0.8, 2.8, 0.8, 2.8]


def test_legends_lie_next_to_the_maps(drawn: list[Figure]) -> None:
    for figure in drawn:
        (legend,) = figure.legends
        inside = legend.get_window_extent()
        assert _contains(figure.bbox, inside)
        for axes in figure.axes:
            assert not inside.overlaps(axes.get_window_extent())


def test_no_words_lie_on_other_words(drawn: list[Figure]) -> None:
    for figure in drawn:
        for axes in figure.axes:
            boxes = [Text.get_window_extent(text) for text in _texts(axes)]
            assert all(_contains(figure.bbox, box) for box in boxes)
            assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_a_metre_is_as_long_to_the_north_as_to_the_east() -> None:
    (axes,) = draw_plan_figure(first_plan_file()).axes
    box = axes.get_window_extent()
    per_m = (box.width / np.ptp(axes.get_xlim()), box.height / np.ptp(axes.get_ylim()))
    assert per_m[0] == pytest.approx(per_m[1], rel=1e-6)


def test_the_battery_figure_has_plans_replans_and_measurements(record: FlightRecord) -> None:
    limits, axes = sorted(draw_battery_figure(record).axes, key=lambda one: -one.get_position().y0)
    lines = [line for line in axes.lines if line.get_color() in COLOURS and len(_x(line)) > 1]
    measured = [line for line in lines if line.get_marker() != "None"]
    assert [line.get_linestyle() for line in lines if line not in measured] == ["-", "-", "--", "--"]
    assert len({(line.get_marker(), line.get_color()) for line in measured}) == 3
    assert np.asarray(measured[0].get_ydata()) == pytest.approx(np.arange(16.0))
    # Used is at most 15 %: the limits stand in a strip of their own.
    assert sorted(float(y) for y in limits.get_yticks()) == [75.0, 85.0]
    assert {text.get_text() for text in limits.texts} >= {"budget, 75 % used", "reserve, 15 % left"}


def test_the_battery_figure_marks_the_loss_and_the_longest_route(record: FlightRecord) -> None:
    for axes in draw_battery_figure(record).axes:
        upright = {
            (round(float(_x(line)[0]), 1), line.get_color(), line.get_linestyle())
            for line in axes.lines
            if len(_x(line)) == 2 and _x(line)[0] == _x(line)[1]
        }
        assert upright == {(40.0, LOSS, "--"), (50.0, LOSS, "-"), (140.0, INK, "-")}


def test_the_ends_of_the_lines_say_what_was_planned_and_used(record: FlightRecord) -> None:
    words = set().union(*map(_words, draw_battery_figure(record).axes))
    assert words >= {"uav2: planned 11 %, used 4 %", "uav1: planned 15 %, used 15 %", "uav2 lost (link), T+0:50"}


def test_every_vehicle_has_a_look_of_its_own_also_in_grey() -> None:
    looks = [style_of(layer) for layer in range(FLEET)]
    lightness = [round(_lightness(look.colour)) for look in looks]
    assert len({(look.dashes, light) for look, light in zip(looks, lightness, strict=True)}) == FLEET
    assert len({(look.marker, light) for look, light in zip(looks, lightness, strict=True)}) == FLEET


def test_the_first_vehicles_differ_in_lightness_alone() -> None:
    levels = [_lightness(style_of(layer).colour) for layer in range(8)]
    assert min(abs(one - other) for one, other in itertools.combinations(levels, 2)) >= 5.0
    assert min(abs(one - other) for one, other in itertools.combinations(levels[:4], 2)) >= 10.0


@given(st.lists(st.floats(0.0, 1.0), max_size=20), st.floats(0.001, 0.2))
def test_spread_heights_keep_their_order_their_mean_and_their_distance(heights: list[float], least: float) -> None:
    heights.sort()
    moved = spread_heights(heights, least)
    assert len(moved) == len(heights)
    assert all(upper - lower >= least - 1e-9 for lower, upper in itertools.pairwise(moved))
    assert sum(moved) == pytest.approx(sum(heights), abs=1e-9)


@given(st.floats(0.01, 1e6))
def test_a_scale_is_round_and_fills_at_least_two_fifths(most_m: float) -> None:
    length_m = round_length_m(most_m)
    assert 0.4 * most_m - 1e-9 <= length_m <= most_m
    assert float(f"{length_m:.0e}"[0]) in {1.0, 2.0, 5.0}


def test_labels_find_room_off_the_lines_and_off_each_other() -> None:
    line = sample_leg(np.array([(0.0, 0.0), (100.0, 0.0)]), 1.0)
    placer = LabelPlacer(line, (-50.0, -50.0), (150.0, 50.0))
    boxes = []
    for _ in range(6):
        anchor, (east, north) = placer.place_label(line[::10], (30.0, 8.0))
        assert math.dist(anchor, (east, north)) < 60.0
        assert anchor[1] == 0.0
        boxes.append(Bbox.from_extents(east - 15.0, north - 4.0, east + 15.0, north + 4.0))
    frame = Bbox.from_extents(-50.0, -50.0, 150.0, 50.0)
    assert all(_contains(frame, box) for box in boxes)
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    assert not any(box.y0 < 0.0 < box.y1 for box in boxes)


def test_the_calmest_place_is_the_farthest_from_the_nearest_other() -> None:
    places = np.array([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)])
    assert find_farthest(places, np.array([(1.0, 0.0), (21.0, 0.0)])) == 1
    assert find_farthest(places, np.zeros((0, 2))) == 0


def _texts(axes: Axes) -> list[Annotation]:
    return [text for text in axes.texts if isinstance(text, Annotation) and text.get_text()]


def _words(axes: Axes) -> set[str]:
    return {text.get_text() for text in _texts(axes)}


def _legend_words(figure: Figure) -> set[str]:
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def _contains(outer: BboxBase, inner: BboxBase) -> bool:
    return bool(outer.x0 <= inner.x0 and inner.x1 <= outer.x1 and outer.y0 <= inner.y0 and inner.y1 <= outer.y1)


def _x(line: Line2D) -> FloatArray:
    return np.asarray(line.get_xdata(), dtype=np.float64)


def _lightness(colour: str) -> float:
    """Return CIE L* of an sRGB colour: what is left of it in grey."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in to_rgb(colour)]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return 116.0 * math.cbrt(luminance) - 16.0


def test_the_window_figure_has_the_plan_and_the_replans_at_its_beginning(tmp_path: Path) -> None:
    content = first_plan_file()
    found = replan_window(content.build_instance(), content.plan, effort=100)
    repairs = find_repairs_at(content.build_instance(), content.plan, found.earliest_s, effort=100)
    figure = draw_window_figure(content, found, repairs)
    axes = figure.axes[0]
    assert {left.lost for left, _ in repairs} == {0, 1}
    solid = [line for line in axes.lines if line.get_color() in COLOURS and line.get_linestyle() == "-"]
    assert [float(_x(line)[-1]) for line in solid] == pytest.approx(list(content.durations_s))
    assert any(line.get_linestyle() == "--" for line in axes.lines)
    assert {text.get_text() for panel in figure.axes for text in panel.texts} >= {
        "budget, 75 %", f"window begins, {found.earliest_s:.0f} s", f"longest route, {found.longest_route_s:.0f} s",
    }  # fmt: skip
    assert _legend_words(figure) >= {"plan", "re-plan without uav1", "re-plan without uav2", "re-plan window"}
    assert f"{found.window_pct:.1f} %" in figure.texts[0].get_text()
    save_figure(draw_window_figure(content, found, repairs), tmp_path / "window.png")
    assert (tmp_path / "window.png").read_bytes().startswith(PNG)


def trade(longest_route_s: float, earliest_s: float, energy_pct: float) -> PlanFile:
    """Return a plan with these figures."""
    window = Window(0.0, earliest_s, longest_route_s, None)
    plan = first_plan_file()
    route = replace(plan.routes[0], duration_s=longest_route_s, energy_pct=energy_pct)
    return replace(plan, routes=(route,), window=window)


def test_the_front_is_numbered_and_has_the_others_next_to_it(tmp_path: Path) -> None:
    figures = [(100.0 + 20 * number, 90.0 - 15 * number, 50.0 + number % 3) for number in range(6)]
    front, compared = [trade(*one) for one in figures], {"minmax": (100.0, 95.0, 55.0), "mincomb": (160.0, 80.0, 49.0)}
    figure = draw_front_figure(front, {name: trade(*one) for name, one in compared.items()})
    axes, _ = figure.axes
    assert [text.get_text() for text in axes.texts] == ["1", "2", "3", "4", "5", "6"]
    assert _legend_words(figure) == {"minmax", "mincomb"}
    places = {(float(_x(line)[0]), float(np.ravel(line.get_ydata())[0])) for line in axes.lines}
    assert places == {one[:2] for one in (*figures, *compared.values())}
    figure.set_dpi(DPI)
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    save_figure(draw_front_figure(front[:1], {}), tmp_path / "front.png")
    assert (tmp_path / "front.png").read_bytes().startswith(PNG)
