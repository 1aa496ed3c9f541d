"""What the checks before a flight say, what is set for it, and how much of what vehicles say is shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from executor.core.commands import Command, Say
from executor.core.connection import parse_connection
from executor.core.context import Context
from executor.core.hearing import texts
from executor.core.messages import ComponentText, DoubleHeard, ParamValue, Position, StationHeard, StatusText, Version
from executor.core.parts import TextFlow
from executor.core.preflight import checks, parameters
from executor.core.preflight.checks import (
    Check,
    Facts,
)
from executor.core.preflight.failsafes import LinkFailsafe
from executor.core.preflight.parameters import (
    Change,
    Kept,
)
from missions import ARDUPILOT, PX4, Pad
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.faults.test_watchpoints import DISARMED, FLEET, NOW_S, flying
from tests.executor.core.steps import flight_of, rounded

CONTEXT = FLEET.context
UNEVEN = fleet_of(autopilot="px4").context
PLACE = Position(5.0, 49.6, 15.6, 450.0, 0.0, 0.0, 0.0, 0.0, None)
FACTS = Facts("uav1", replace(DISARMED, vehicle_type=2), PLACE, 95.0, Version(4, 7, 0), {})
BOARD = flying().assignment.board
assert BOARD is not None
PATH = BOARD.path
FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 80.0, "FENCE_RADIUS": 900.0}
LOW = {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1000.0, "BATT_CAPACITY": 5000.0, "BATT_FS_CRT_ACT": 0.0}
CHANGE = Change("uav1", "RTL_ALT", 3000.0, 1500.0, 4, "cm", "why")
KEPT = Kept("uav1", 1, "ardupilot", "RTL_ALT", 3000.0, 1500.0, 4, "cm", "why")


def lines(checks: Check | Sequence[Check]) -> list[str]:
    return [f"{one.severity.value}: {one.text}" for one in ([checks] if isinstance(checks, Check) else checks)]


def known(**values: float) -> Mapping[str, ParamValue]:
    return {name: ParamValue(name, value, 9 if name.endswith("_M") else 4) for name, value in values.items()}


def proposed(
    said: Mapping[str, ParamValue], name: str = "uav1", context: Context = CONTEXT, ceiling_m: float | None = None
) -> list[str]:
    found = parameters.propose(context, {name: said}, ceiling_m=ceiling_m)
    return [one.words for one in found.changes] + lines(found.checks)


def settled(ends: Mapping[str, str], said: Mapping[str, ParamValue]) -> list[str]:
    found = parameters.propose(CONTEXT, {"uav1": said})
    return lines(parameters.return_heights(CONTEXT, "uav1", found, ends))


def stood(**pad: Any) -> list[str]:
    """Return what is said of the height of a pad, so far from the depot's."""
    pads = tuple(replace(one, **pad) if one.vehicle == "uav1" else one for one in CONTEXT.setup.pads)
    return lines(checks.pad_height(replace(CONTEXT, setup=replace(CONTEXT.setup, pads=pads)), FACTS))


def shown(*said: tuple[float, int, str], alarmed: bool = False, aboard: bool = False) -> list[str]:
    """Return which of the texts (seconds, severity, words) are shown, and what is said at the end."""
    state, found = flight_of(flying()), list[Command]()
    for at_s, severity, what in said:
        one = with_facts(state.vehicles["uav1"], alarm=(what, at_s)) if alarmed else state.vehicles["uav1"]
        if aboard:
            state, more = texts.said_aboard(state, one, ComponentText(100, severity, what), at_s)
        else:
            state, more = texts.tell_text(state, one, StatusText(severity, what), at_s)
        found += more
    found += texts.tell_passed_over(state, 110.0)[1]
    return [one.text for one in found if isinstance(one, Say)]


