"""What is taken to be so of a vehicle before anything was heard."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.load_voltage import VoltageState
from executor.core.battery.pack_condition import PackState
from executor.core.battery.percent_rounding import PercentRounding
from executor.core.payload.camera_state import PayloadState
from executor.core.state.duplicate_ids import DuplicateIdWatch
from executor.core.state.link_quality import LinkQuality
from executor.core.state.mission_ownership import MissionOwnership
from executor.core.state.vehicle_parts import ModeCause, Positioning, TextWindow
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a vehicle",
        lambda: flat(VehicleState("uav1")),
        {
            "name": "uav1",
            "stage": Stage.GROUND,
            "heard_s": None,
            "spoke_s": None,
            "heartbeat": None,
            "mode_since_s": 0.0,
            "mode_before_s": None,
            "mode_before": None,
            "critical_since_s": None,
            "ordered_mode_s": -math.inf,
            "gives_way": None,
            "gave_way_s": -math.inf,
            "armed_once": False,
            "disarmed_s": -math.inf,
            "fix": None,
            "anchor": None,
            "last_fix": None,
            "others_orders": (),
            "channels_us": (),
            "channels_s": -math.inf,
            "switched": (),
            "mode_channel": None,
            "throttle_lost_us": None,
            "recorded": (None, -math.inf),
            "critical_s": -math.inf,
            "failed": (),
            "on_ground": None,
            "battery": BatteryState(),
            "packs": (),
            "roundings": PercentRounding(),
            "board": None,
            "waypoint": 0,
            "run": None,
            "run_visit": None,
            "runs_broken": (),
            "watches": (),
            "label": "",
            "swaps": 0,
            "overstated_pct": 0.0,
            "asked_s": None,
            "intent": "",
            "ready_s": None,
            "ahead": (),
            "beyond": frozenset(),
            "sorties": (),
            "stale": False,
            "fault": None,
            "fence": None,
            "payload": PayloadState(),
            "pending": None,
            "stubborn": False,
            "failures": 0,
            "texts": TextWindow(),
            "took_off": False,
            "alarm": ("", -math.inf),
            "heartbeat_s": None,
            "quality": LinkQuality(),
            "volts": VoltageState(),
            "battery_faults": 0,
            "pack": PackState(),
            "told_s": -math.inf,
            "unhealthy": 0,
            "item": None,
            "item_s": None,
            "start_owed_s": None,
            "start_let_go": False,
            "streams_asked_s": -math.inf,
            "excused_s": -math.inf,
            "flew_mission": False,
            "jump": (0.0, -math.inf),
            "strangers": frozenset(),
            "learned": None,
            "before": None,
            "fix_waypoint": None,
            "declined": None,
            "held_s": None,
            "hold_asked_s": -math.inf,
            "excluded": False,
            "base_closed": False,
            "lands": False,
            "began_pct": None,
            "gps": None,
            "positioning": Positioning(),
            "twins": DuplicateIdWatch(),
            "wind": None,
            "attitude": None,
            "tilted_since_s": None,
            "fence_breached": False,
            "breached_s": float("-inf"),
            "passed": (),
            "aloft_pct": None,
            "climbs_m_s": 0.0,
            "sinks_s": float("-inf"),
            "drops_s": float("-inf"),
            "listed": (),
            "leads_to": None,
            "came_from": None,
            "leg_from": None,
            "below_m": 0.0,
            "below_s": float("-inf"),
            "ordered_modes": frozenset(),
            "cause": ModeCause.OURS,
            "certain": False,
            "regained_s": None,
            "unseen_until_s": None,
            "unseen_from_boot_s": None,
            "beat_boot_s": None,
            "taken": None,
            "errand": None,
            "cleared_s": None,
            "rebooted_s": None,
            "away_once": False,
            "place_told": False,
            "left_s": None,
            "falls_s": -math.inf,
            "behind_s": 0.0,
            "fell_back_s": -math.inf,
            "reopened": False,
            "doubted": None,
            "carried": MissionOwnership(),
            "sent_path": None,
            "owed": None,
            "leg_began": None,
            "flown": (),
        },
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
