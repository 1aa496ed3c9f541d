"""Flight modes by what they mean to us."""

from __future__ import annotations

from missions.autopilots.dialect import Dialect


def is_mission_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle flies the mission on board."""
    return custom_mode == dialect.modes.mission.custom_mode


def is_home_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle comes home, or lands, by itself."""
    ours = {dialect.modes.return_home.custom_mode, dialect.modes.land.custom_mode}
    return custom_mode in ours | dialect.modes.other_ways_home


def is_manual_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether somebody has to fly it: neither we, nor a mission, nor a failsafe leads there with hands off."""
    return custom_mode in dialect.modes.manual


def mode_name(dialect: Dialect, custom_mode: int) -> str:
    """Return a mode in words."""
    modes = dialect.modes
    ours = {
        modes.guided.custom_mode: "GUIDED",
        modes.hold.custom_mode: "HOLD",
        modes.mission.custom_mode: "MISSION",
        modes.return_home.custom_mode: "RTL",
        modes.land.custom_mode: "LAND",
    }
    return ours.get(custom_mode) or dict(modes.other_names).get(custom_mode) or f"number {custom_mode}"
