"""An unread value stops the flight, and an unknown one is a warning: neither is ever `ok`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from executor.core.interface.codes import Check, Severity
from executor.core.interface.messages import ParamValue, Version
from executor.core.preflight import onboard_failsafes, vehicle_checks
from executor.core.preflight.parameter_changes import Answers, propose_return_changes
from executor.core.preflight.vehicle_checks import VehicleFacts
from missions import ARDUPILOT, PX4, Dialect, FlightPath
from missions.cameras import Trigger
from tests.executor.builders import fleet_of
from tests.executor.core.preflight.test_vehicle_checks import CONTEXT, FLEET, lacking, said

BOTH = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda dialect: str(dialect.name))
PIXHAWKS = fleet_of(autopilot="px4").context
BOARD = FLEET.boards["uav1"]
assert BOARD is not None
PATH = BOARD.path


def unread(facts: VehicleFacts, *names: str) -> VehicleFacts:
    """Return what is known of a vehicle that may have these parameters, and did not answer."""
    for name in names:
        facts = lacking(facts, name)
    return replace(facts, unread=frozenset(names))


def link_lines(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    own = onboard_failsafes.read_link_failsafe(dialect, facts.parameters, facts.unread)
    return [
        vehicle_checks.check_link_failsafe(
            facts, own, waited_s=onboard_failsafes.effective_link_timeout_s(dialect, None, 0.0, own), wanted_s=None
        )
    ]


READERS: list[tuple[str, Callable[[Dialect], tuple[str, ...]], Callable[[VehicleFacts, Dialect], list[Check]]]] = [
    ("the link failsafe", onboard_failsafes.link_names, link_lines),
    (
        "the watched station",
        lambda dialect: onboard_failsafes.select_names(dialect.ground_station_failsafe.station_sysid),
        vehicle_checks.check_ground_stations,
    ),
    (
        "the battery failsafe",
        onboard_failsafes.battery_names,
        lambda facts, known: vehicle_checks.check_battery_failsafe_settings(facts, known, 40.0),
    ),
    ("the flight times", lambda known: tuple(one.parameter for one in known.tunings), vehicle_checks.flight_times),
    ("the ground", lambda known: tuple(one.parameter for one in known.terrain), vehicle_checks.check_terrain_following),
]


@BOTH
@pytest.mark.parametrize(("what", "names", "lines"), READERS, ids=[row[0] for row in READERS])
def test_whatever_was_not_read_is_a_reason_not_to_fly(
    what: str, names: Callable[[Dialect], tuple[str, ...]], lines: Callable[[VehicleFacts, Dialect], list[Check]],
    dialect: Dialect,
) -> None:  # fmt: skip
    for name in names(dialect):
        found = lines(unread(said(dialect), name), dialect)
        assert [check.severity for check in found] == [Severity.STOP], f"{what}: {name}"
        assert f"{name} was not read" in found[0].text


@pytest.mark.parametrize("name", onboard_failsafes.fence_names(ARDUPILOT))
def test_a_fence_of_which_a_half_was_read_is_not_said_to_be_left_alone(name: str) -> None:
    """Over a bad link six warnings had become one: what was not read counted as no limit."""
    facts = said(FENCE_ENABLE=1.0, FENCE_ALT_MAX=10.0, FENCE_RADIUS=60.0)
    assert [check.severity for check in vehicle_checks.check_own_geofence(CONTEXT, facts, PATH)] == [
        Severity.WARNING
    ] * 2
    [check] = vehicle_checks.check_own_geofence(CONTEXT, unread(facts, name), PATH)
    assert (check.severity, check.text) == (
        Severity.STOP,
        f"its geofence is not known: {name} was not read; is the link too bad?",
    )


def test_a_pack_that_is_not_known_is_not_taken_for_the_planned_one() -> None:
    [check] = vehicle_checks.check_pack(CONTEXT, unread(said(), "BATT_CAPACITY"))
    assert check.severity is Severity.STOP


def test_an_unknown_camera_stops_a_flight_that_requires_pictures() -> None:
    capture = SimpleNamespace(trigger=Trigger.DISTANCE)
    asked = cast("FlightPath", SimpleNamespace(waypoints=[SimpleNamespace(captures=[capture])]))
    [check] = vehicle_checks.check_shutter(unread(said(), "CAM1_TYPE"), ARDUPILOT, asked)
    assert check.severity is Severity.STOP
    assert vehicle_checks.check_shutter(unread(said(), "CAM1_TYPE"), ARDUPILOT, PATH) == [], "it is asked for none"


def test_an_rtl_that_was_not_read_is_a_reason_not_to_fly_and_nothing_is_set() -> None:
    known = {"RTL_ALT": ParamValue("RTL_ALT", 1200.0, 6)}
    found = propose_return_changes(CONTEXT, {"uav1": Answers(known, frozenset({"RTL_CONE_SLOPE"}))})
    [check] = found.checks
    assert (found.changes, check.severity) == ((), Severity.STOP)
    assert "RTL_CONE_SLOPE was not read" in check.text


@BOTH
def test_a_silence_is_borne_for_as_long_as_what_was_not_read_may_be(dialect: Dialect) -> None:
    rule = dialect.ground_station_failsafe
    own = onboard_failsafes.read_link_failsafe(dialect, {rule.action: 1.0}, {rule.timeout})
    assert (own.acts, own.after_s >= rule.timeout_most_s) == (None, True)
    assert onboard_failsafes.effective_link_timeout_s(dialect, None, 0.0, own) >= rule.timeout_most_s
    assert onboard_failsafes.effective_link_timeout_s(dialect, 20.0, 0.0, own) >= rule.timeout_most_s
    nothing = onboard_failsafes.read_link_failsafe(dialect, {rule.action: 0.0}, ())
    assert onboard_failsafes.effective_link_timeout_s(dialect, 20.0, 0.0, nothing) == 20.0


@pytest.mark.parametrize(
    ("facts", "dialect"),
    [
        (said(BATT_FS_LOW_ACT=9.0), ARDUPILOT),
        (said(BATT_FS_CRT_ACT=9.0), ARDUPILOT),
        (said(PX4, COM_LOW_BAT_ACT=9.0), PX4),
    ],
)
def test_an_unknown_battery_failsafe_is_a_warning(facts: VehicleFacts, dialect: Dialect) -> None:
    [check] = vehicle_checks.check_battery_failsafe_settings(facts, dialect, 40.0)
    assert check.severity is Severity.WARNING
    assert "unknown action" in check.text


@pytest.mark.parametrize(("dialect", "name"), [(ARDUPILOT, "FS_GCS_ENABLE"), (PX4, "NAV_DLL_ACT")])
def test_an_unknown_link_failsafe_is_a_warning(dialect: Dialect, name: str) -> None:
    [check] = link_lines(said(dialect, **{name: 9.0}), dialect)
    assert (check.severity, "unknown action" in check.text) == (Severity.WARNING, True)


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        (said(FENCE_ENABLE=1.0, FENCE_ACTION=9.0), "at a breach of its geofence: unknown action (FENCE_ACTION=9)"),
        (said(PX4, GF_ACTION=9.0, GF_MAX_HOR_DIST=1e4), "at a breach of its geofence: unknown action (GF_ACTION=9)"),
    ],
)
def test_an_unknown_fence_action_is_a_warning(facts: VehicleFacts, text: str) -> None:
    context = CONTEXT if "FENCE_ENABLE" in facts.parameters else PIXHAWKS
    assert (Severity.WARNING, text) in [
        (one.severity, one.text) for one in vehicle_checks.check_own_geofence(context, facts, None)
    ]


@pytest.mark.parametrize(("dialect", "name"), [(ARDUPILOT, "RTL_ALT_TYPE"), (PX4, "MPC_ALT_MODE")])
def test_an_unknown_terrain_following_mode_is_a_warning(dialect: Dialect, name: str) -> None:
    [check] = vehicle_checks.check_terrain_following(said(dialect, **{name: 9.0}), dialect)
    assert (check.severity, check.text) == (
        Severity.WARNING,
        f"may follow terrain automatically: {name} 9 is unknown",
    )


@BOTH
def test_figures_that_a_firmware_does_not_have_are_planned_with_and_reported(dialect: Dialect) -> None:
    name = dialect.tunings[0].parameter
    assert vehicle_checks.flight_times(said(dialect), dialect) == []
    [check] = vehicle_checks.flight_times(lacking(said(dialect), name), dialect)
    assert (check.severity, name in check.text) == (Severity.WARNING, True)


@pytest.mark.parametrize("left_out", [None, "WPNAV_SPEED"])
def test_how_copter_4_7_flies_is_known_by_its_new_names(left_out: str | None) -> None:
    facts, names = said(), [tuning.parameter for tuning in ARDUPILOT.tunings]
    renamed = {ARDUPILOT.other_names[name].name: 1.0 for name in names if name != left_out}
    has = {**lacking(facts, *names).parameters, **renamed}
    found = vehicle_checks.flight_times(replace(facts, parameters=has), ARDUPILOT)
    assert ["it has no WPNAV_SPEED: " in check.text for check in found] == ([] if left_out is None else [True])
    [check] = vehicle_checks.flight_times(replace(facts, parameters=has, unread=frozenset({"WP_SPD"})), ARDUPILOT)
    assert (check.severity, "WP_SPD was not read" in check.text) == (Severity.STOP, True)


def test_ground_that_is_followed_is_reported_by_the_name_on_board() -> None:
    [check] = vehicle_checks.check_terrain_following(said(WP_RFND_USE=2.0), ARDUPILOT)
    assert (check.severity, "WP_RFND_USE 2" in check.text) == (Severity.WARNING, True)


EARLY = "as soon as its time left in the air is just enough to return"


@pytest.mark.parametrize(
    ("version", "changes", "early"),
    [
        ((1, 17, 0), {"COM_FLTT_LOW_ACT": 0.0}, []),
        ((1, 16, 0), {"COM_FLTT_LOW_ACT": 3.0}, [f"RTL {EARLY} (COM_FLTT_LOW_ACT=3)"]),
        ((1, 16, 0), {"COM_FLTT_LOW_ACT": 2.0}, [f"unknown action {EARLY} (COM_FLTT_LOW_ACT=2)"]),
        ((1, 17, 0), {"COM_FLTT_LOW_ACT": 0.0, "COM_LOW_BAT_ACT": 3.0}, []),
        ((1, 18, 0), {"COM_FLTT_LOW_ACT": 0.0, "COM_LOW_BAT_ACT": 3.0}, []),  # of its betas
        ((1, 18, 0), {"COM_LOW_BAT_ACT": 1.0}, [f"RTL {EARLY} (COM_LOW_BAT_ACT=1)"]),
        ((1, 18, 0), {"COM_LOW_BAT_ACT": 2.0}, []),
        ((1, 18, 0), {"COM_LOW_BAT_ACT": 3.0}, [f"RTL {EARLY} (COM_LOW_BAT_ACT=3)"]),
        ((1, 18, 0), {"COM_LOW_BAT_ACT": 5.0}, []),
        ((1, 18, 0), {"COM_LOW_BAT_ACT": 9.0}, []),
        (None, {"COM_LOW_BAT_ACT": 3.0}, [f"RTL {EARLY} (COM_LOW_BAT_ACT=3)"]),
        (None, {"COM_FLTT_LOW_ACT": 0.0, "COM_LOW_BAT_ACT": 3.0}, []),
    ],
)
def test_a_return_long_before_the_battery_is_low(
    version: tuple[int, int, int] | None, changes: dict[str, float], early: list[str]
) -> None:
    """What has COM_FLTT_LOW_ACT returns early by that alone; 1.18 does not have it."""
    has = {**lacking(said(PX4), "COM_FLTT_LOW_ACT").parameters, **changes}
    facts = replace(said(PX4), parameters=has, version=None if version is None else Version(*version))
    found = vehicle_checks.check_battery_failsafe_settings(facts, PX4, 40.0)
    assert [check.text for check in found[1:]] == [
        f"battery failsafe: {one}: it may leave its mission" for one in early
    ]
    assert all(check.severity is Severity.WARNING for check in found[1:])


@pytest.mark.parametrize(
    ("value", "last", "since"), [(4.0, "flight termination", Version(1, 19, 0)), (5.0, "land", Version(1, 18, 0))]
)
def test_what_newer_px4_does_on_a_low_battery_has_words(value: float, last: str, since: Version) -> None:
    facts = replace(said(PX4, COM_LOW_BAT_ACT=value), version=since)
    for older in (Version(1, 17, 0), None):
        [check] = vehicle_checks.check_battery_failsafe_settings(replace(facts, version=older), PX4, 40.0)
        assert check.severity is Severity.WARNING
        assert "unknown action below 7 %" in check.text
    [check] = vehicle_checks.check_battery_failsafe_settings(facts, PX4, 40.0)
    assert check.severity is Severity.OK
    assert check.text == (
        f"battery failsafe: RTL below 7 % (COM_LOW_BAT_ACT={value:g}), {last} below 5 % (COM_LOW_BAT_ACT={value:g})"
    )
