"""Which moves lead up from a line and down to one."""

from __future__ import annotations

import numpy as np

from missions.flight_model import NEVER, find_vertical_legs

LINE_M = np.array([[0.0, 0.0, 15.0], [0.0, 0.0, 15.0], [0.0, 0.0, 15.0], [0.0, 0.0, 15.0]])
ON = np.array([False, True, False, True])


def test_a_way_between_two_lines_leads_up_and_down() -> None:
    ups, downs = find_vertical_legs(LINE_M, LINE_M + np.array([50.0, 0.0, 0.0]), ON, ON[::-1])
    assert ups.tolist() == [False, True, False, True]
    assert downs.tolist() == [True, False, True, False]


def test_a_vehicle_that_continues_along_the_line_stays_low() -> None:
    ups, downs = find_vertical_legs(
        LINE_M, LINE_M, np.array([False, True, False, True]), np.array([False, True, True, False])
    )
    assert ups.tolist() == [False, False, False, True]
    assert downs.tolist() == [False, False, True, False]


def test_in_layers_no_vehicle_climbs_or_descends() -> None:
    ups, downs = find_vertical_legs(LINE_M, LINE_M + 50.0, NEVER, NEVER)
    assert not ups.any()
    assert not downs.any()
