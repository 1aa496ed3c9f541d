"""The party in control of a real vehicle, from its own log: commands and their senders in that time."""

from __future__ import annotations

from collections.abc import Callable

from pymavlink import DFReader
from pyulog import ULog

from tests.e2e.flights import began_unix_s
from tests.e2e.tlog import messages
from tests.sitl.flights import VICTIM, Flown
from tests.sitl.real import ARDUPILOT, Autopilot, RealVehicle

MODES = {"ardupilot": {"loiter": (5, 0), "mission": (3, 0), "rtl": (6, 0), "stands": (17, 0)},
         "px4": {"loiter": (4, 3), "mission": (4, 4), "rtl": (4, 5), "stands": (4, 3)}}  # fmt: skip
LOGGED = {"SDLOG_BACKEND": 1.0, "SDLOG_MODE": 0.0}
COMMANDS = {176, 178, 20, 21, 22, 300, 400, 192, 193}
"""Modes, speeds, returns, landings, take-offs, starts, arming, repositions, pauses."""


def switches(autopilot: Autopilot, mode: str) -> Callable[[RealVehicle], None]:
    return lambda vehicle: vehicle.switch(*MODES[autopilot.name][mode])


def own_commands(flight: Flown, autopilot: Autopilot) -> list[tuple[float, int]]:
    """Return what uav2's own log says that we commanded: when, in seconds of its clock, and what."""
    folder = flight.run.parent / "sim" / VICTIM
    if autopilot is ARDUPILOT:
        log = DFReader.DFReader_binary(str(max(folder.glob("logs/*.BIN"))))
        found: list[tuple[float, int]] = []
        while (message := log.recv_match(type=["MAVC"])) is not None:
            if message.SS == 255 and message.SC == 190:
                found.append((message.TimeUS / 1e6, message.Cmd))
        log.filehandle.close()
        return found
    data = ULog(str(max(folder.rglob("*.ulg"), key=lambda path: path.stat().st_size))).get_dataset("vehicle_command")
    values = data.data
    rows = zip(values["timestamp"], values["command"], values["source_system"], values["source_component"], strict=True)
    return [
        (stamp / 1e6, int(command)) for stamp, command, system, component in rows if (system, component) == (255, 190)
    ]


def taken_s(flight: Flown) -> tuple[float, float]:
    """Return when uav2 was taken and when it was given back, or landed, by the flight's clock."""
    assert flight.struck_s is not None
    began_s = next(at_s for at_s, stage in flight.shown if stage == "pilot")
    until_s = next((at_s for at_s, stage in flight.shown if at_s > began_s and stage != "pilot"), 1e9)
    return began_s, until_s


def boot_s(flight: Flown, at_s: float) -> float:
    """Return uav2's own clock at a time of the flight's."""
    zero_s = began_unix_s(flight.run)
    rows = messages(flight.run / f"{VICTIM}.tlog", "GLOBAL_POSITION_INT")
    return float(min((abs(stamp_s - zero_s - at_s), row.time_boot_ms / 1e3) for stamp_s, row in rows)[1])


def nothing_was_commanded(flight: Flown, autopilot: Autopilot, within_s: float = 5.0) -> None:
    """Check, by uav2's own log, that nothing was commanded from the takeover until it was given back.

    Args:
        flight: What became of it.
        autopilot: Whose log it is.
        within_s: How soon after it was struck it must be known to be taken.
    """
    assert flight.struck_s is not None
    began_s, until_s = taken_s(flight)
    assert began_s - flight.struck_s < within_s, flight.said
    first_s = boot_s(flight, flight.struck_s)
    last_s = 1e9 if until_s == 1e9 else boot_s(flight, until_s)
    commands = own_commands(flight, autopilot)
    assert any(at_s < first_s for at_s, _ in commands), "the log holds what we commanded before"
    assert [row for row in commands if first_s < row[0] < last_s - 0.5 and row[1] in COMMANDS] == [], flight.said
