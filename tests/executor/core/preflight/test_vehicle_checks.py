"""The checklist: what a vehicle says of itself, set against what the plan wants of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.codes import Check, Severity
from executor.core.interface.connection import Connection, parse_connection
from executor.core.interface.messages import Heartbeat, Position, StationActed, StationHeard, SystemStatus, Version
from executor.core.preflight import onboard_failsafes
from executor.core.preflight import vehicle_checks as checks
from executor.core.preflight.onboard_failsafes import Parameters
from executor.core.preflight.vehicle_checks import VehicleFacts, describe_prearm_failure
from executor.site import site_model
from missions import ARDUPILOT, PX4, Dialect, list_other_names
from missions.surface import build_flat_surface
from tests.executor.builders import fleet_of, site_of

FLEET = fleet_of()
CONTEXT = FLEET.context
VERSIONS = {"ardupilot": Version(4, 7, 0, "dev"), "px4": Version(1, 17, 0)}
AT_HOME = (0.0, 0.0)
COPTER: Parameters = {
    "FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 5.0, "FS_OPTIONS": 16.0, "MAV_GCS_SYSID": 255.0, "BATT_CAPACITY": 5000.0,
    "MOT_BAT_VOLT_MAX": 0.0,
    "BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1000.0, "BATT_LOW_VOLT": 14.0, "BATT_FS_CRT_ACT": 1.0,
    "BATT_CRT_MAH": 500.0, "BATT_CRT_VOLT": 0.0, "FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 0.0, "FENCE_TYPE": 7.0,
    "FENCE_ALT_MAX": 100.0, "FENCE_RADIUS": 300.0, "WPNAV_ACCEL": 250.0, "WPNAV_JERK": 1.0, "WPNAV_ACCEL_Z": 100.0,
    "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0, "LAND_SPEED": 50.0, "LAND_ALT_LOW": 1000.0,
    "WPNAV_SPEED": 1000.0, "RTL_SPEED": 0.0, "FENCE_ACTION": 1.0,
}  # fmt: skip
PIXHAWK: Parameters = {
    "NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 10.0, "COM_FAIL_ACT_T": 5.0, "COM_DLL_EXCEPT": 0.0, "COM_LOW_BAT_ACT": 3.0,
    "BAT1_CAPACITY": 5000.0, "BAT1_N_CELLS": 4.0,
    "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05, "GF_ACTION": 2.0, "GF_MAX_HOR_DIST": 0.0, "GF_MAX_VER_DIST": 0.0,
    "MPC_ACC_HOR": 3.0, "MPC_Z_V_AUTO_UP": 3.0, "MPC_Z_V_AUTO_DN": 1.5, "MPC_Z_VEL_MAX_DN": 1.5, "MPC_TKO_SPEED": 1.5,
    "MPC_XY_CRUISE": 5.0, "COM_FLTT_LOW_ACT": 0.0,
}  # fmt: skip
GOOD = {"ardupilot": COPTER, "px4": PIXHAWK}


def said(dialect: Dialect = ARDUPILOT, /, **changes: float) -> VehicleFacts:
    """Return what a vehicle said that is as it should be, but for these parameters."""
    parameters = {**GOOD[dialect.name], **changes}
    number = dialect.number
    position = Position(60.0, 49.6, 15.6, 450.0, 0.0, 0.0, 0.0, 0.0, None)
    return VehicleFacts("uav1", Heartbeat(number, 0, False, 3, 2), position, 100.0, VERSIONS[dialect.name], parameters)


@pytest.mark.parametrize(("free_bytes", "severity"), [(40_000_000_000, Severity.OK), (1_000_000, Severity.WARNING)])
def test_the_record_of_a_flight_needs_room(free_bytes: int, severity: Severity) -> None:
    paths = {name: board.path for name, board in FLEET.boards.items() if board is not None}
    found = checks.check_disk_space(free_bytes, paths, CONTEXT)
    assert (found.severity, found.subject) == (severity, "disk")
    assert found.text.startswith(f"{free_bytes / 1e9:.1f} GB free, the record of a flight like this takes about ")


@pytest.mark.parametrize(
    ("alt_m", "found"),
    [
        (450.0, []),
        (454.9, []),
        (459.0, [Severity.WARNING]),
        (1476.0, [Severity.STOP]),
    ],
)
def test_a_pad_is_as_high_as_the_depot(alt_m: float, found: list[Severity]) -> None:
    setup = CONTEXT.setup
    pads = tuple(replace(pad, alt_m=alt_m) for pad in setup.pads)
    # The flights would lie below such pads, which no setup allows: the layers are lifted with them.
    layers = replace(setup.layers, surface=build_flat_surface(15.0 + 2000.0))
    context = replace(CONTEXT, setup=replace(setup, pads=pads, layers=layers))
    said_of_it = checks.check_pad_height(context, said())
    assert [check.severity for check in said_of_it] == found
    assert all(
        f"its pad is {alt_m:.0f} m above sea level by its GPS, the depot 450 m" in one.text for one in said_of_it
    )


def lacking(facts: VehicleFacts, *names: str) -> VehicleFacts:
    """Return the same without the answers to some questions."""
    return replace(facts, parameters={key: value for key, value in facts.parameters.items() if key not in names})


def waited_s(facts: VehicleFacts, dialect: Dialect, wanted_s: float | None = None, speedup: float = 1.0) -> float:
    tables: dict[str, dict[str, object]] = {"flight": {"speedup": speedup}}
    if wanted_s is not None:
        tables["faults"] = {"link_timeout_s": wanted_s}
    site = site_of(("uav1",), dialect.name, **tables)
    return site_model.link_timeout_s(site, dialect, onboard_failsafes.read_link_failsafe(dialect, facts.parameters))


def link(facts: VehicleFacts, dialect: Dialect, wanted_s: float | None = None) -> Check:
    own = onboard_failsafes.read_link_failsafe(dialect, facts.parameters)
    return checks.check_link_failsafe(facts, own, waited_s=waited_s(facts, dialect, wanted_s), wanted_s=wanted_s)


def severities(checks: list[Check]) -> list[Severity]:
    return [check.severity for check in checks]


def test_the_names_are_those_of_the_good_examples() -> None:
    assert {*onboard_failsafes.list_preflight_parameters(ARDUPILOT)} == {*COPTER}
    assert {*onboard_failsafes.list_preflight_parameters(PX4)} == {*PIXHAWK}
    assert list_other_names(ARDUPILOT, COPTER, COPTER) == ()


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda one: str(one.name))
def test_a_vehicle_that_is_as_it_should_be_raises_nothing(dialect: Dialect) -> None:
    context, facts = fleet_of(autopilot=dialect.name).context, said(dialect)
    found = [
        *checks.check_identity(facts, dialect, AT_HOME), link(facts, dialect),
        *checks.check_ground_stations(facts, dialect),
        *checks.check_battery_failsafe_settings(facts, dialect, 40.0), *checks.check_own_geofence(context, facts, None),
    ]  # fmt: skip
    assert {check.severity for check in found} == {Severity.OK}


@pytest.mark.parametrize(("kind", "words"), [(1, "fixed wing"), (4, "helicopter"), (0, "generic vehicle"), (None, "")])
def test_what_is_no_multicopter_stops(kind: int | None, words: str) -> None:
    facts = said()
    facts = replace(facts, heartbeat=replace(facts.heartbeat, vehicle_type=kind))
    [check] = [check for check in checks.check_identity(facts, ARDUPILOT, AT_HOME) if check.severity is Severity.STOP]
    assert words in check.text
    assert check.text.endswith("expected a multicopter")


def test_another_autopilot_than_the_site_files_stops() -> None:
    found = checks.check_identity(said(PX4), ARDUPILOT, AT_HOME)
    stops = [check.text for check in found if check.severity is Severity.STOP]
    assert stops == ["HEARTBEAT autopilot is 12, expected ardupilot (3)"]


@pytest.mark.parametrize(
    ("dialect", "version", "severity"),
    [
        (ARDUPILOT, Version(4, 6, 0), Severity.OK), (ARDUPILOT, Version(4, 5, 7), Severity.WARNING),
        (PX4, Version(1, 15, 0), Severity.OK), (PX4, Version(1, 14, 3), Severity.WARNING),
        (PX4, None, Severity.WARNING), (PX4, Version(1, 18, 1), Severity.OK),
        (PX4, Version(1, 19, 0), Severity.WARNING),
    ],
)  # fmt: skip
def test_a_firmware_that_is_older_or_newer_is_a_warning_that_names_what_was_tested(
    dialect: Dialect, version: Version | None, severity: Severity
) -> None:
    [check] = checks.check_identity(replace(said(dialect), version=version), dialect, AT_HOME)
    assert check.severity is severity
    assert (f"tested with {dialect.tested_version}" in check.text) is (severity is Severity.WARNING)


@pytest.mark.parametrize(
    ("dialect", "changes", "words"),
    [
        (ARDUPILOT, {}, "GCS failsafe: RTL after 5 s (FS_GCS_ENABLE=1)"),
        (ARDUPILOT, {"FS_GCS_ENABLE": 5.0, "FS_GCS_TIMEOUT": 20.0}, "GCS failsafe: land after 20 s (FS_GCS_ENABLE=5)"),
        (PX4, {}, "GCS failsafe: RTL after 17 s (NAV_DLL_ACT=2)"),
        (PX4, {"COM_DL_LOSS_T": 30.0, "COM_FAIL_ACT_T": 10.0}, "GCS failsafe: RTL after 42 s (NAV_DLL_ACT=2)"),
        (PX4, {"NAV_DLL_ACT": 1.0}, "GCS failsafe: hold after 17 s (NAV_DLL_ACT=1)"),
    ],
)
def test_what_it_does_without_us_in_words(dialect: Dialect, changes: dict[str, float], words: str) -> None:
    check = link(said(dialect, **changes), dialect)
    assert check.severity is Severity.OK
    assert check.text.startswith(words)


@pytest.mark.parametrize(
    ("facts", "dialect", "words"),
    [
        (said(FS_GCS_ENABLE=0.0), ARDUPILOT, "no GCS failsafe (FS_GCS_ENABLE=0)"),
        (said(PX4, NAV_DLL_ACT=0.0), PX4, "no GCS failsafe (NAV_DLL_ACT=0)"),
        (said(FS_OPTIONS=2.0), ARDUPILOT, "no GCS failsafe in a mission"),
        (said(PX4, COM_DLL_EXCEPT=1.0), PX4, "no GCS failsafe in a mission"),
        (lacking(said(), "FS_GCS_ENABLE"), ARDUPILOT, "GCS failsafe not known"),
    ],
)
def test_a_vehicle_that_does_nothing_without_us_is_a_warning(facts: VehicleFacts, dialect: Dialect, words: str) -> None:
    check = link(facts, dialect)
    assert check.severity is Severity.WARNING
    assert check.text.startswith(words)


def test_a_failsafe_that_waits_for_another_station_does_not_watch_us() -> None:
    for facts in (said(MAV_GCS_SYSID=252.0), lacking(said(SYSID_MYGCS=252.0), "MAV_GCS_SYSID")):
        [check] = checks.check_ground_stations(facts, ARDUPILOT)
        assert check.severity is Severity.WARNING
        assert "watches system 252" in check.text
        assert "ours is 255" in check.text


def test_a_failsafe_that_waits_for_our_own_number_watches_us_whichever_it_is() -> None:
    assert checks.check_ground_stations(said(MAV_GCS_SYSID=254.0), ARDUPILOT, 254) == []
    [check] = checks.check_ground_stations(said(MAV_GCS_SYSID=255.0), ARDUPILOT, 254)
    assert check.text.endswith("; set MAV_GCS_SYSID to 254, or link.station_sysid to 255")


PORTS = [parse_connection(text) for text in ("udpout://127.0.0.1:14550", "tcpin://0.0.0.0:5760")]


def test_without_a_port_for_other_stations_nothing_is_reported_of_them() -> None:
    assert checks.check_forwarding([said(PX4)], [], allow_orders=False, signed=False) == []


@pytest.mark.parametrize(
    ("ports", "allow", "signed", "severity", "words"),
    [
        (PORTS, False, False, Severity.OK, "stations may not send orders"),
        (PORTS[:1], True, False, Severity.OK, "stations may send orders"),
        (PORTS, True, True, Severity.OK, "stations may send orders"),
        (PORTS, True, False, Severity.WARNING, "who reaches tcpin://0.0.0.0:5760 can command all vehicles"),
    ],
)
def test_stations_behind_our_ports_are_one_line(
    ports: list[Connection], allow: bool, signed: bool, severity: Severity, words: str
) -> None:
    heard = replace(said(PX4), stations=(StationHeard(255, 190, behind=True), StationHeard(250, 1, behind=True)))
    [check] = checks.check_forwarding([said(PX4), heard], ports, allow_orders=allow, signed=signed)
    assert (check.severity, check.subject) == (severity, "[forward]")
    assert words in check.text
    assert check.text.endswith("heard: 250, 255")
    [nobody] = checks.check_forwarding([said(PX4)], ports, allow_orders=allow, signed=signed)
    assert nobody.text.endswith("heard: none yet")


def test_a_station_behind_us_hides_nothing_and_what_it_does_before_the_flight_is_a_warning() -> None:
    act = StationActed(255, 190, "sets RTL_ALT to 3000")
    facts = replace(said(PX4), stations=(StationHeard(255, 190, behind=True),), acts=(act,))
    assert checks.check_ground_stations(facts, PX4) == []
    _, warned = checks.check_forwarding([facts, facts], PORTS, allow_orders=True, signed=True)
    assert warned.severity is Severity.WARNING
    assert warned.text == "the ground station of system 255 component 190 sets RTL_ALT to 3000"


@pytest.mark.parametrize(("ours", "theirs", "free"), [(255, 255, 254), (254, 254, 253), (254, 255, None)])
def test_a_station_with_our_own_number_is_named_with_what_to_do(ours: int, theirs: int, free: int | None) -> None:
    facts = replace(said(PX4), stations=(StationHeard(theirs, 190),))
    [check] = checks.check_ground_stations(facts, PX4, ours)
    assert check.text.endswith(f"set link.station_sysid to another, such as {free}") is (free is not None)


@pytest.mark.parametrize(
    ("dialect", "system", "hides"), [(PX4, 254, True), (ARDUPILOT, 254, False), (ARDUPILOT, 255, True)]
)
def test_another_ground_station_is_named(dialect: Dialect, system: int, hides: bool) -> None:
    facts = replace(said(dialect), stations=(StationHeard(system, 190),))
    [check] = checks.check_ground_stations(facts, dialect)
    assert check.severity is Severity.WARNING
    assert f"system {system} component 190" in check.text
    assert ("would hide the loss of ours" in check.text) is hides


@pytest.mark.parametrize(
    ("facts", "dialect", "words"),
    [
        (said(BATT_FS_LOW_ACT=0.0, BATT_FS_CRT_ACT=0.0), ARDUPILOT, "no battery failsafe"),
        (said(BATT_LOW_MAH=0.0, BATT_LOW_VOLT=0.0, BATT_CRT_MAH=0.0), ARDUPILOT, "no battery failsafe"),
        (said(PX4, COM_LOW_BAT_ACT=0.0), PX4, "no battery failsafe (COM_LOW_BAT_ACT=0)"),
        (lacking(said(PX4), "COM_LOW_BAT_ACT"), PX4, "battery failsafe not known (COM_LOW_BAT_ACT)"),
    ],
)
def test_a_vehicle_that_does_nothing_on_a_low_battery_is_a_warning(
    facts: VehicleFacts, dialect: Dialect, words: str
) -> None:
    [check] = checks.check_battery_failsafe_settings(facts, dialect, 40.0)
    assert check.severity is Severity.WARNING
    assert check.text.startswith(words)


def test_what_it_does_on_a_low_battery_in_words() -> None:
    [check] = checks.check_battery_failsafe_settings(said(), ARDUPILOT, 40.0)
    assert check.text == (
        "battery failsafe: RTL below 20 % or 14 V (BATT_FS_LOW_ACT=2), land below 10 % (BATT_FS_CRT_ACT=1)"
    )
    [check] = checks.check_battery_failsafe_settings(said(PX4), PX4, 40.0)
    assert check.text == ("battery failsafe: RTL below 7 % (COM_LOW_BAT_ACT=3), land below 5 % (COM_LOW_BAT_ACT=3)")


def test_a_battery_failsafe_that_would_act_in_the_planned_flight_is_a_warning() -> None:
    assert severities(checks.check_battery_failsafe_settings(said(), ARDUPILOT, 21.0)) == [Severity.OK]
    found = checks.check_battery_failsafe_settings(said(), ARDUPILOT, 18.0)
    assert severities(found) == [Severity.OK, Severity.WARNING]
    assert found[1].text.startswith(
        "battery failsafe: RTL below 20 % or 14 V (BATT_FS_LOW_ACT=2), but its flight ends with 18 %"
    )
    assert severities(checks.check_battery_failsafe_settings(said(), ARDUPILOT, None)) == [Severity.OK], (
        "a spare has no flight"
    )


def fence_of(**changes: float) -> list[str]:
    board = FLEET.boards["uav1"]
    assert board is not None
    changes["FENCE_ENABLE"] = 1.0
    found = checks.check_own_geofence(CONTEXT, said(**changes), board.path)
    return [check.text for check in found if check.severity is Severity.WARNING]


def test_a_fence_that_is_smaller_than_the_plan_is_a_warning() -> None:
    """uav1 goes 300 m east, and 20 m high in its layer."""
    assert fence_of(FENCE_RADIUS=400.0) == []
    [text] = fence_of(FENCE_RADIUS=250.0)
    assert text.startswith("its geofence ends 250 m away from home (FENCE_RADIUS), but its flight goes 3")
    [text] = fence_of(FENCE_ALT_MAX=10.0, FENCE_RADIUS=400.0)
    assert text.startswith("its geofence ends 10 m high (FENCE_ALT_MAX), but its flight goes ")
    assert fence_of(FENCE_RADIUS=250.0, FENCE_TYPE=1.0) == [], "the circle is not in use"
    assert fence_of(FENCE_RADIUS=0.0) == [], "0 is no limit"


def test_a_fence_that_is_off_is_none() -> None:
    assert onboard_failsafes.read_geofence(ARDUPILOT, said(FENCE_RADIUS=1.0).parameters) == (None, None)
    assert onboard_failsafes.read_geofence(PX4, said(PX4).parameters) == (None, None)
    assert onboard_failsafes.read_geofence(PX4, said(PX4, GF_MAX_HOR_DIST=500.0).parameters) == (None, 500.0)


def test_pre_arm_checks_in_words() -> None:
    status = SystemStatus(90.0, 16.0, 0x10000024, prearm_ok=False)
    assert (
        describe_prearm_failure({"GPS: no fix": 95.0, "compass": 60.0}, status, 100.0)
        == "its own pre-arm checks fail: GPS: no fix"
    )
    assert describe_prearm_failure({}, status, 100.0) == "its own pre-arm checks fail: not healthy: compass, GPS"
    assert describe_prearm_failure({}, None, 100.0) == "its own pre-arm checks fail, no reason reported"
    many = describe_prearm_failure(dict.fromkeys("abcde", 99.0), status, 100.0)
    assert many == "its own pre-arm checks fail: a; b; c; 2 more"


@pytest.mark.parametrize(
    ("connection", "warned"),
    [
        ("udpin://0.0.0.0:14550", True), ("udpout://192.168.1.7:14550", True), ("tcpout://drone.local:5760", True),
        ("udpin://127.0.0.1:14550", False), ("udpin://localhost:14550", False), ("serial:///dev/ttyUSB0:57600", False),
    ],
)  # fmt: skip
def test_possible_senders_are_reported(connection: str, warned: bool) -> None:
    links = {"uav1": [parse_connection(connection)], "uav2": [parse_connection("udpin://127.0.0.1:14551")]}
    check = checks.check_signing(links, signed=False)
    assert check.severity is (Severity.WARNING if warned else Severity.OK)
    if warned:
        assert check.text.startswith("frames are not signed, and uav1 is reached over a network: any sender")
    assert checks.check_signing(links, signed=True).severity is Severity.OK


@pytest.mark.parametrize(("waited", "severity"), [(19.9, Severity.OK), (20.0, Severity.OK), (20.1, Severity.WARNING)])
def test_a_time_out_that_is_as_long_as_the_vehicles_own_is_kept(waited: float, severity: Severity) -> None:
    own = onboard_failsafes.read_link_failsafe(ARDUPILOT, said().parameters)
    assert checks.check_link_failsafe(said(), own, waited_s=waited, wanted_s=20.0).severity is severity
    assert checks.check_link_failsafe(said(), own, waited_s=waited, wanted_s=None).severity is Severity.OK
