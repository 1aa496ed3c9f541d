"""The dialogue between vehicles and clients as text, as seen on the client's side of the link."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as dialect

from simulator.radio import measure_frame

MavMessage: TypeAlias = Any
"""A pymavlink message, which is untyped."""
ANSWERS = frozenset({
    "AUTOPILOT_VERSION", "COMMAND_ACK", "FILE_TRANSFER_PROTOCOL", "MESSAGE_INTERVAL", "MISSION_ACK", "MISSION_COUNT",
    "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_ITEM_REACHED", "MISSION_REQUEST", "MISSION_REQUEST_INT", "PARAM_ERROR",
    "PARAM_VALUE", "STATUSTEXT",
})  # fmt: skip
"""Vehicle messages to keep; the rest is telemetry."""
_KEPT_IDS = frozenset(
    getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in ANSWERS if hasattr(dialect, f"MAVLINK_MSG_ID_{name}")
)
LIST_DIRECTORY, ACK, NAK = 3, 128, 129
"""Of MAVFTP."""
_LISTS = {1: ", fence", 2: ", rally points"}
"""MAV_MISSION_TYPE."""


@dataclass(frozen=True, slots=True)
class Said:
    """One message of a dialogue."""

    t_s: float
    """Simulated seconds since the simulation began."""
    vehicle: str
    up: bool
    """Whether a client sent it."""
    message: MavMessage

    @property
    def name(self) -> str:
        """MAVLink's name of the message."""
        return str(self.message.get_type())

    @property
    def target(self) -> int:
        """Addressed system; 0 is all."""
        return int(getattr(self.message, "target_system", 0))

    @property
    def client(self) -> int:
        """System at the other end; 0 for a vehicle's broadcast."""
        return int(self.message.get_srcSystem()) if self.up else self.target

    def __str__(self) -> str:
        """Return a line of a transcript."""
        who = f"{self.client} -> {self.vehicle}" if self.up else f"{self.vehicle} -> {self.client or 'all'}"
        return f"{self.t_s:9.2f} s  {who:<14}  {describe_message(self.message)}"


class Recorder:
    """Record the messages between one vehicle and its clients."""

    def __init__(self, vehicle: str, now_s: Callable[[], float]) -> None:
        self._vehicle, self._now_s = vehicle, now_s
        self._parsers = {up: dialect.MAVLink(None) for up in (True, False)}
        for parser in self._parsers.values():
            parser.robust_parsing = True
        self.said: list[Said] = []

    def note(self, datagram: bytes, up: bool) -> None:
        """Take a datagram that a client sends, or that has reached it."""
        # Over a radio frames come in pieces; one whole frame of telemetry need not be parsed.
        whole = len(datagram) >= 10 and datagram[0] == 0xFD and measure_frame(datagram) == len(datagram)
        if whole and not up and int.from_bytes(datagram[7:10], "little") not in _KEPT_IDS:
            return
        for message in self._parsers[up].parse_buffer(datagram) or []:
            name = message.get_type()
            if name != "BAD_DATA" and (up or name in ANSWERS):
                self.said.append(Said(self._now_s(), self._vehicle, up, message))


def format_transcript(said: Iterable[Said]) -> str:
    """Return the lines of a dialogue, without HEARTBEATs."""
    return "\n".join(str(one) for one in said if one.name != "HEARTBEAT")


def _name_entry(enum: str, number: int, prefix: str) -> str:
    entry = dialect.enums[enum].get(number)
    return str(number) if entry is None else str(entry.name).removeprefix(prefix)


def name_mission_result(number: int) -> str:
    """Return MAV_MISSION_RESULT by name."""
    return "ACCEPTED" if number == 0 else _name_entry("MAV_MISSION_RESULT", number, "MAV_MISSION_")


def name_command(number: int) -> str:
    """Return MAV_CMD by name."""
    return _name_entry("MAV_CMD", number, "MAV_CMD_")


