"""What the checks before a flight say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.codes import Check
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import DoubleHeard, Position, StationHeard, Version
from executor.core.preflight import vehicle_checks as checks
from executor.core.preflight.onboard_failsafes import LinkFailsafe
from executor.core.preflight.vehicle_checks import VehicleFacts
from missions import ARDUPILOT, PX4
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import DISARMED, FLEET, flying

CONTEXT = FLEET.context
PLACE = Position(5.0, 49.6, 15.6, 450.0, 0.0, 0.0, 0.0, 0.0, None)
FACTS = VehicleFacts("uav1", replace(DISARMED, vehicle_type=2), PLACE, 95.0, Version(4, 7, 0), {})
BOARD = flying().assignment.board
assert BOARD is not None
PATH = BOARD.path
FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 80.0, "FENCE_RADIUS": 900.0}
LOW = {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1000.0, "BATT_CAPACITY": 5000.0, "BATT_FS_CRT_ACT": 0.0}


def lines(checks: Check | Sequence[Check]) -> list[str]:
    return [f"{one.severity.value}: {one.text}" for one in ([checks] if isinstance(checks, Check) else checks)]


def stood(**pad: Any) -> list[str]:
    """Return what is said of the height of a pad, so far from the depot's."""
    pads = tuple(replace(one, **pad) if one.vehicle == "uav1" else one for one in CONTEXT.setup.pads)
    return lines(checks.check_pad_height(replace(CONTEXT, setup=replace(CONTEXT.setup, pads=pads)), FACTS))