def many(count: int, severity: int, at_s: float = 100.0) -> list[tuple[float, int, str]]:
    return [(at_s, severity, f"text {number}") for number in range(count)]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "who it is",
        lambda: [
            lines(checks.identity(replace(FACTS, **given), ARDUPILOT, place_m))
            for given, place_m in (
                ({}, (3.0, 4.0)),
                ({"version": None}, (0.0, 0.0)),
                ({"version": Version(4, 5, 9)}, (0.0, 0.0)),
                ({"version": Version(4, 6, 0)}, (0.0, 0.0)),
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
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: is armed already, expected a vehicle at rest on its pad"],
            [
                "ok: fixed wing, ArduPilot 4.7.0",
                "stop: its heartbeat says that it is a fixed wing, expected a multicopter",
            ],
            ["ok: quadrotor, PX4 4.7.0", "stop: its heartbeat says autopilot 12, expected ardupilot (3)"],
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: system 1 speaks from a and b: two vehicles have the same sysid"],
            ["ok: quadrotor, ArduPilot 4.7.0"],
            ["ok: quadrotor, ArduPilot 4.7.0", "stop: stands 200 m from the depot, expected at most 200 m"],
        ],
    ),
    (
        "who it is of PX4's",
        lambda: lines(
            checks.identity(
                replace(FACTS, heartbeat=replace(FACTS.heartbeat, autopilot=12), version=Version(1, 10, 0)),
                PX4,
                (0.0, 0.0),
            )
        ),
        [("warning: quadrotor, PX4 1.10.0, which is older than 1.15; faultline is tested with PX4 1.17.0")],
    ),
    (
        "how high its pad is",
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
        "how high a far pad is",
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
        "where it really stands",
        lambda: checks.pad_from(replace(FACTS, position=replace(PLACE, alt_rel_m=3.0)), 1.0, 2.0),
        Pad(vehicle="uav1", east_m=1.0, north_m=2.0, alt_m=447.0),
    ),
    (
        "how long it is waited for",
        lambda: [
            lines(checks.link(FACTS, LinkFailsafe(acts, 5.0, "words"), waited_s=waited_s, wanted_s=wanted_s))
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
        "whose heartbeats it waits for",
        lambda: [
            lines(checks.stations(replace(FACTS, parameters=parameters_, stations=others), ARDUPILOT))
            for parameters_, others in (
                ({}, ()),
                ({"SYSID_MYGCS": 255.0}, ()),
                ({"SYSID_MYGCS": 254.0}, ()),
                ({}, (StationHeard(3, 190),)),
                ({"SYSID_MYGCS": 255.0}, (StationHeard(3, 190), StationHeard(255, 190))),
            )
        ],
        [
            [],
            [],
            [("warning: its GCS failsafe watches system 254 (SYSID_MYGCS), ours is 255: it will not notice our loss")],
            [
                (
                    "warning: another ground station is on its link, system 3 component 190: its "
                    "HEARTBEATs would hide the loss of ours"
                )
            ],
            [
                (
                    "warning: another ground station is on its link, system 3 component 190: it may command "
                    "the vehicle too"
                ),
                (
                    "warning: another ground station is on its link, system 255 component 190: its "
                    "HEARTBEATs would hide the loss of ours"
                ),
            ],
        ],
    ),
    (
        "what it does on a low battery",
        lambda: [
            lines(checks.battery_failsafes(replace(FACTS, parameters=parameters_), ARDUPILOT, left_pct))
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
                    " battery it flies on until it falls"
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
            lines(checks.fence(CONTEXT, replace(FACTS, parameters=parameters_), path))
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
        "what is left after the flight",
        lambda: [checks.left_pct(CONTEXT, path, 50.0) for path in (None, PATH)],
        [None, 44.332],
    ),
    (
        "whether its battery is enough",
        lambda: [
            lines(checks.energy_for_flight(CONTEXT, "uav1", path, percent))
            for path, percent in ((None, 80.0), (PATH, 80.0), (PATH, 18.0), (PATH, 22.0))
        ],
        [
            ["ok: stays on the ground as a spare, battery 80 %"],
            ["ok: battery 80 %, flight 2.7 min and 6 %, lands with 74 %"],
            [("stop: battery 18 %, flight 2.7 min and 6 %, lands with 12 %, expected at least the reserve of 15 %")],
            ["ok: battery 22 %, flight 2.7 min and 6 %, lands with 16 %"],
        ],
    ),
    (
        "who may speak",
        lambda: [
            lines(checks.talkers({name: parse_connection(text) for name, text in connections}, signed=signed))
            for connections, signed in (
                ((("uav1", "udpin://0.0.0.0:14550"),), True),
                ((("uav1", "udpin://0.0.0.0:14550"),), False),
                ((("uav1", "udpin://0.0.0.0:14550"), ("uav2", "tcpout://10.0.0.3:5760")), False),
                ((("uav1", "serial:///dev/ttyUSB0:57600"),), False),
                ((("uav1", "udpin://127.0.0.1:14550"),), False),
            )
        ],
        [
            ["ok: frames are signed; what is not signed with our key is refused"],
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
            lines(checks.disk(free, {"uav1": PATH}, CONTEXT)) for free in (10**9, 1_500_000, 1_450_000, 1_400_000, 10)
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
            lines(checks.separation([PATH, replace(PATH, vehicle="uav2")], layer_m, {"uav1": 450.0, "uav2": alt_m}))
            for layer_m, alt_m in ((5.0, 450.0), (5.0, 490.0))
        ],
        [
            [("stop: uav1 on leg 0 (takeoff) and uav2 on leg 0 (takeoff) come within 0.00 m, 5 m expected")],
            ["ok: any two vehicles stay at least 5 m apart"],
        ],
    ),
    (
        "a height that is right",
        lambda: [proposed(known(RTL_ALT=value)) for value in (1499.0, 1500.0, 1550.0, 1551.0, 1498.0)],
        [
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15.5 m (RTL_ALT)"],
            [
                "RTL_ALT 1551 -> 1500 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 1551 -> 1500 cm: keeps its RTL in its own layer",
            ],
            [
                "RTL_ALT 1498 -> 1500 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 1498 -> 1500 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of the highest",
        lambda: [proposed(known(RTL_ALT=value), "uav3") for value in (3000.0, 7000.0, 7600.0, 9000.0)],
        [
            ["ok: RTL altitude is 30 m (RTL_ALT)"],
            ["ok: RTL altitude is 70 m (RTL_ALT)"],
            ["ok: RTL altitude is 76 m (RTL_ALT)"],
            [
                "RTL_ALT 9000 -> 2700 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 27 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 9000 -> 2700 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of the highest under a ceiling",
        lambda: [proposed(known(RTL_ALT=value), "uav3", ceiling_m=40.0) for value in (4000.0, 4001.0)],
        [
            ["ok: RTL altitude is 40 m (RTL_ALT)"],
            [
                "RTL_ALT 4001 -> 2700 cm: keeps its RTL in its own layer",
                "ok: RTL altitude will be 27 m (RTL_ALT)",
                "ok: to be set for the flight: RTL_ALT 4001 -> 2700 cm: keeps its RTL in its own layer",
            ],
        ],
    ),
    (
        "a height of newer firmware",
        lambda: [
            proposed(known(**values))
            for values in ({"RTL_ALT_M": 30.0}, {"RTL_ALT_M": 15.0}, {"RTL_ALT_M": 30.0, "RTL_ALT": 1500.0}, {})
        ],
        [
            [
                "RTL_ALT_M 30 -> 15 m: keeps its RTL in its own layer",
                "ok: RTL altitude will be 15 m (RTL_ALT_M)",
                "ok: to be set for the flight: RTL_ALT_M 30 -> 15 m: keeps its RTL in its own layer",
            ],
            ["ok: RTL altitude is 15 m (RTL_ALT_M)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            [("warning: RTL altitude not known: RTL_ALT does not answer; nothing is set")],
        ],
    ),
    (
        "a cone",
        lambda: [proposed(known(RTL_ALT=1500.0, RTL_CONE_SLOPE=value)) for value in (0.0, 0.4, 0.5, 3.0)],
        [
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            ["ok: RTL altitude is 15 m (RTL_ALT)"],
            [
                "RTL_CONE_SLOPE 0.5 -> 0: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_ALT)",
                ("ok: to be set for the flight: RTL_CONE_SLOPE 0.5 -> 0: climbs to that height near its pad, too"),
            ],
            [
                "RTL_CONE_SLOPE 3 -> 0: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_ALT)",
                ("ok: to be set for the flight: RTL_CONE_SLOPE 3 -> 0: climbs to that height near its pad, too"),
            ],
        ],
    ),
    (
        "a return of PX4's",
        lambda: [
            proposed(known(**values), "uav1", UNEVEN)
            for values in (
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 10.0, "RTL_LAND_DELAY": 0.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 10.0, "RTL_LAND_DELAY": 5.0},
                {"RTL_RETURN_ALT": 60.0, "RTL_DESCEND_ALT": 10.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_DESCEND_ALT": 15.0},
                {"RTL_RETURN_ALT": 15.0, "RTL_CONE_ANG": 45.0},
            )
        ],
        [
            ["ok: RTL altitude is 15 m (RTL_RETURN_ALT)"],
            [
                "RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer",
                "ok: RTL altitude is 15 m (RTL_RETURN_ALT)",
                ("ok: to be set for the flight: RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer"),
            ],
            [
                "RTL_RETURN_ALT 60 -> 15 m: keeps its RTL in its own layer",
                "RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer",
                "ok: RTL altitude will be 15 m (RTL_RETURN_ALT)",
                "ok: to be set for the flight: RTL_RETURN_ALT 60 -> 15 m: keeps its RTL in its own layer",
                ("ok: to be set for the flight: RTL_DESCEND_ALT 10 -> 15 m: waits over its pad in its own layer"),
            ],
            ["ok: RTL altitude is 15 m (RTL_RETURN_ALT)"],
            [
                "RTL_CONE_ANG 45 -> 0 deg: climbs to that height near its pad, too",
                "ok: RTL altitude is 15 m (RTL_RETURN_ALT)",
                ("ok: to be set for the flight: RTL_CONE_ANG 45 -> 0 deg: climbs to that height near its pad, too"),
            ],
        ],
    ),
    (
        "a height once it is set",
        lambda: [
            settled(ends, known(RTL_ALT=3000.0))
            for ends in (
                {},
                {"RTL_ALT": ""},
                {"RTL_ALT": "RTL_ALT stays 3000"},
                {"RTL_CONE_SLOPE": "RTL_CONE_SLOPE: no answer"},
            )
        ],
        [
            ["ok: RTL altitude set to 15 m (RTL_ALT)"],
            ["ok: RTL altitude set to 15 m (RTL_ALT)"],
            [
                (
                    "warning: RTL altitude stays 30 m (RTL_ALT), not the 15 m that keep it clear of "
                    "the others: RTL_ALT stays 3000"
                )
            ],
            ["warning: RTL altitude set to 15 m, but RTL_CONE_SLOPE: no answer"],
        ],
    ),
    (
        "what is asked for",
        lambda: [
            (
                parameters.first_names(dialect),
                parameters.newer_names(dialect, {}),
                parameters.newer_names(dialect, known(RTL_ALT=1.0)),
            )
            for dialect in (ARDUPILOT, PX4)
        ],
        [
            (("RTL_ALT", "RTL_CONE_SLOPE"), ("RTL_ALT_M",), ()),
            (("RTL_RETURN_ALT", "RTL_CONE_ANG", "RTL_DESCEND_ALT", "RTL_LAND_DELAY"), (), ()),
        ],
    ),
    (
        "a value in words",
        lambda: [parameters.number(value) for value in (1500.0, 27.299999, 0.0, -1.5)],
        ["1500", "27.3", "0", "-1.5"],
    ),
    (
        "values that are the same",
        lambda: [
            parameters.same(one, other)
            for one, other in ((1500.0, 1500.014), (1500.0, 1500.016), (0.0, 9e-7), (0.0, 1.1e-6))
        ],
        [True, False, True, False],
    ),
    (
        "heights are rounded up",
        lambda: [
            parameters._rounded_up(height_m, unit_m, kind)
            for height_m, unit_m, kind in (
                (15.001, 0.01, 4),
                (15.0, 0.01, 4),
                (15.01, 1.0, 9),
                (15.01, 1.0, 4),
                (15.0000000001, 0.01, 9),
            )
        ],
        [1501.0, 1500.0, 15.1, 16.0, 1500.0],
    ),
    (
        "why a height is set",
        lambda: [parameters._why_so_high(context) for context in (CONTEXT, fleet_of({"uav1": (0,)}).context)],
        ["keeps its RTL in its own layer", "keeps its RTL above the line"],
    ),
    (
        "what is on record",
        lambda: [
            parameters.kept_record(replace(CHANGE, old=old), 1, "ardupilot", before)
            for old, before in (
                (3000.0, None),
                (1500.0, KEPT),
                (2000.0, KEPT),
                (3000.0, replace(KEPT, new=1400.0)),
                (1300.0, replace(KEPT, new=1400.0, earlier=(1300.0, 1500.0))),
                (3000.0, replace(KEPT, stage=parameters.ChangeStage.RESTORED, old=2500.0)),
            )
        ],
        [
            KEPT,
            KEPT,
            replace(KEPT, old=2000.0),
            replace(KEPT, earlier=(1400.0,)),
            replace(KEPT, earlier=(NOW_S + 300.0, 1400.0)),
            KEPT,
        ],
    ),
    (
        "the whole record",
        lambda: parameters.on_record(
            [CHANGE],
            {"uav1": (1, "ardupilot")},
            [replace(KEPT, name="RTL_CONE_SLOPE"), replace(KEPT, old=2500.0, new=3000.0)],
        ),
        [replace(KEPT, name="RTL_CONE_SLOPE"), replace(KEPT, old=2500.0, earlier=(3000.0,))],
    ),
    (
        "what is found on board",
        lambda: [parameters.found(KEPT, value).value for value in (3000.0, 1500.0, 1400.0)],
        ["old", "ours", "other"],
    ),
    (
        "what is still to be given back",
        lambda: [stage.value for stage in parameters.ChangeStage if replace(KEPT, stage=stage).open],
        ["planned", "set", "left"],
    ),
    (
        "what is given back in words",
        lambda: [KEPT.words, replace(KEPT, unit="").words],
        ["uav1: RTL_ALT 1500 -> 3000 cm", "uav1: RTL_ALT 1500 -> 3000"],
    ),
    (
        "how many warnings are shown",
        lambda: [shown(*many(count, 4)) for count in (6, 7, 8)],
        [
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 10 s",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 2 more texts in 10 s",
            ],
        ],
    ),
    ("how many important texts are shown", lambda: [len(shown(*many(count, 2))) for count in (12, 13)], [12, 13]),
    ("how many of an alarm", lambda: [len(shown(*many(count, 6), alarmed=True)) for count in (12, 13)], [12, 13]),
    (
        "how many of other components",
        lambda: [shown(*many(count, 0), aboard=True) for count in (3, 4)],
        [
            [
                "uav1, its component 100 says: text 0",
                "uav1, its component 100 says: text 1",
                "uav1, its component 100 says: text 2",
            ],
            [
                "uav1, its component 100 says: text 0",
                "uav1, its component 100 says: text 1",
                "uav1, its component 100 says: text 2",
                "uav1: 1 more text in 10 s",
            ],
        ],
    ),
    (
        "what is not severe is not shown",
        lambda: [shown((100.0, severity, "a"), aboard=aboard) for severity in (4, 5) for aboard in (False, True)],
        [["uav1 says: a"], ["uav1, its component 100 says: a"], [], []],
    ),
    (
        "a text that is repeated",
        lambda: [shown((100.0, 4, "a"), (at_s, 4, "a")) for at_s in (130.0, 130.1)],
        [["uav1 says: a"], ["uav1 says: a", "uav1 says: a"]],
    ),
    (
        "a text that is repeated again and again",
        lambda: shown((50.0, 4, "a"), (75.0, 4, "a"), (100.0, 4, "a")),
        ["uav1 says: a"],
    ),
    (
        "a new window",
        lambda: [shown(*many(7, 4), (at_s, 4, "b")) for at_s in (109.9, 110.0, 125.0)],
        [
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 2 more texts in 10 s",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 10 s",
                "uav1 says: b",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 25 s",
                "uav1 says: b",
            ],
        ],
    ),
    (
        "a window that has not ended",
        lambda: texts.tell_passed_over(flight_of(flying(texts=TextFlow(since_s=100.1, passed_over=3))), 110.0)[1],
        (),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