def describe_answer(message: MavMessage) -> str | None:
    """Return the relevant part of a vehicle's answer; None for other messages."""
    name = message.get_type()
    match name:
        case "COMMAND_ACK":
            return f"{name_command(message.command)} {_name_entry('MAV_RESULT', message.result, 'MAV_RESULT_')}"
        case "MISSION_ACK":
            return f"MISSION_ACK {name_mission_result(message.type)}"
        case "MISSION_REQUEST" | "MISSION_REQUEST_INT" | "MISSION_COUNT":
            return f"{name} {message.count if name == 'MISSION_COUNT' else message.seq}"
        case "PARAM_VALUE":
            kind = _name_entry("MAV_PARAM_TYPE", message.param_type, "MAV_PARAM_TYPE_")
            index = "no index" if message.param_index == 65535 else "its index"
            return f"PARAM_VALUE {message.param_id} {kind}, {index}"
        case "PARAM_ERROR":
            return f"PARAM_ERROR {message.param_id} {_name_entry('MAV_PARAM_ERROR', message.error, 'MAV_PARAM_ERROR_')}"
        case "AUTOPILOT_VERSION":
            version = message.flight_sw_version
            number = ".".join(str(version >> shift & 255) for shift in (24, 16, 8))
            kind = _name_entry("FIRMWARE_VERSION_TYPE", version & 255, "FIRMWARE_VERSION_TYPE_")
            bits = " ".join(str(bit) for bit in range(64) if message.capabilities >> bit & 1)
            return f"AUTOPILOT_VERSION {number} {kind}, capabilities {bits}"
        case "FILE_TRANSFER_PROTOCOL" if message.payload[3] in {ACK, NAK}:
            return _describe_file_answer(bytes(message.payload))
        case _:
            return None


def _describe_file_answer(payload: bytes) -> str:
    """Return MAVFTP's answer: its request, any error, its data; the end of a burst is marked."""
    operation, size, asked, ends, offset = payload[3], payload[4], payload[5], payload[6], payload[8:12]
    name = f"FILE {_name_entry('MAV_FTP_OPCODE', asked, 'MAV_FTP_OPCODE_')}"
    data = payload[12 : 12 + size]
    if operation == NAK:
        return f"{name} {_name_entry('MAV_FTP_ERR', data[0], 'MAV_FTP_ERR_')}{f' {data[1]}' if size > 1 else ''}"
    if asked == LIST_DIRECTORY:
        data = b"\0".join(sorted(data.split(b"\0")))  # their order is undefined
    text = data.decode("ascii", "replace").replace("\0", "|") if data.isascii() else data.hex()
    at = f" at {int.from_bytes(offset, 'little')}" if any(offset) else ""
    return f"{name}{at}{f' {text!r}' if data else ''}{', ends' if ends else ''}"


def describe_message(message: MavMessage) -> str:
    """Return a short description of a message of either side.

    >>> describe_message(dialect.MAVLink_mission_item_int_message(1, 1, 3, 6, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0))
    'MISSION_ITEM_INT 3 NAV_WAYPOINT'
    """
    name = message.get_type()
    text = describe_answer(message)
    if name == "COMMAND_ACK":
        text = f"COMMAND_ACK {text}"
    elif text is None:
        text = " ".join([name, *_describe_fields(message, name)])
    return text + _LISTS.get(getattr(message, "mission_type", 0), "")


def _describe_fields(message: MavMessage, name: str) -> list[str]:
    match name:
        case "COMMAND_LONG" | "COMMAND_INT":
            last = ("param5", "param6", "param7") if name == "COMMAND_LONG" else ("x", "y", "z")
            values = [getattr(message, one) for one in ("param1", "param2", "param3", "param4", *last)]
            used = max((place + 1 for place, value in enumerate(values) if value), default=0)
            return [name_command(message.command), *(f"{value:g}" for value in values[:used])]
        case "MISSION_ITEM" | "MISSION_ITEM_INT":
            return [str(message.seq), name_command(message.command)]
        case "MISSION_ITEM_REACHED" | "MISSION_SET_CURRENT":
            return [str(message.seq)]
        case "PARAM_SET":
            return [str(message.param_id), f"{message.param_value:g}"]
        case "PARAM_REQUEST_READ":
            return [str(message.param_id or message.param_index)]
        case "STATUSTEXT":
            return [repr(str(message.text).strip("\t\0"))]
        case "FILE_TRANSFER_PROTOCOL":
            return [_name_entry("MAV_FTP_OPCODE", message.payload[3], "MAV_FTP_OPCODE_")]
        case _:
            return []
