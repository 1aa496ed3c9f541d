"""A disarmed vehicle has landed or is down: every order, every line, and every change."""

from __future__ import annotations

import pytest

from executor.core.battery.account import BatteryState
from executor.core.interface.commands import AskStreams, Level, Say
from executor.core.interface.events import Tick
from executor.core.interface.messages import Attitude, Heartbeat
from executor.core.state.vehicle_parts import HomingOrder, ModeCause
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage
from tests.executor.core.steps import BATTERY_FAULT, HOMEWARD, LOW, STILL, TAKEN, Row, beat, landed, over_pad
from tests.executor.core.vehicles import DISARMED, NOW_S, ON_PAD, OUT_THERE, RTL, flying

ROWS = [
    Row(
        "who may fall still is not said where",
        flying(stage=Stage.DOWN, heartbeat=DISARMED, fix=STILL, disarmed_s=NOW_S - 2.9),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a landing on the pad",
        landed(),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing on the pad on the way home",
        landed(stage=Stage.RETURNING, heartbeat=beat(RTL, armed=False)),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing with somebody's hand on it, where nobody is asked before it flies again",
        landed(heartbeat=beat(0, armed=False)),
        Tick(),
        [Say(Level.WARNING, "uav1: landed with 90 %; mode STABILIZE: stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing of an unknown battery",
        landed(battery=BatteryState()),
        Tick(),
        [Say(Level.INFO, "uav1: landed")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing that was considered",
        landed(),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing of one with a fault",
        landed(stage=Stage.RETURNING, fault=BATTERY_FAULT),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {},
    ),
    Row(
        "a landing of one out of the plan",
        landed(stage=Stage.RETURNING, excluded=True),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {},
    ),
    Row(
        "a landing with battery to spare makes what was given up worth a try",
        landed(),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {
            "given_up": frozenset(),
            "urgent": True,
            "trigger": "uav1: landed with battery to spare",
            "trigger_s": NOW_S,
            "considered": frozenset({"uav1"}),
        },
        {"given_up": frozenset({3})},
    ),
    Row("a landing is not seen yet", landed(fix=over_pad(age_s=1.6)), Tick(), [], {}, {}),
    Row(
        "a landing is not waited for longer",
        landed(fix=over_pad(age_s=7.0), disarmed_s=NOW_S - 6.0),
        Tick(),
        [
            Say(Level.WARNING, "uav1: no position for 7 s, while other messages come"),
            AskStreams("uav1"),
            Say(Level.INFO, "uav1: landed with 90 %"),
        ],
        {"uav1": {"stage": Stage.LANDED, "streams_asked_s": NOW_S}},
        {"considered": frozenset({"uav1"}), "told": {"uav1": (("positions", NOW_S),)}},
    ),
    Row(
        "a landing whose last position is from before it",
        landed(fix=over_pad(age_s=1.0), disarmed_s=NOW_S - 1.4),
        Tick(),
        [],
        {},
        {},
    ),
    Row(
        "a landing whose last position is from before it and high",
        landed(stage=Stage.RETURNING, fix=over_pad(5.1, age_s=1.0), disarmed_s=NOW_S - 1.4),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: interruption, disarmed 5 m above its pad; last position {ON_PAD}, 5 m over its home, 1 s ago"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "disarmed 5 m above its pad", NOW_S, FaultCode.DISARMED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 5 m above its pad", "trigger_s": NOW_S},
    ),
    Row(
        "a landing by order on a hill is not seen yet",
        landed(stage=Stage.RETURNING, lands=True, fix=over_pad(5.1, age_s=1.0), disarmed_s=NOW_S - 1.4),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: interruption, disarmed 5 m above its pad; last position {ON_PAD}, 5 m over its home, 1 s ago"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "disarmed 5 m above its pad", NOW_S, FaultCode.DISARMED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 5 m above its pad", "trigger_s": NOW_S},
    ),
    Row(
        "a landing by order on a hill",
        landed(stage=Stage.RETURNING, lands=True, fix=over_pad(15.0)),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    f"uav1: interruption, disarmed 15 m above its pad; last position {ON_PAD}, 15 m "
                    "over its home, 0 s ago"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "disarmed 15 m above its pad", NOW_S, FaultCode.DISARMED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 15 m above its pad", "trigger_s": NOW_S},
    ),
    Row(
        "a landing by order that was none",
        landed(stage=Stage.RETURNING, lands=True, fix=over_pad(15.0, climbs_m_s=-2.0)),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    f"uav1: interruption, disarmed 15 m above its pad; last position {ON_PAD}, 15 m "
                    "over its home, 0 s ago"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "disarmed 15 m above its pad", NOW_S, FaultCode.DISARMED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 15 m above its pad", "trigger_s": NOW_S},
    ),
    Row(
        "a landing seen half a second after the disarming",
        landed(fix=over_pad(age_s=1.0), disarmed_s=NOW_S - 1.5),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a fall on the way home",
        landed(stage=Stage.RETURNING, fix=over_pad(climbs_m_s=-1.3)),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: interruption, disarmed 0 m above its pad; last position {ON_PAD}, 0 m over its home, 0 s ago"),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(FaultKind.INTERRUPTION, "disarmed 0 m above its pad", NOW_S, FaultCode.DISARMED),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 0 m above its pad", "trigger_s": NOW_S},
    ),
    Row(
        "a fall some seconds before the disarming",
        landed(stage=Stage.RETURNING, falls_s=NOW_S - 11.9),
        Tick(),
        [
            Say(
                Level.FAULT,
                (f"uav1: came down outside a landing; last position {ON_PAD}, 0 m over its home, 0 s ago"),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "anchor": LOW}},
        {},
    ),
    Row(
        "a fall long before the disarming",
        landed(stage=Stage.RETURNING, falls_s=NOW_S - 12.0),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "who lies on its back has not landed",
        landed(stage=Stage.RETURNING, tilted_since_s=NOW_S - 1.0, attitude=Attitude(170.0, 5.0)),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: came down outside a landing; leans by 170 degrees; last position 49.60014, "
                    "15.59947 (GPS not reported), 0 m over its home, 0 s ago"
                ),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "anchor": LOW}},
        {},
    ),
    Row(
        "who lies on its back in its pilot's hands has not landed",
        landed(
            stage=Stage.PILOT,
            taken=TAKEN,
            cause=ModeCause.PERSON,
            tilted_since_s=NOW_S - 1.0,
            attitude=Attitude(1.0, 95.0),
        ),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    f"uav1: disarmed with its pilot; leans by 95 degrees; last position {ON_PAD}, 0 m "
                    "over its home, 0 s ago"
                ),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: disarmed with its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "who disarms without a take-off has not landed",
        landed(took_off=False, away_once=False, waypoint=0, stage=Stage.RETURNING, falls_s=NOW_S),
        Tick(),
        [Say(Level.INFO, "uav1: disarmed; its take-off was not observed")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row(
        "a landing away from the pad on the way home",
        landed(stage=Stage.RETURNING, excluded=True, lands=True, fix=STILL),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, disarmed 300 m from its pad, 0 m high; last position 49.60014, "
                    "15.60362 (GPS not reported), 0 m over its home, 0 s ago"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "fault": Fault(
                    FaultKind.INTERRUPTION, "disarmed 300 m from its pad, 0 m high", NOW_S, FaultCode.DISARMED
                ),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 300 m from its pad, 0 m high", "trigger_s": NOW_S},
    ),
    Row(
        "a landing without a position",
        landed(stage=Stage.RETURNING, fix=None),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {"considered": frozenset({"uav1"})},
    ),
    Row("who was never armed has not landed", landed(stage=Stage.FLYING, armed_once=False), Tick(), [], {}, {}),
    Row(
        "a pilot's landing",
        landed(stage=Stage.PILOT, taken=TAKEN, cause=ModeCause.PERSON),
        Tick(),
        [Say(Level.INFO, "uav1: landed by its pilot; stays on the ground until included")],
        {"uav1": {"stage": Stage.LANDED, "excluded": True, "taken": None}},
        {"urgent": True, "trigger": "uav1: landed by its pilot", "trigger_s": NOW_S},
    ),
    Row(
        "who disarms off its pad on its mission",
        flying(heartbeat=DISARMED, disarmed_s=NOW_S - 2.0),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    "uav1: interruption, disarmed 300 m from its pad, 20 m high; last position 49.60014, "
                    "15.60362 (GPS not reported), 20 m over its home, 0 s ago"
                ),
            )
        ],
        {
            "uav1": {
                "stage": Stage.DOWN,
                "ordered_mode_s": NOW_S,
                "anchor": None,
                "fault": Fault(
                    FaultKind.INTERRUPTION, "disarmed 300 m from its pad, 20 m high", NOW_S, FaultCode.DISARMED
                ),
                "left_s": NOW_S,
            }
        },
        {"urgent": True, "trigger": "uav1: interruption, disarmed 300 m from its pad, 20 m high", "trigger_s": NOW_S},
    ),
    Row(
        "who disarms off its pad on its way home is down",
        flying(**HOMEWARD | {"heartbeat": DISARMED}, fault=BATTERY_FAULT, errand=HomingOrder(NOW_S)),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    f"uav1: disarmed 300 m from its pad, 20 m high; last position {OUT_THERE}, 20 m "
                    "over its home, 0 s ago"
                ),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "errand": None}},
        {},
    ),
    Row(
        "who disarms off its pad on its way home, and lay somewhere before",
        flying(**HOMEWARD | {"heartbeat": DISARMED}, fault=BATTERY_FAULT, place_told=True),
        Tick(),
        [
            Say(
                Level.FAULT,
                (
                    f"uav1: disarmed 300 m from its pad, 20 m high; last position {OUT_THERE}, 20 m "
                    "over its home, 0 s ago"
                ),
            )
        ],
        {"uav1": {"stage": Stage.DOWN, "place_told": False}},
        {},
    ),
    Row(
        "who disarms off its pad where it was told to land has landed",
        flying(**HOMEWARD | {"heartbeat": DISARMED}, fault=BATTERY_FAULT, lands=True, fix=STILL),
        Tick(),
        [Say(Level.FAULT, f"uav1: landed with 90 % away from its pad, down at {OUT_THERE}, disarmed")],
        {"uav1": {"stage": Stage.LANDED}},
        {},
    ),
    Row(
        "who lands with a fault that shows again has landed",
        landed(stage=Stage.RETURNING, fault=BATTERY_FAULT, heartbeat=Heartbeat(3, RTL, False, 8)),
        Tick(),
        [Say(Level.INFO, "uav1: landed with 90 %")],
        {"uav1": {"stage": Stage.LANDED}},
        {},
    ),
]


@pytest.mark.parametrize("row", ROWS, ids=[row.what for row in ROWS])
def test_everything_that_comes_of_it(row: Row) -> None:
    assert row.shows() == row.expected()
