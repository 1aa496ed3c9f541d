"""What is not well yet no fault."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core import linkquality
from executor.core.degraded import TABLE, warnings
from executor.core.linkquality import LinkQuality
from executor.core.messages import Heartbeat, Radio, Traffic
from executor.core.vehicle import Stage, VehicleState
from executor.core.watching import View
from tests.executor.core.test_faults import CONTEXT, NOW_S, SETUP, at, flying, pack

GOOD = Radio(120, 110, 40, 40, 90)


def lossy(*lost: int, of: int = 20) -> LinkQuality:
    """Return a link after seconds in which so many of its frames were lost."""
    state = LinkQuality()
    for number, missing in enumerate(lost):
        state = linkquality.counted(state, Traffic(of - missing, missing), NOW_S - len(lost) + number, 10.0)
    return state


ROWS: list[tuple[str, VehicleState]] = [
    ("silent", flying(heard_s=NOW_S - 4.0)),
    ("heartbeat", flying(heartbeat_s=NOW_S - 4.0)),
    ("disarmed", flying(doubted=(Heartbeat(3, 3, False, 4), NOW_S - 0.5))),
    ("positions", flying(fix=at(age_s=4.0))),
    ("items", flying(item_s=NOW_S - 6.0)),
    ("loss", flying(quality=lossy(*[0] * 60, *[10] * 12))),
    ("radio", flying(quality=linkquality.heard_radio(LinkQuality(), Radio(45, 110, 40, 40, 90), NOW_S))),
    ("battery-silent", flying(battery=pack(90.0, 90.0, age_s=9.0))),
    ("battery-low", flying(battery=pack(20.0, charge_state=2))),
    ("reserve", flying(battery=pack(18.0, 18.0))),
    ("position", flying(jump=(33.0, NOW_S))),
    ("stands", flying(stage=Stage.RETURNING, anchor=replace(at(), boot_s=NOW_S - 25.0))),
]


def names(state: VehicleState) -> list[str]:
    return [row.name for row, _ in warnings(View(CONTEXT, SETUP, state, False, NOW_S))]


def test_every_warning_has_its_row() -> None:
    assert [name for name, _ in ROWS] == [row.name for row in TABLE]


def test_nothing_is_wrong_with_a_healthy_vehicle() -> None:
    assert names(flying(quality=linkquality.heard_radio(LinkQuality(), GOOD, NOW_S))) == []


@pytest.mark.parametrize(("name", "state"), ROWS, ids=[name for name, _ in ROWS])
def test_it_is_said(name: str, state: VehicleState) -> None:
    assert name in names(state)


def test_nobody_is_warned_of_a_vehicle_on_the_ground() -> None:
    assert names(flying(stage=Stage.LANDED, heard_s=NOW_S - 100.0)) == []


def test_a_log_that_was_thinned_is_no_lossy_link() -> None:
    assert lossy(*[15] * 60).worse == 0.0
    assert lossy(*[0] * 60, *[10] * 12).worse > 0.25


def test_a_full_buffer_is_the_radios_own_complaint() -> None:
    assert "buffer 5 %" in LinkQuality(radio=Radio(120, 110, 40, 40, 5)).weak
    assert LinkQuality(radio=Radio(None, None, None, None, None)).weak == ""
