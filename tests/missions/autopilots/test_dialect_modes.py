"""Modes by their meaning, compared with pymavlink's names and PX4's numbers."""

from __future__ import annotations

import pytest
from pymavlink import mavutil

from missions import ARDUPILOT, PX4
from missions.autopilots.dialect import is_home_mode, is_manual_mode, is_mission_mode, mode_name

OURS = {"AUTO": "MISSION", "BRAKE": "HOLD"}
"""What both autopilots have is called the same for both."""
NOT_NAMED = {"POSITION", "OF_LOITER", "SYSTEMID", "RATE_ACRO"}
"""Modes that are gone, or for a workshop."""


@pytest.mark.parametrize(("number", "name"), mavutil.mode_mapping_acm.items())
def test_the_modes_of_ardupilot(number: int, name: str) -> None:
    assert mode_name(ARDUPILOT, number) == (f"number {number}" if name in NOT_NAMED else OURS.get(name, name))
    assert is_mission_mode(ARDUPILOT, number) is (name == "AUTO")
    assert is_home_mode(ARDUPILOT, number) is (name in {"RTL", "LAND", "SMART_RTL", "AUTO_RTL"})
    hands_off = {"AUTO", "GUIDED", "RTL", "LAND", "BRAKE", "AVOID_ADSB", "GUIDED_NOGPS", "SMART_RTL", "AUTO_RTL"}
    assert is_manual_mode(ARDUPILOT, number) is (name not in hands_off | NOT_NAMED | {"AUTOROTATE"})


AUTO = 4
# main mode, sub mode, name, manual, home: px4_custom_mode.h
PX4_MODES = [
    (1, 0, "MANUAL", True, False),
    (2, 0, "ALTCTL", True, False),
    (3, 0, "POSCTL", True, False),
    (5, 0, "ACRO", True, False),
    (6, 0, "OFFBOARD", True, False),
    (7, 0, "STABILIZED", True, False),
    (3, 1, "ORBIT", True, False),
    (3, 2, "POSITION_SLOW", True, False),
    (10, 0, "TERMINATION", False, False),
    (11, 0, "ALTITUDE_CRUISE", True, False),
    (AUTO, 2, "AUTO.TAKEOFF", False, False),
    (AUTO, 3, "HOLD", False, False),
    (AUTO, 4, "MISSION", False, False),
    (AUTO, 5, "RTL", False, True),
    (AUTO, 6, "LAND", False, True),
    (AUTO, 8, "AUTO.FOLLOW", True, False),
    (AUTO, 9, "AUTO.PRECLAND", False, True),
    (AUTO, 10, f"number {10 << 24 | 4 << 16}", False, False),
]


@pytest.mark.parametrize(("main", "sub", "name", "manual", "home"), PX4_MODES, ids=[one[2] for one in PX4_MODES])
def test_the_modes_of_px4(main: int, sub: int, name: str, *, manual: bool, home: bool) -> None:
    number = sub << 24 | main << 16
    assert mode_name(PX4, number) == name
    assert is_manual_mode(PX4, number) is manual
    assert is_home_mode(PX4, number) is home
    assert is_mission_mode(PX4, number) is (name == "MISSION")
