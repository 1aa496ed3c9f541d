"""The numbers of items and dialects against pymavlink's, and the rules that others build on."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest
from pydantic import TypeAdapter, ValidationError
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from missions import ARDUPILOT, PX4, Command, Dialect, Frame, StartStep, dialect_for
from missions.autopilots import dialect as dialects


@pytest.mark.parametrize("command", Command)
def test_commands_have_pymavlinks_numbers(command: Command) -> None:
    assert getattr(mavlink, f"MAV_CMD_{command.name}") == command


@pytest.mark.parametrize("frame", Frame)
def test_frames_have_pymavlinks_numbers(frame: Frame) -> None:
    assert getattr(mavlink, f"MAV_FRAME_{frame.name}") == frame


def test_ardupilots_modes_have_pymavlinks_numbers() -> None:
    modes = ARDUPILOT.modes
    assert modes.mission.custom_mode == mavlink.COPTER_MODE_AUTO
    assert modes.hold.custom_mode == mavlink.COPTER_MODE_BRAKE
    assert modes.guided.custom_mode == mavlink.COPTER_MODE_GUIDED
    assert modes.return_home.custom_mode == mavlink.COPTER_MODE_RTL
    assert modes.land.custom_mode == mavlink.COPTER_MODE_LAND
    assert all(getattr(modes, name).param3 == 0 for name in ("mission", "hold", "guided", "return_home", "land"))


def test_px4s_modes_are_the_published_packed_numbers() -> None:
    modes = PX4.modes
    packed = (modes.mission, modes.hold, modes.return_home, modes.land)
    assert [mode.custom_mode for mode in packed] == [67371008, 50593792, 84148224, 100925440]
    assert [(mode.param2, mode.param3) for mode in packed] == [(4, 4), (4, 3), (4, 5), (4, 6)]


def test_acks_have_pymavlinks_numbers() -> None:
    assert ARDUPILOT.upload_warnings == {mavlink.MAV_MISSION_INVALID_SEQUENCE}


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
def test_a_dialect_is_found_by_its_name(dialect: Dialect) -> None:
    assert dialect_for(dialect.name) is dialect


def test_an_unknown_autopilot_is_refused() -> None:
    with pytest.raises(ValueError, match="autopilot: expected ardupilot or px4, got 'betaflight'"):
        dialect_for("betaflight")


@pytest.mark.parametrize("part", ["", "performance", "modes"])
def test_a_key_that_a_dialects_file_has_no_field_for_is_refused(part: str) -> None:
    said = tomllib.loads((Path(dialects.__file__).parent / "px4.toml").read_text(encoding="utf-8"))
    (said[part] if part else said)["misspelt"] = 1.0
    with pytest.raises(ValidationError, match="misspelt"):
        TypeAdapter(Dialect).validate_python(said)


def test_what_was_measured_apart() -> None:
    assert ARDUPILOT.start == (StartStep.GUIDED, StartStep.ARM, StartStep.MISSION_START)
    assert PX4.start == (StartStep.ARM, StartStep.MISSION_MODE)
    assert (ARDUPILOT.upload_is_atomic, PX4.upload_is_atomic) == (False, True)
    # A return height of 15 m is RTL_ALT 1500 and RTL_RETURN_ALT 15.
    assert round(15.0 / ARDUPILOT.return_parameters.unit_m) == 1500
    assert round(15.0 / PX4.return_parameters.unit_m) == 15
    # 0 would turn a PX4 to the north at every waypoint.
    assert math.isnan(PX4.no_yaw)
