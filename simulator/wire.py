"""The only place where the simulator touches pymavlink: frames to messages and back.

pymavlink is a codec here; its connections are not used. None of its dialects has the mission identities that MAVLink
gained since (MISSION_CURRENT.mission_id, MISSION_ACK.opaque_id, MISSION_COUNT.opaque_id), so they are appended here.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as dialect

from missions.items import Frame
from simulator import messages
from simulator.config import Signing

AUTOPILOT_COMPONENT = 1
EVERYBODY = 0
GROUND_STATION = 6
"""MAV_TYPE_GCS."""
EVERY_MISSION_TYPE = 255
EXTENSIONS: Mapping[str, tuple[str, ...]] = {
    "MISSION_CURRENT": ("mission_id", "fence_id", "rally_points_id"),
    "MISSION_ACK": ("opaque_id",),
    "MISSION_COUNT": ("opaque_id",),
}
"""uint32 fields behind those that pymavlink knows."""
HEADER = struct.Struct("<BBBBBBBHB")
MAGIC = 0xFD


class _Fields:
    """A decoded message's fields, typed on reading."""

    def __init__(self, values: Mapping[str, messages.FieldValue | str]) -> None:
        self._values = values

    def get_integer(self, name: str) -> int:
        """Return a field as a whole number, 0 when it is not there."""
        value = self.get_number(name)
        return int(value) if math.isfinite(value) else 0

    def get_number(self, name: str) -> float:
        """Return a field as a number, 0 when it is not there."""
        value = self._values.get(name, 0)
        return value if isinstance(value, int | float) else 0.0

    def get_text(self, name: str) -> str:
        """Return a field as text."""
        value = self._values.get(name, "")
        return value if isinstance(value, str) else ""

    def get_bytes(self, name: str) -> bytes:
        """Return a field of bytes, empty when it is not there."""
        value = self._values.get(name, b"")
        return bytes(map(int, value)) if isinstance(value, list | bytes) else b""

    def get_e7(self, name: str) -> int:
        """Return degrees as 1e-7 degrees."""
        value = self.get_number(name) * 1e7
        return round(value) if math.isfinite(value) else 0


def _parse_command(fields: _Fields, x: str, y: str, z: str) -> messages.Command:
    names = ("param1", "param2", "param3", "param4", x, y, z)
    one, two, three, four, five, six, seven = (float(fields.get_number(name)) for name in names)
    return messages.Command(fields.get_integer("command"), (one, two, three, four, five, six, seven))


def _parse_item(fields: _Fields, *, integer: bool) -> messages.ItemReceived:
    frame = fields.get_integer("frame")
    in_degrees = not integer and frame != Frame.MISSION
    one, two, three, four = (fields.get_number(f"param{number}") for number in (1, 2, 3, 4))
    return messages.ItemReceived(
        seq=fields.get_integer("seq"),
        frame=frame,
        command=fields.get_integer("command"),
        params=(one, two, three, four),
        x=fields.get_e7("x") if in_degrees else fields.get_integer("x"),
        y=fields.get_e7("y") if in_degrees else fields.get_integer("y"),
        z=fields.get_number("z"),
        current=bool(fields.get_integer("current")),
        autocontinue=bool(fields.get_integer("autocontinue")),
        mission_type=fields.get_integer("mission_type"),
        integer=integer,
    )


def _parse_clear(fields: _Fields) -> messages.MissionClearAll:
    kind = fields.get_integer("mission_type")
    return messages.MissionClearAll(0 if kind == EVERY_MISSION_TYPE else kind)


FILE_HEAD = struct.Struct("<HBBBBBxI")
"""Of MAVFTP: number, session, opcode, size, opcode of the request, end of a burst, offset; then data."""


def _parse_file_request(fields: _Fields) -> messages.FileRequest:
    payload = fields.get_bytes("payload")
    number, session, operation, size, _, _, offset = FILE_HEAD.unpack_from(payload)
    return messages.FileRequest(number, session, operation, offset, payload[FILE_HEAD.size :][:size])


