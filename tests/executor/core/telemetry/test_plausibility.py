"""What no vehicle can say is unknown, field by field; what may be true is left alone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.messages import (
    Attitude,
    Battery,
    Gps,
    Heartbeat,
    Home,
    Message,
    MissionCurrent,
    MissionReached,
    ParamValue,
    Position,
    SystemStatus,
    Wind,
)
from executor.core.telemetry.plausibility import filter_implausible

PLACE = Position(1.0, 50.0, 13.0, 300.0, 20.0, 1.0, 1.0, 0.0, 90.0)
PACK = Battery(0, 90.0, 12.0, 30.0, 1.0, 1, 0, (4.0, 4.0, 4.0))
STATUS = SystemStatus(90.0, 12.0, 0, prearm_ok=True)
NO_NUMBERS = (math.nan, math.inf, -math.inf, 1e30, -1e30)


@pytest.mark.parametrize(
    "message",
    [
        PLACE, PACK, STATUS, Battery(0, None, None, None, None, 0, 0), SystemStatus(None, None, 0, prearm_ok=None),
        replace(PLACE, lat_deg=0.0), replace(PLACE, alt_msl_m=-400.0), replace(PLACE, north_m_s=-60.0),
        replace(PLACE, heading_deg=None), Home(50.0, 13.0, 300.0), Attitude(180.0, -90.0), Gps(8, None),
        Wind(30.0, 359.9), MissionCurrent(0, None), MissionCurrent(11, 11), MissionCurrent(12, 11), MissionReached(4),
        ParamValue("RTL_ALT", -1.0, 9), Heartbeat(3, 0, armed=True, system_status=4),
    ],
)  # fmt: skip
def test_what_may_be_true_is_left_as_it_is(message: Message) -> None:
    assert filter_implausible(message) is message


@pytest.mark.parametrize("value", [*NO_NUMBERS, -(2**31) / 1e7, 200.1])
@pytest.mark.parametrize("field", ["lat_deg", "lon_deg"])
def test_a_place_off_the_globe_is_none(field: str, value: float) -> None:
    assert filter_implausible(replace(PLACE, **{field: value})) is None
    assert filter_implausible(replace(Home(50.0, 13.0, 300.0), **{field: value})) is None


def test_the_place_that_stands_for_none_is_none() -> None:
    assert filter_implausible(replace(PLACE, lat_deg=0.0, lon_deg=0.0)) is None
    assert filter_implausible(Home(0.0, 0.0, 0.0)) is None


@pytest.mark.parametrize("value", [*NO_NUMBERS, -(2**31) / 1e3, 20_001.0])
@pytest.mark.parametrize("field", ["alt_msl_m", "alt_rel_m", "north_m_s", "east_m_s", "down_m_s"])
def test_a_height_or_a_speed_of_no_multicopter_is_no_position(field: str, value: float) -> None:
    assert filter_implausible(replace(PLACE, **{field: value})) is None


@pytest.mark.parametrize("value", [math.nan, -1.0, 654.0])
def test_a_heading_that_is_none_costs_the_heading_alone(value: float) -> None:
    assert filter_implausible(replace(PLACE, heading_deg=value)) == replace(PLACE, heading_deg=None)


@pytest.mark.parametrize("value", [*NO_NUMBERS, -1.0])
@pytest.mark.parametrize("field", ["remaining_pct", "voltage_v", "current_a", "consumed_ah"])
def test_of_a_battery_what_is_wrong_is_unknown_and_the_rest_is_known(field: str, value: float) -> None:
    wrong: dict[str, Any] = {field: value}
    unknown: dict[str, Any] = {field: None}
    assert filter_implausible(replace(PACK, **wrong)) == replace(PACK, **unknown)


@pytest.mark.parametrize("cell", [math.nan, 0.0, 65.5])
def test_cells_that_are_none(cell: float) -> None:
    assert filter_implausible(replace(PACK, cells_v=(4.0, cell))) == replace(PACK, cells_v=())


@pytest.mark.parametrize(
    ("said", "known"),
    [
        (replace(STATUS, remaining_pct=101.0), replace(STATUS, remaining_pct=None)),
        (replace(STATUS, voltage_v=0.0), replace(STATUS, voltage_v=None)),
        (Attitude(math.nan, 0.0), None),
        (Attitude(0.0, 361.0), None),
        (Gps(9, 10), None),
        (Wind(math.nan, 0.0), None),
        (Wind(3.0, math.inf), None),
        (Wind(151.0, 0.0), None),
        (MissionCurrent(65535, 4), None),
        (MissionCurrent(0, 65535), MissionCurrent(0, 65535)),
        (MissionReached(65535), None),
        (ParamValue("RTL_ALT", math.nan, 9), None),
    ],
)
def test_everything_else(said: Message, known: Message | None) -> None:
    assert filter_implausible(said) == known


PLACED = Position(1.0, 49.6, 15.6, 450.0, 20.0, 1.0, 2.0, 3.0, 90.0)
EDGES: list[tuple[Any, dict[str, tuple[Any, Any]]]] = [
    # For each field: the last figure that can be, and the first that cannot.
    (
        PLACED,
        {
            "lat_deg": (90.0, 90.1),
            "lon_deg": (180.0, 180.1),
            "alt_msl_m": (20_000.0, 20_000.1),
            "alt_rel_m": (-1000.0, -1000.1),
            "north_m_s": (150.0, 150.1),
            "east_m_s": (-150.0, -150.1),
            "down_m_s": (150.0, 150.1),
            "heading_deg": (360.0, 360.1),
            "boot_s": (0.0, math.inf),
        },
    ),
    (
        PACK,
        {
            "remaining_pct": (100.0, 100.1),
            "voltage_v": (500.0, 500.1),
            "current_a": (1000.0, 1000.1),
            "consumed_ah": (1000.0, 1000.1),
            "cells_v": ((0.5, 4.9), (0.5, 5.0)),
        },
    ),
    (
        PACK,
        {"remaining_pct": (0.0, -0.1), "voltage_v": (1.0, 0.9), "current_a": (0.0, -0.1), "consumed_ah": (0.0, -0.1)},
    ),
    (PACK, {"cells_v": ((0.5, 3.8), (0.4, 3.8))}),
    (SystemStatus(50.0, 15.0, 0, None), {"remaining_pct": (100.0, 100.1), "voltage_v": (500.0, 500.1)}),
    (SystemStatus(50.0, 15.0, 0, None), {"remaining_pct": (0.0, -0.1), "voltage_v": (1.0, 0.9)}),
    (Wind(3.0, 90.0), {"speed_m_s": (150.0, 150.1), "from_deg": (360.0, 360.1)}),
    (Wind(3.0, 90.0), {"speed_m_s": (0.0, -0.1), "from_deg": (0.0, -0.1)}),
    (Gps(3, 12), {"fix": (8, 9)}),
    (Gps(3, 12), {"fix": (0, -1)}),
    (MissionCurrent(3, 9, None), {"seq": (65534, 65535)}),
    (MissionCurrent(3, 9, None), {"seq": (0, -1)}),
    (MissionReached(3), {"seq": (65534, 65535)}),
    (MissionReached(3), {"seq": (0, -1)}),
]
CASES = [(said, name, good, bad) for said, edges in EDGES for name, (good, bad) in edges.items()]


@pytest.mark.parametrize(("said", "name", "good", "bad"), CASES)
def test_the_range_of_each_field_ends_where_it_should(said: Any, name: str, good: Any, bad: Any) -> None:
    assert getattr(filter_implausible(replace(said, **{name: good})), name) == good
    found = filter_implausible(replace(said, **{name: bad}))
    assert found is None or getattr(found, name) in {None, ()}
    if found is not None:
        assert replace(found, **{name: good}) == replace(said, **{name: good}), "the other fields stay"


def test_an_item_beyond_the_number_of_items_is_one_of_another_mission() -> None:
    assert filter_implausible(MissionCurrent(9, 9, None)) == MissionCurrent(9, 9, None)
    assert filter_implausible(MissionCurrent(10, 9, None)) == MissionCurrent(10, 9, None)
    assert filter_implausible(MissionCurrent(10, 65535, None)) == MissionCurrent(10, 65535, None)