NOBODYS = "warning: whose HEARTBEATs its GCS failsafe watches is not known: it has no MAV_GCS_SYSID or SYSID_MYGCS"
OTHER = "another ground station is on its link, system {} component 190"

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "vehicle identity",
        lambda: [
            lines(checks.check_identity(replace(FACTS, **given), ARDUPILOT, place_m))
            for given, place_m in (
                ({}, (3.0, 4.0)),
                ({"version": None}, (0.0, 0.0)),
                ({"version": Version(4, 5, 9)}, (0.0, 0.0)),
                ({"version": Version(4, 6, 0)}, (0.0, 0.0)),
                ({"version": Version(4, 8, 0)}, (0.0, 0.0)),
                ({"heartbeat": replace(FACTS.heartbeat, armed=True)}, (0.0, 0.0)),
                ({"heartbeat": replace(FACTS.heartbeat, vehicle_type=1)}, (0.0, 0.0)),
                ({"heartbeat": replace(FACTS.heartbeat, autopilot=12)}, (0.0, 0.0)),
                ({"doubles": (DoubleHeard(1, ("a", "b")),)}, (0.0, 0.0)),
                ({}, (120.0, 160.0)),
                ({}, (120.0, 160.1)),
            )
        ],
        [
            ["ok: quadrotor, ArduPilot 4.7.0"],
            [("warning: quadrotor, ArduPilot of unknown version; faultline is tested with Copter 4.7-dev")],
            [("warning: quadrotor, ArduPilot 4.5.9, which is older than 4.6; faultline is tested with Copter 4.7-dev")],
            ["ok: quadrotor, ArduPilot 4.6.0"],
            [
                (
                    "warning: quadrotor, ArduPilot 4.8.0, newer than 4.7: what its parameters mean may have changed; "
                    "faultline is tested with Copter 4.7-dev"
                )
            ],
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: already armed, expected a disarmed vehicle on its pad"],
            [
                "ok: fixed wing, ArduPilot 4.7.0",
                "stop: HEARTBEAT type is fixed wing, expected a multicopter",
            ],
            ["ok: quadrotor, PX4 4.7.0", "stop: HEARTBEAT autopilot is 12, expected ardupilot (3)"],
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: sysid 1 is used at a and b: duplicate system id"],
            ["ok: quadrotor, ArduPilot 4.7.0"],
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: stands 200 m from the depot, expected at most 200 m"],
        ],
    ),
    (
        "vehicle identity of PX4",
        lambda: lines(
            checks.check_identity(
                replace(FACTS, heartbeat=replace(FACTS.heartbeat, autopilot=12), version=Version(1, 10, 0)),
                PX4,
                (0.0, 0.0),
            )
        ),
        [("warning: quadrotor, PX4 1.10.0, which is older than 1.15; faultline is tested with PX4 1.17.0")],
    ),
    (
        "height of its pad",
        lambda: [
            stood(east_m=0.0, north_m=0.0, alt_m=CONTEXT.frame.alt_m + off_m)
            for off_m in (0.0, 7.0, 9.9, -7.0, -9.9, -14.9, -15.1)
        ],
        [
            [],
            [
                (
                    "warning: its pad is 457 m above sea level by its GPS, the depot 450 m: its flight is 7 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "warning: its pad is 460 m above sea level by its GPS, the depot 450 m: its flight is 10 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "warning: its pad is 443 m above sea level by its GPS, the depot 450 m: its flight is 7 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "warning: its pad is 440 m above sea level by its GPS, the depot 450 m: its flight is 10 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "warning: its pad is 435 m above sea level by its GPS, the depot 450 m: its flight is 15 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "stop: its pad is 435 m above sea level by its GPS, the depot 450 m: expected "
                    "depot.alt_m and GPS to agree"
                )
            ],
        ],
    ),
    (
        "height of a distant pad",
        lambda: [stood(east_m=30.0, north_m=40.0, alt_m=CONTEXT.frame.alt_m + off_m) for off_m in (-29.9, -30.1)],
        [
            [
                (
                    "warning: its pad is 420 m above sea level by its GPS, the depot 450 m: its flight is 30 "
                    "m off if they do not agree"
                )
            ],
            [
                (
                    "stop: its pad is 420 m above sea level by its GPS, the depot 450 m: expected "
                    "depot.alt_m and GPS to agree"
                )
            ],
        ],
    ),
    (
        "link time-out",
        lambda: [
            lines(
                checks.check_link_failsafe(
                    FACTS, LinkFailsafe(acts, 5.0, "words"), waited_s=waited_s, wanted_s=wanted_s
                )
            )
            for acts, waited_s, wanted_s in (
                (True, 10.0, None),
                (False, 10.0, None),
                (None, 10.0, 10.0),
                (True, 10.1, 10.0),
            )
        ],
        [
            ["ok: words; declared lost after 10 s"],
            ["warning: words; declared lost after 10 s"],
            ["warning: words; declared lost after 10 s"],
            [
                (
                    "warning: words; faults.link_timeout_s 10 is shorter, and its segments would be "
                    "reassigned while it still flies them: declared lost after 10.1 s instead"
                )
            ],
        ],
    ),
    (
        "stations whose HEARTBEATs it waits for",
        lambda: [
            lines(checks.check_ground_stations(replace(FACTS, parameters=parameters_, stations=others), ARDUPILOT))
            for parameters_, others in (
                ({}, ()),
                ({"SYSID_MYGCS": 255.0}, ()),
                ({"SYSID_MYGCS": 254.0}, ()),
                ({}, (StationHeard(3, 190),)),
                ({"SYSID_MYGCS": 255.0}, (StationHeard(3, 190), StationHeard(255, 190))),
            )
        ],
        [
            [NOBODYS],
            [],
            [
                (
                    "warning: its GCS failsafe watches system 254 (SYSID_MYGCS), ours is 255: it will not act when "
                    "we are lost; set SYSID_MYGCS to 255, or link.station_sysid to 254"
                )
            ],
            [
                NOBODYS,
                f"warning: {OTHER.format(3)}: its HEARTBEATs would hide the loss of ours",
            ],
            [
                f"warning: {OTHER.format(3)}: it may command the vehicle too",
                (
                    f"warning: {OTHER.format(255)}: its HEARTBEATs would hide the loss of ours; it has our number: "
                    "set link.station_sysid to another, such as 254"
                ),
            ],
        ],
    ),
    (
        "action on a low battery",
        lambda: [
            lines(checks.check_battery_failsafe_settings(replace(FACTS, parameters=parameters_), ARDUPILOT, left_pct))
            for parameters_, left_pct in (
                ({}, 50.0),
                ({"BATT_FS_LOW_ACT": 0.0}, 50.0),
                ({"BATT_FS_LOW_ACT": 0.0, "BATT_FS_CRT_ACT": 0.0}, 50.0),
                (LOW, 50.0),
                (LOW, 20.1),
                (LOW, 20.0),
                (LOW, None),
                (LOW | {"BATT_CAPACITY": 0.0}, 10.0),
            )
        ],
        [
            ["warning: battery failsafe not known (BATT_FS_LOW_ACT, BATT_FS_CRT_ACT)"],
            ["warning: battery failsafe not known (BATT_FS_LOW_ACT=0, BATT_FS_CRT_ACT)"],
            [
                (
                    "warning: no battery failsafe (BATT_FS_LOW_ACT=0, BATT_FS_CRT_ACT=0): on an empty"
                    " battery it keeps flying until it falls"
                )
            ],
            ["ok: battery failsafe: RTL below 20 % (BATT_FS_LOW_ACT=2)"],
            ["ok: battery failsafe: RTL below 20 % (BATT_FS_LOW_ACT=2)"],
            [
                "ok: battery failsafe: RTL below 20 % (BATT_FS_LOW_ACT=2)",
                (
                    "warning: battery failsafe: RTL below 20 % (BATT_FS_LOW_ACT=2), but its flight "
                    "ends with 20 %: it would act in flight"
                ),
            ],
            ["ok: battery failsafe: RTL below 20 % (BATT_FS_LOW_ACT=2)"],
            ["ok: battery failsafe: RTL below 1000 mAh (BATT_FS_LOW_ACT=2)"],
        ],
    ),
    (
        "its fence",
        lambda: [
            lines(checks.check_own_geofence(CONTEXT, replace(FACTS, parameters=parameters_), path))
            for parameters_ in (
                {},
                FENCE,
                FENCE | {"FENCE_ALT_MAX": 10.0},
                FENCE | {"FENCE_RADIUS": 339.0},
                FENCE | {"FENCE_RADIUS": 300.0, "FENCE_ALT_MAX": 10.0},
                FENCE | {"FENCE_TYPE": 1.0, "FENCE_RADIUS": 30.0},
            )
            for path in (PATH, None)
        ],
        [
            [],
            [],
            ["ok: its flight fits into the cylinder of its own geofence"],
            ["ok: its flight fits into the cylinder of its own geofence"],
            ["warning: its geofence ends 10 m high (FENCE_ALT_MAX), but its flight goes 15 m high"],
            ["warning: its geofence ends 10 m high (FENCE_ALT_MAX), but its flight goes 15 m high"],
            [
                (
                    "warning: its geofence ends 339 m away from home (FENCE_RADIUS), but its flight goes 339 "
                    "m away from home"
                )
            ],
            ["ok: its flight fits into the cylinder of its own geofence"],
            [
                "warning: its geofence ends 10 m high (FENCE_ALT_MAX), but its flight goes 15 m high",
                (
                    "warning: its geofence ends 300 m away from home (FENCE_RADIUS), but its flight goes 339 "
                    "m away from home"
                ),
            ],
            ["warning: its geofence ends 10 m high (FENCE_ALT_MAX), but its flight goes 15 m high"],
            ["ok: its flight fits into the cylinder of its own geofence"],
            ["ok: its flight fits into the cylinder of its own geofence"],
        ],
    ),
    (
        "charge left after the flight",
        lambda: 50.0 - checks.estimate_flight(CONTEXT, PATH).energy_pct,
        43.1177,
    ),
    (
        "whether its battery is enough",
        lambda: [
            lines(checks.check_energy(CONTEXT, "uav1", path, percent))
            for path, percent in ((None, 80.0), (PATH, 80.0), (PATH, 18.0), (PATH, 22.0))
        ],
        [
            ["ok: stays on the ground as a spare, battery 80 %"],
            ["ok: battery 80 %, flight 3.2 min and 7 %, lands with 73 %"],
            [("stop: battery 18 %, flight 3.2 min and 7 %, lands with 11 %, expected at least the reserve of 15 %")],
            ["ok: battery 22 %, flight 3.2 min and 7 %, lands with 15 %"],
        ],
    ),
    (
        "signing of connections",
        lambda: [
            lines(checks.check_signing({name: [parse_connection(text)] for name, text in connections}, signed=signed))
            for connections, signed in (
                ((("uav1", "udpin://0.0.0.0:14550"),), True),
                ((("uav1", "udpin://0.0.0.0:14550"),), False),
                ((("uav1", "udpin://0.0.0.0:14550"), ("uav2", "tcpout://10.0.0.3:5760")), False),
                ((("uav1", "serial:///dev/ttyUSB0:57600"),), False),
                ((("uav1", "udpin://127.0.0.1:14550"),), False),
            )
        ],
        [
            ["ok: frames are signed; frames not signed with our key are rejected"],
            [
                (
                    "warning: frames are not signed, and uav1 is reached over a network: any sender "
                    "there can command and imitate the vehicles"
                )
            ],
            [
                (
                    "warning: frames are not signed, and uav1, uav2 are reached over a network: any "
                    "sender there can command and imitate the vehicles"
                )
            ],
            [("ok: frames are not signed; a radio like ours on the same channel could command the vehicles")],
            ["ok: frames are not signed; no link leaves here"],
        ],
    ),
    (
        "whether there is room",
        lambda: [
            lines(checks.check_disk_space(free, {"uav1": PATH}, CONTEXT))
            for free in (10**9, 1_500_000, 1_450_000, 1_400_000, 10)
        ],
        [
            ["ok: 1.0 GB free, the record of a flight like this takes about 0 MB"],
            ["warning: 0.0 GB free, the record of a flight like this takes about 0 MB: it may not fit"],
            ["warning: 0.0 GB free, the record of a flight like this takes about 0 MB: it may not fit"],
            ["warning: 0.0 GB free, the record of a flight like this takes about 0 MB: it may not fit"],
            ["warning: 0.0 GB free, the record of a flight like this takes about 0 MB: it may not fit"],
        ],
    ),
    (
        "whether anybody is near another",
        lambda: [
            lines(
                checks.check_layer_separation(
                    [PATH, replace(PATH, vehicle="uav2")], layer_m, {"uav1": 450.0, "uav2": alt_m}
                )
            )
            for layer_m, alt_m in ((5.0, 450.0), (5.0, 490.0))
        ],
        [
            [("stop: uav1 on leg 0 (takeoff) and uav2 on leg 0 (takeoff) come within 0.00 m, 5 m expected")],
            ["ok: any two vehicles stay at least 5 m apart"],
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