READERS: Mapping[str, Callable[[_Fields], messages.Body]] = {
    "HEARTBEAT": lambda f: messages.Heartbeat(f.get_integer("type") == GROUND_STATION),
    "COMMAND_LONG": lambda f: _parse_command(f, "param5", "param6", "param7"),
    "COMMAND_INT": lambda f: _parse_command(f, "x", "y", "z"),
    "SET_MODE": lambda f: messages.SetMode(f.get_integer("custom_mode")),
    "MISSION_COUNT": lambda f: messages.MissionCount(f.get_integer("count"), f.get_integer("mission_type")),
    "MISSION_ITEM_INT": lambda f: _parse_item(f, integer=True),
    "MISSION_ITEM": lambda f: _parse_item(f, integer=False),
    "MISSION_REQUEST_LIST": lambda f: messages.MissionRequestList(f.get_integer("mission_type")),
    "MISSION_REQUEST": lambda f: messages.MissionRequest(
        f.get_integer("seq"), f.get_integer("mission_type"), integer=False
    ),
    "MISSION_REQUEST_INT": lambda f: messages.MissionRequest(
        f.get_integer("seq"), f.get_integer("mission_type"), integer=True
    ),
    "MISSION_ACK": lambda f: messages.MissionAckReceived(f.get_integer("type"), f.get_integer("mission_type")),
    "MISSION_CLEAR_ALL": _parse_clear,
    "MISSION_SET_CURRENT": lambda f: messages.MissionSetCurrent(f.get_integer("seq")),
    "PARAM_REQUEST_LIST": lambda _: messages.ParamRequestList(),
    "PARAM_REQUEST_READ": lambda f: messages.ParamRequestRead(f.get_text("param_id"), f.get_integer("param_index")),
    "PARAM_SET": lambda f: messages.ParamSet(
        f.get_text("param_id"), f.get_number("param_value"), f.get_integer("param_type")
    ),
    "REQUEST_DATA_STREAM": lambda f: messages.RequestDataStream(
        f.get_integer("req_stream_id"), f.get_integer("req_message_rate"), bool(f.get_integer("start_stop"))
    ),
    "FILE_TRANSFER_PROTOCOL": _parse_file_request,
    "RADIO_STATUS": lambda f: messages.RadioStatus(f.get_integer("txbuf")),
    "TIMESYNC": lambda f: messages.Timesync(f.get_integer("tc1"), f.get_integer("ts1")),
    "PING": lambda f: messages.Ping(f.get_integer("time_usec"), f.get_integer("seq"), f.get_integer("target_system")),
}


class Codec:
    """Packs and unpacks for one vehicle."""

    def __init__(
        self,
        sysid: int,
        *,
        every_component: bool = False,
        signing: Signing | None = None,
        component: int = AUTOPILOT_COMPONENT,
        others: frozenset[int] = frozenset(),
    ) -> None:
        self._sysid = sysid
        self._every_component = every_component
        """Whether it obeys what is for another component: ArduPilot does where it knows of none with that id."""
        self._others = others
        """Components of the vehicle beside the autopilot that are spoken to."""
        self._packer = dialect.MAVLink(None, srcSystem=sysid, srcComponent=component)
        self._began_ticks, self._ticks_per_s = 0, 0.0
        if signing is not None:
            self._began_ticks = self._packer.signing.timestamp = signing.began_ticks
            self._ticks_per_s = signing.ticks_per_s
            self._packer.signing.secret_key = signing.key
            self._packer.signing.sign_outgoing = True

    def encode(self, message: messages.Outbound, now_s: float = 0.0) -> bytes:
        """Return a MAVLink 2 frame; `now_s` since the beginning of the simulation dates its signature.

        Raises:
            AttributeError, TypeError, struct.error: MAVLink has no such message, field or value.
        """
        signing = self._packer.signing
        signing.timestamp = max(signing.timestamp, self._began_ticks + round(now_s * self._ticks_per_s))
        fields = dict(message.fields)
        tail = b"".join(struct.pack("<I", fields.pop(name, 0)) for name in EXTENSIONS.get(message.name, ()))
        packed = getattr(dialect, f"MAVLink_{message.name.lower()}_message")(**fields)
        frame = bytes(packed.pack(self._packer))
        if any(tail):
            frame = self._append_extension_fields(packed, tail)
        self._packer.seq = (self._packer.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[messages.Received]:
        """Return the messages in a datagram that are meant for this vehicle; what is damaged or unknown is left out."""
        # A parser for each datagram: a cut-off frame must not swallow the beginning of the next one.
        parser = dialect.MAVLink(None)
        parser.robust_parsing = True
        parser.signing = self._packer.signing  # which streams were heard, and when
        received = []
        for message in parser.parse_buffer(datagram) or []:
            reader = READERS.get(message.get_type())
            if reader is None:
                continue
            values = message.to_dict()
            if values.get("target_system", EVERYBODY) not in {EVERYBODY, self._sysid}:
                continue
            target = values.get("target_component", EVERYBODY)
            elsewhere = target not in {EVERYBODY, AUTOPILOT_COMPONENT, *self._others}
            if elsewhere and not self._every_component:
                continue
            sender = messages.Peer(message.get_srcSystem(), message.get_srcComponent())
            received.append(messages.Received(sender, reader(_Fields(values)), target))
        return received

    def _append_extension_fields(self, packed: dialect.MAVLink_message, tail: bytes) -> bytes:
        """Return the frame with fields behind those that pymavlink knows."""
        payload = bytes(packed.get_payload()).ljust(struct.calcsize(packed.unpacker.format), b"\0") + tail
        payload = payload.rstrip(b"\0")
        number, signing = packed.get_msgId(), self._packer.signing
        head = HEADER.pack(
            MAGIC,
            len(payload),
            int(signing.sign_outgoing),
            0,
            self._packer.seq,
            self._sysid,
            AUTOPILOT_COMPONENT,
            number & 0xFFFF,
            number >> 16,
        )
        checksum = dialect.x25crc(head[1:] + payload + bytes([packed.crc_extra])).crc
        frame = head + payload + struct.pack("<H", checksum)
        if not signing.sign_outgoing:
            return frame
        frame += struct.pack("<BQ", signing.link_id, signing.timestamp)[:7]
        signing.timestamp += 1
        return frame + hashlib.sha256(signing.secret_key + frame).digest()[:6]
