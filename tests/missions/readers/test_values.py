"""What a text says in figures, whatever program and country it is from; one that may be two numbers is none."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.files import is_figure
from missions.readers.values import (
    EAST_WEST,
    NORTH_SOUTH,
    build_rank_keys,
    decimal_mark_of,
    degrees_of,
    grid_figure_of,
    measure_of,
    metres_of,
    parse_figure,
    parse_number,
    parse_pole_rank,
)

THIN, NARROW, HARD = "\u2009", "\u202f", "\u00a0"


@pytest.mark.parametrize(
    ("text", "figure"),
    [
        ("410.5", 410.5), ("410,5", 410.5), ("-3", -3.0), ("−3,5", -3.5), ("1e3", 1000.0), (".5", 0.5), ("5.", 5.0),
        ("543 355,1", 543355.1), (f"543{HARD}355,1", 543355.1), (f"5{THIN}494{THIN}274.6", 5494274.6),
        (f"5{NARROW}494{NARROW}274", 5494274.0), ("5'494'274.6", 5494274.6), ("5’494’274.6", 5494274.6),
        ("5.494.274,6", 5494274.6), ("5,494,274.6", 5494274.6), ("543355,123", 543355.123), ("0,123", 0.123),
    ],
)  # fmt: skip
def test_figures_are_read_as_people_and_spreadsheets_write_them(text: str, figure: float) -> None:
    assert parse_figure(text) == pytest.approx(figure, abs=1e-9)


@pytest.mark.parametrize(
    "text", ["", "north", "1 2", "12_1", "nan", "inf", "1.234.5", "1,2,3", "5 4,1 2", "0x10", "12A"]
)
def test_what_is_no_figure_is_none(text: str) -> None:
    assert parse_figure(text) is None


def test_a_comma_before_three_digits_is_read_by_what_the_rest_of_the_file_shows() -> None:
    assert parse_figure("1,345") is None
    assert parse_figure("1,345", decimal_mark_of(["49.6", "1,345"])) == 1345.0
    assert parse_figure("1,345", decimal_mark_of(["49,6", "1,345"])) == 1.345
    assert parse_figure("1.345", decimal_mark_of(["5.494.274", "7"])) == 1345.0
    assert decimal_mark_of(["49.6", "30,5"]) is None


@given(st.floats(-9e6, 9e6).map(lambda figure: round(figure, 2)), st.sampled_from(" '.,"), st.sampled_from(".,"))
def test_whatever_divides_thousands_the_figure_is_the_same(figure: float, group: str, mark: str) -> None:
    if group != mark:
        text = f"{figure:,.2f}".replace(",", "_").replace(".", mark).replace("_", group)
        assert parse_figure(text) == pytest.approx(figure)


@pytest.mark.parametrize(
    "text",
    [
        "49°35'57.4\"N", "49° 35' 57,4\" N", "N49 35 57.4", "49 35 57.4 N", "49°35′57.4″N", "49º35’57.4”N",
        "49:35:57.4",
        "49°35'57.4''N", "49d35'57.4\"N", "493557.4N", "N 49° 35.956667'", "4935.956667N", "49.599277778",
        "49,599277778",
        "49.599277778° N", "49-35-57.4N", "+49 35 57.4",
    ],
)  # fmt: skip
def test_degrees_are_read_with_minutes_and_letters(text: str) -> None:
    assert degrees_of(text, NORTH_SOUTH) == pytest.approx(49.599277778, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [("15°36'W", -15.6), ("0153600E", 15.6), ("-0°30'", -0.5), ("W015 36 00", -15.6), ("15°36'60\"E", 15 + 37 / 60)],
)
def test_the_side_of_a_longitude_is_its_sign(text: str, degrees: float) -> None:
    assert degrees_of(text, EAST_WEST) == pytest.approx(degrees)


@pytest.mark.parametrize(
    "text", ["-49 N", "49 75 10 N", "49°35.5'57\"N", "15°36'E", "N 49 S", "49 35 N E", "", "north"]
)
def test_what_is_no_latitude_is_none(text: str) -> None:
    assert degrees_of(text, NORTH_SOUTH) is None


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("410 m", 410.0), ("410m", 410.0), ("1345 ft", 409.956), ("1,345 ft", 409.956), ("1345'", 409.956),
        ("410,5 m", 410.5),
        ("30'6\"", 9.2964), ("410 m n. m.", 410.0), ("1 345 m a.s.l.", 1345.0), ("0,41 km", 410.0), ("30", 30.0),
    ],
)  # fmt: skip
def test_heights_have_their_unit_next_to_them(text: str, metres: float) -> None:
    assert metres_of(text) == pytest.approx(metres)
    assert metres_of("30 yards") is None
    assert metres_of("1,345 m") is None


@pytest.mark.parametrize("value", [10**400, "9" * 400, float("inf"), float("nan"), True, [1], None])
def test_what_no_place_can_have_is_no_figure(value: object) -> None:
    for found in (parse_number(value), degrees_of(value, NORTH_SOUTH), metres_of(value), grid_figure_of(value)):
        assert not is_figure(found)
    assert parse_pole_rank(value) is None


def test_a_figure_of_another_kind_has_its_unit_too() -> None:
    assert measure_of("132 kV") == (132.0, "kv")
    assert measure_of("110000") == (110000.0, "")
    assert measure_of("high") is None


@pytest.mark.parametrize(
    "numbers",
    [
        ["11", "12", "12A", "12B", "13"], ["11", "12", "A12", "13"], ["A9", "A10", "B1", "B2"],
        ["9", "9/1", "9/2", "9/10", "10"],
        ["T1", "T2", "T2a", "T10"], ["1", "1.5", "2"], ["12", "12 bis", "13"], [1, 2.0, "2A", 3], ["-1", "0", "1"],
        ["2024-09-01", "2024-10-02"],
    ],
)  # fmt: skip
def test_poles_that_were_put_in_later_stand_between(numbers: list[object]) -> None:
    ranks = [rank for rank in map(parse_pole_rank, numbers) if rank is not None]
    keys = build_rank_keys(ranks)
    assert len(keys) == len(numbers)
    assert keys == sorted(keys)
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("value", [None, True, "", "A", float("nan"), "north"])
def test_what_has_no_number_has_no_place_in_a_line(value: object) -> None:
    assert parse_pole_rank(value) is None
