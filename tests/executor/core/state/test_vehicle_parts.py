"""The initial values of the parts of a vehicle's state."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.battery.account import PercentRounding
from executor.core.battery.charge_counter import ChargeCounter
from executor.core.battery.cusum import Drift
from executor.core.battery.kalman import Prior
from executor.core.battery.voltage import VoltageState
from executor.core.interface.ports import LinkCounts
from executor.core.interface.recorded_log import SkippedRecords
from executor.core.state.fleet_state import Briefing, GroundStationAbsence
from executor.core.state.link_quality import LinkQuality
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import HomingOrder, Takeover, TextWindow
from executor.core.telemetry.vehicle_identity import AutopilotComponent
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the small parts",
        lambda: [
            flat(one)
            for one in (
                VoltageState(),
                LinkQuality(),
                PercentRounding(),
                MissionOwnership(),
                Drift(),
                ChargeCounter(),
                TextWindow(),
                HomingOrder(5.0),
                Takeover(5.0),
                Prior(),
                GroundStationAbsence(5.0, 5.0, restarted=True),
                Briefing(),
                SkippedRecords(),
                AutopilotComponent(),
                LinkCounts(),
            )
        ],
        [
            {
                "reported_s": -math.inf,
                "voltage_v": None,
                "highest_v": 0.0,
                "began_s": None,
                "usual_v": None,
                "usual_a": None,
                "usual_ohm": None,
                "expected_v": None,
                "drop": 0.0,
                "dropped_s": None,
                "known_load": False,
                "low_since_s": None,
                "cells_v": (),
                "set_cells": None,
                "spread_since_s": None,
            },
            {
                "window": (),
                "lost": None,
                "usual": None,
                "radio": None,
                "radio_s": -math.inf,
                "counted": (),
                "round_trip_s": None,
                "round_trip_at_s": -math.inf,
                "least_round_trip_s": math.inf,
            },
            {"rounded": 0.0, "rounded_s": -math.inf, "ceiled": 0.0, "ceiled_s": -math.inf},
            {
                "ours_s": -math.inf,
                "id": None,
                "foreign_s": None,
                "words": "",
                "told_s": None,
                "asked_s": None,
                "read_s": -math.inf,
                "by_items": False,
            },
            {
                "excess_pct": 0.0,
                "used_pct": 0.0,
                "expected_pct": 0.0,
                "since_s": None,
                "reports": 0,
                "jumped_s": -math.inf,
                "jumped_pct": 0.0,
                "biggest_pct": 0.0,
            },
            {
                "consumed_ah": None,
                "at_s": 0.0,
                "modelled_pct": 0.0,
                "began_ah": 0.0,
                "first": None,
                "last": None,
                "capacity_ah": None,
                "began_s": 0.0,
                "set_ah": None,
                "mark": None,
                "per_pct_ah": None,
                "follows": True,
                "drift": Drift(),
            },
            {"last": ("", -math.inf), "since_s": -math.inf, "shown": (0, 0, 0), "passed_over": 0},
            {"since_s": 5.0, "land": False, "told": False, "not_before_s": -math.inf, "force": False},
            {"since_s": 5.0, "given_away": False, "returned_s": None},
            {"factor": 1.0, "sd": 0.12, "slack": 0.0},
            {"until_s": 5.0, "pause_s": 5.0, "restarted": True, "deaf": False},
            {"checks": (), "question": None, "answered": ""},
            {
                "garbage_runs": 0,
                "bad_checksums": 0,
                "truncated": 0,
                "unreadable": 0,
                "impossible": 0,
                "time_back": 0,
                "gaps": 0,
                "dropouts": 0,
                "before_heartbeat": 0,
                "not_followed": 0,
            },
            {"component": 1, "heard": False},
            {"received": 0, "missing": 0, "foreign": 0, "refused": {}, "strangers": {}, "by_connection": {}},
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
