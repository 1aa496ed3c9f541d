"""Everything that the page shows of each vehicle, from states that are made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest

from executor.core import fleet_view
from executor.core.battery.account import BatteryState
from executor.core.fleet_view import (
    BatteryView,
    LossView,
    PositionView,
    ProgressView,
    TakenView,
)
from executor.core.interface.messages import Gps, Wind
from executor.core.state.fleet_state import LossOutlook, TakeoffOffer
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_parts import ModeCause, Takeover
from executor.core.state.vehicle_state import FaultCode, Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    HOLD,
    TAKEN,
    Changes,
    beat,
    flight_of,
    over_pad,
    rounded,
)
from tests.executor.core.vehicles import DISARMED, FLEET, NOW_S, at, flying

CONTEXT = FLEET.context
PILOTS = flying(stage=Stage.PILOT, heartbeat=beat(HOLD), cause=ModeCause.PERSON, taken=TAKEN)
OPEN = TakeoffOffer(("uav1",), (0, 2), 5.0)


def seen(one: VehicleState, *names: str, **given: Any) -> Changes:
    """Return what is shown of uav1, all of it or only some."""
    found = fleet_view.build_fleet_view(CONTEXT, flight_of(one, **given), NOW_S).vehicles[0]
    return {one.name: getattr(found, one.name) for one in fields(found) if not names or one.name in names}


def progress(**given: Any) -> Any:
    return seen(flying(**given), "progress")["progress"]


def battery_of(**given: Any) -> object:
    return seen(flying(**given), "battery")["battery"]


def placed(**given: Any) -> object:
    return seen(flying(fix=replace(at(), **given)), "position")["position"]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a vehicle",
        lambda: seen(flying()),
        {
            "name": "uav1",
            "sysid": 1,
            "state": "flying",
            "mode": "MISSION",
            "armed": True,
            "layer": 0,
            "layer_m": 0.0,
            "position": PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=90.0, ground_speed_m_s=3.0, age_s=0.0
            ),
            "battery": BatteryView(
                measured_pct=90.0,
                predicted_pct=88.2,
                predicted_band_pct=0.5,
                to_finish_pct=5.0,
                landing_pct=84.9,
                landing_band_pct=2.5,
                reserve_pct=15.0,
            ),
            "link_age_s": 0.0,
            "link_loss": None,
            "links": (),
            "stale": False,
            "progress": ProgressView(
                done=0, total=2, segment=0, segment_name="segment 0", phase="inspect", segment_share=1.0
            ),
            "fault": None,
            "fault_kind": None,
            "fault_code": None,
            "excluded": False,
            "loss": None,
            "lands_in_s": 140.0,
            "gps_fix": None,
            "satellites": None,
            "voltage_v": 15.0,
            "wind": None,
            "taken": None,
            "offered": False,
            "turn": None,
        },
    ),
    (
        "a vehicle of which much is known",
        lambda: seen(
            flying(
                heard_s=NOW_S - 2.96,
                gps=Gps(3, 12),
                wind=Wind(4.0, 90.0),
                quality=LinkQuality(lost=0.12345),
                stale=True,
                excluded=True,
                fault=BATTERY_FAULT,
            ),
            outlook={"uav1": LossOutlook(NOW_S - 5.04, (3,))},
            inspected={0: "uav1", 1: "uav2", 2: "uav1"},
            offer=OPEN,
        ),
        {
            "name": "uav1",
            "sysid": 1,
            "state": "flying",
            "mode": "MISSION",
            "armed": True,
            "layer": 0,
            "layer_m": 0.0,
            "position": PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=90.0, ground_speed_m_s=3.0, age_s=0.0
            ),
            "battery": BatteryView(
                measured_pct=90.0,
                predicted_pct=88.2,
                predicted_band_pct=0.5,
                to_finish_pct=5.0,
                landing_pct=84.9,
                landing_band_pct=2.5,
                reserve_pct=15.0,
            ),
            "link_age_s": 3.0,
            "link_loss": 0.123,
            "links": (),
            "stale": True,
            "progress": ProgressView(
                done=0, total=2, segment=0, segment_name="segment 0", phase="inspect", segment_share=1.0, inspected=2
            ),
            "fault": "why",
            "fault_kind": "battery",
            "fault_code": FaultCode.BATTERY_LOW,
            "excluded": True,
            "loss": None,
            "lands_in_s": 140.0,
            "gps_fix": 3,
            "satellites": 12,
            "voltage_v": 15.0,
            "wind": Wind(speed_m_s=4.0, from_deg=90.0),
            "taken": None,
            "offered": True,
            "turn": None,
        },
    ),
    (
        "effect of its loss",
        lambda: [
            seen(flying(**given), "loss", outlook={"uav1": LossOutlook(NOW_S - 5.04, uncovered)})["loss"]
            for given in ({}, {"stage": Stage.STARTING}, {"stage": Stage.RETURNING}, {"fault": BATTERY_FAULT})
            for uncovered in ((), (3,))
        ],
        [
            LossView(inside_window=True, uncovered=(), age_s=5.0),
            LossView(inside_window=False, uncovered=(3,), age_s=5.0),
            LossView(inside_window=True, uncovered=(), age_s=5.0),
            LossView(inside_window=False, uncovered=(3,), age_s=5.0),
            None,
            None,
            None,
            None,
        ],
    ),
    (
        "time with its pilot",
        lambda: [
            seen(with_facts(PILOTS, taken=taken), "taken")["taken"]
            for taken in (
                TAKEN,
                Takeover(NOW_S - 40.0),
                Takeover(NOW_S - 10.0, given_away=True),
                Takeover(NOW_S - 10.006, returned_s=5.0),
                None,
            )
        ],
        [
            TakenView(since_s=NOW_S - 10.0, kept_s=20.0, returned=False),
            TakenView(since_s=NOW_S - 40.0, kept_s=0.0, returned=False),
            TakenView(since_s=NOW_S - 10.0, kept_s=0.0, returned=False),
            TakenView(since_s=NOW_S - 10.01, kept_s=20.0, returned=True),
            None,
        ],
    ),
    (
        "time of its landing",
        lambda: [
            seen(flying(**given), "lands_in_s")["lands_in_s"]
            for given in ({}, {"waypoint": 5}, {"held_s": 5.0}, {"stage": Stage.RETURNING}, {"board": None})
        ],
        [140.0, 28.0, None, None, None],
    ),
    (
        "its activity",
        lambda: [
            seen(flying(**given), "state")["state"]
            for given in (
                {},
                {"held_s": 5.0},
                {"held_s": 5.0, "heartbeat": beat(HOLD)},
                {"heartbeat": beat(HOLD)},
                {"lands": True},
                {"lands": True, "stage": Stage.RETURNING},
                {"stage": Stage.RETURNING},
                {"held_s": 5.0, "heartbeat": None},
            )
        ],
        ["flying", "flying", "holding", "flying", "flying", "landing", "returning", "flying"],
    ),
    (
        "its position",
        lambda: [
            placed(**given)
            for given in (
                {},
                {"heading_deg": 270.4},
                {"velocity_m_s": (0.0, 0.5, 0.0)},
                {"velocity_m_s": (-0.6, 0.0, 0.0)},
                {"velocity_m_s": (3.0, 4.0, 9.0)},
                {"alt_rel_m": 20.06, "at_s": NOW_S - 1.26},
                {"at_s": NOW_S + 5.0},
            )
        ],
        [
            PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=90.0, ground_speed_m_s=3.0, age_s=0.0
            ),
            PositionView(
                lat_deg=49.6001,
                lon_deg=15.6036,
                relative_alt_m=20.0,
                heading_deg=270.0,
                ground_speed_m_s=3.0,
                age_s=0.0,
            ),
            PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=None, ground_speed_m_s=0.5, age_s=0.0
            ),
            PositionView(
                lat_deg=49.6001,
                lon_deg=15.6036,
                relative_alt_m=20.0,
                heading_deg=270.0,
                ground_speed_m_s=0.6,
                age_s=0.0,
            ),
            PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=37.0, ground_speed_m_s=5.0, age_s=0.0
            ),
            PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.1, heading_deg=90.0, ground_speed_m_s=3.0, age_s=1.3
            ),
            PositionView(
                lat_deg=49.6001, lon_deg=15.6036, relative_alt_m=20.0, heading_deg=90.0, ground_speed_m_s=3.0, age_s=0.0
            ),
        ],
    ),
    (
        "its battery",
        lambda: [
            battery_of(**given)
            for given in (
                {},
                {"began_pct": 95.0},
                {"waypoint": 5, "fix": over_pad(10.0)},
                {"board": None},
                {"stage": Stage.RETURNING},
                {"stage": Stage.LANDED},
                {"stage": Stage.STARTING},
                {"stage": Stage.STARTING, "heartbeat": DISARMED},
                {"battery": BatteryState()},
            )
        ],
        [
            BatteryView(
                measured_pct=90.0,
                predicted_pct=88.2,
                predicted_band_pct=0.5,
                to_finish_pct=5.0,
                landing_pct=84.9,
                landing_band_pct=2.5,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=93.2,
                predicted_band_pct=0.5,
                to_finish_pct=5.0,
                landing_pct=84.9,
                landing_band_pct=2.5,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=83.8,
                predicted_band_pct=1.2,
                to_finish_pct=0.7,
                landing_pct=89.3,
                landing_band_pct=2.3,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=None,
                predicted_band_pct=None,
                to_finish_pct=0.0,
                landing_pct=87.3,
                landing_band_pct=2.4,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=88.2,
                predicted_band_pct=0.5,
                to_finish_pct=2.7,
                landing_pct=87.3,
                landing_band_pct=2.4,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=None,
                predicted_band_pct=None,
                to_finish_pct=0.0,
                landing_pct=None,
                landing_band_pct=None,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=88.2,
                predicted_band_pct=0.5,
                to_finish_pct=5.0,
                landing_pct=84.9,
                landing_band_pct=2.5,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=90.0,
                predicted_pct=None,
                predicted_band_pct=None,
                to_finish_pct=0.0,
                landing_pct=None,
                landing_band_pct=None,
                reserve_pct=15.0,
            ),
            BatteryView(
                measured_pct=None,
                predicted_pct=None,
                predicted_band_pct=None,
                to_finish_pct=5.0,
                landing_pct=None,
                landing_band_pct=None,
                reserve_pct=15.0,
            ),
        ],
    ),
    (
        "its progress in the air",
        lambda: [
            progress(**given)
            for given in (
                {},
                {"waypoint": 0},
                {"waypoint": 1},
                {"waypoint": 3},
                {"waypoint": 4},
                {"waypoint": 5},
                {"waypoint": 6},
                {"board": None},
            )
        ],
        [
            ProgressView(done=0, total=2, segment=0, segment_name="segment 0", phase="inspect", segment_share=1.0),
            ProgressView(done=0, total=2, phase="takeoff"),
            ProgressView(done=0, total=2, segment=0, segment_name="segment 0", phase="transit", segment_share=0.0),
            ProgressView(done=1, total=2, segment=1, segment_name="segment 1", phase="inspect", segment_share=0.615),
            ProgressView(done=2, total=2, phase="return"),
            ProgressView(done=2, total=2, phase="land"),
            ProgressView(done=2, total=2),
            ProgressView(done=0, total=0),
        ],
    ),
    (
        "its progress on a segment",
        lambda: [
            progress(fix=fix, waypoint=2).segment_share
            for fix in (
                None,
                replace(at(), place_m=(90.0, -5.0)),
                replace(at(), place_m=(125.0, -5.0)),
                replace(at(), place_m=(210.0, -5.0)),
            )
        ],
        [0.0, 0.0, 0.25, 1.0],
    ),
    (
        "its progress on the ground, and on its way home",
        lambda: [
            progress(stage=stage, waypoint=3, lands=lands)
            for stage in (Stage.GROUND, Stage.STARTING, Stage.LANDED, Stage.DOWN, Stage.RETURNING, Stage.LOST)
            for lands in (False, True)
        ],
        [
            ProgressView(done=0, total=2),
            ProgressView(done=0, total=2),
            ProgressView(done=1, total=2, segment=1, segment_name="segment 1", phase="inspect", segment_share=0.615),
            ProgressView(done=1, total=2, segment=1, segment_name="segment 1", phase="inspect", segment_share=0.615),
            ProgressView(done=1, total=2),
            ProgressView(done=1, total=2),
            ProgressView(done=1, total=2),
            ProgressView(done=1, total=2),
            ProgressView(done=1, total=2, phase="return"),
            ProgressView(done=1, total=2, phase="land"),
            ProgressView(done=1, total=2),
            ProgressView(done=1, total=2),
        ],
    ),
    (
        "its progress before it has armed",
        lambda: [progress(stage=Stage.STARTING, waypoint=3, heartbeat=DISARMED)],
        [ProgressView(done=0, total=2)],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
