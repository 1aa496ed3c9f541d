"""Convert MAVLink frames to our messages and back: the only module that flies with pymavlink.

Only pymavlink's codec class is used, as its connections block. Values that a vehicle marks as unknown, or that are
impossible, become None. Of a vehicle's components only the autopilot speaks for it. Texts are stripped of control
characters for terminals.
"""

from __future__ import annotations

import math
import re
import struct
import sys
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from operator import attrgetter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink import frame_layout, message_readers
from executor.adapters.mavlink.frame_layout import HEADS, V1, V2, FrameRejection, LinkSigning, message_id_of
from executor.adapters.mavlink.message_readers import EVENT, Frame, StatusTextAssembler
from executor.core import formatting
from executor.core.interface import messages
from executor.core.telemetry.mode_evidence import parse_px4_event
from executor.core.telemetry.plausibility import filter_implausible
from executor.core.telemetry.vehicle_identity import (
    AutopilotComponent,
    select_component_message,
    update_autopilot_component,
)
from missions import MissionKind
from missions.cameras import FIRST_COMPONENT

MARK = re.compile(b"[%c%c]" % (V1, V2))

FILE_HEAD, FILE_BYTES = struct.Struct("<HBBBBBxI"), 251
"""FILE_TRANSFER_PROTOCOL: number, session, opcode, size, opcode of the request, end of a burst, offset; then data."""
FILE_ACK, FILE_NAK = 128, 129

OF_ANYBODY = frozenset({mav.MAVLINK_MSG_ID_HEARTBEAT, mav.MAVLINK_MSG_ID_RADIO_STATUS})
"""Messages that are read from any sender; of other strangers' frames only the checksum is checked."""

MOST_WRONG = 500
"""Marks without a frame after which the rest of a read counts as noise: 60 kB of them took 0.4 s to parse."""


@dataclass(eq=False, repr=False)
class FrameParser:
    """Cut a byte stream into frames, wherever it was split.

    A frame counts only with a valid checksum. If there is none, the search continues one byte later, so that a start
    mark in noise costs no later frame. The checksum of a message unknown to pymavlink cannot be checked: in a datagram,
    which has no noise, it counts if another frame or the end follows.
    """

    in_datagrams: bool = False
    """Whether input holds only frames, none of which continues in the next datagram."""
    systems: Collection[int] | None = None
    """Systems whose frames are decoded, all if None. A flood of strangers' frames must not cost as much as the fleet's:
    of these all but `OF_ANYBODY` become unknown messages, with their header."""
    _mav: mav.MAVLink = field(default_factory=lambda: mav.MAVLink(None))
    _buffer: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> list[Any]:
        """Take further bytes; return the frames that are now complete."""
        self._buffer += data
        frames, at, wrong = [], 0, 0
        while (end := self._find_frame_end(at)) <= len(self._buffer):
            frame = self._parse_frame(at, end)
            if frame is None:
                wrong += self._buffer[at] in HEADS
                mark = MARK.search(self._buffer, at + 1) if wrong < MOST_WRONG else None
                at = len(self._buffer) if mark is None else mark.start()
            else:
                frames.append(frame)
                at = end
        del self._buffer[: None if self.in_datagrams else at]
        return frames

    def _find_frame_end(self, at: int) -> int:
        """Return the end of a frame that begins here: this position if none does, past the buffer if unknown."""
        buffer = self._buffer
        if at >= len(buffer):
            return sys.maxsize
        if buffer[at] not in HEADS:
            return at
        head = HEADS[buffer[at]]
        if at + head > len(buffer):
            return sys.maxsize
        end, flags, number = at + head + buffer[at + 1] + frame_layout.CHECKSUM, 0, buffer[at + 5]
        if buffer[at] == V2:
            flags, number = buffer[at + 2], int.from_bytes(buffer[at + 7 : at + 10], "little")
            end += frame_layout.SIGNATURE_BYTES * (flags & frame_layout.SIGNED_FLAG)
        known = number in mav.mavlink_map or number == EVENT
        if flags & ~frame_layout.SIGNED_FLAG or not (known or self._is_followed(end)):
            return at
        return end

    def _is_followed(self, end: int) -> bool:
        """Return whether a frame that ends here is the last of its datagram or another one follows."""
        size = len(self._buffer)
        return self.in_datagrams and (end == size or (end < size and self._buffer[end] in HEADS))

    def _parse_frame(self, at: int, end: int) -> Any | None:  # noqa: ANN401 - pymavlink's classes are untyped
        if end == at:
            return None
        data = self._buffer[at:end]
        if message_id_of(data) == EVENT and not frame_layout.has_valid_checksum(data, message_readers.EVENT_EXTRA):
            return None
        try:
            frame = _build_raw_frame(data) if self._is_unread_kind(data) else self._mav.decode(data)
        except (mav.MAVError, struct.error, UnicodeDecodeError):
            return None
        if frame is not None and isinstance(frame, mav.MAVLink_unknown):  # pymavlink leaves out its sender
            system = 3 if data[0] == V1 else 5
            frame.get_header().srcSystem, frame.get_header().srcComponent = data[system], data[system + 1]
            frame.get_header().seq = data[system - 1]
        return frame

    def _is_unread_kind(self, data: bytearray) -> bool:
        """Return whether a frame's content is not needed."""
        if self.systems is None:
            return False
        system = data[3] if data[0] == V1 else data[5]
        return system not in self.systems and message_id_of(data) not in OF_ANYBODY


def _build_raw_frame(data: bytearray) -> Any | None:  # noqa: ANN401
    """Return a frame that is not decoded; None if its checksum is wrong."""
    number = message_id_of(data)
    kind = mav.mavlink_map.get(number)
    if kind is not None and not frame_layout.has_valid_checksum(data, kind.crc_extra):
        return None
    return mav.MAVLink_unknown(number, data)


_KINDS = {int(kind): kind for kind in MissionKind}
"""MAV_MISSION_TYPE of the lists that are followed."""
RADIO = "RADIO_STATUS"
_RELEASES = {0: "dev", 64: "alpha", 128: "beta", 192: "rc"}
"""FIRMWARE_VERSION_TYPE; 255, official, has no suffix."""


Sender = tuple[int, int]
"""System and component id of a frame's sender."""
KEPT_BEATS, KEPT_EVENTS = 8, 64
"""HEARTBEATs and events kept to recognise an echo, which arrives at once. Another station with our id sends nearly the
same content, but with other sequence numbers."""


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """A decoded frame."""

    sysid: int
    compid: int
    seq: int
    frame: bytes
    message: messages.Message | None
    """None for a message that is not followed."""
    more: tuple[messages.Message, ...] = ()
    """Further messages that this frame completes: a text whose last part never arrived."""
    own: bool = True
    """Whether it is from the vehicle's autopilot, not from another component or a radio in between."""
    refused: FrameRejection | None = None
    """Reason for rejection if frames must be signed."""


@dataclass(eq=False, repr=False)
class MavlinkCodec:
    """Codec for all vehicles behind one endpoint."""

    _signing: LinkSigning | None = None
    """Signs outgoing frames, and checks incoming ones."""
    radios: Collection[Sender] | None = None
    """Radios whose RADIO_STATUS is accepted without a signature. None: any if signing is off, none if it is on."""
    systems: Collection[int] | None = None
    """Systems whose frames are read, all if None; see `FrameParser`."""
    overhears: bool = False
    """Whether dialogues between others are read too, as in a log; then no system is us."""
    station: Sender = messages.GROUND_STATION
    """Our system and component id."""
    _mav: mav.MAVLink = field(init=False)
    _datagrams: FrameParser = field(init=False)
    _beats: deque[bytes] = field(default_factory=lambda: deque(maxlen=KEPT_BEATS))
    """Our last HEARTBEATs as sent."""
    texts: StatusTextAssembler = field(default_factory=StatusTextAssembler)
    _sent: dict[int, int] = field(default_factory=dict)
    """Number of frames sent to each system: each system's stream has its own sequence numbers."""
    _speakers: dict[int, AutopilotComponent] = field(default_factory=dict)
    _events: dict[int, deque[tuple[int, int, int]]] = field(default_factory=dict)
    """Last events of each PX4: if a ground station missed one, PX4 repeats it to all."""
    autopilots: dict[int, int] = field(default_factory=dict)
    """MAV_AUTOPILOT of each system, once its heartbeat was received: autopilots pack integer parameters in two ways."""

    def __post_init__(self) -> None:
        self._mav = mav.MAVLink(None, *self.station)
        self._datagrams = FrameParser(in_datagrams=True, systems=self.systems)

    def decode(self, data: bytes) -> Iterator[DecodedFrame]:
        """Yield every frame of a datagram; no frame continues in the next one."""
        yield from self.read(self._datagrams.feed(data))

    def read(self, frames: Iterable[Any]) -> Iterator[DecodedFrame]:
        """Yield the messages in a `FrameParser`'s frames."""
        for frame in frames:
            source = (frame.get_srcSystem(), frame.get_srcComponent())
            refusal = self._find_rejection(frame, source)
            if refusal is not None:
                yield DecodedFrame(
                    *source, frame.get_seq(), bytes(frame.get_msgbuf()), None, own=False, refused=refusal
                )
                continue
            if isinstance(frame, mav.MAVLink_unknown) and self.systems is not None and source[0] not in self.systems:
                yield DecodedFrame(*source, frame.get_seq(), bytes(frame.get_msgbuf()), None, own=False)
                continue
            more: list[messages.Message] = [*self.texts.count_frame(source)]
            message = self._parse_message(frame)
            if isinstance(message, messages.Heartbeat):
                self._follow_speaker(source, message)
            if frame.get_type() == "COMMAND_ACK":
                more += self._parse_acknowledged_order(frame)
            elif isinstance(frame, mav.MAVLink_unknown):
                more += self._parse_px4_event(frame)
            if frame.get_type() == "STATUSTEXT":
                # The raw field: pymavlink's own decoding loses every byte that is not ASCII.
                raw = frame._text_raw  # noqa: SLF001
                more += self.texts.add_part(source, frame.severity, raw, frame.id, frame.chunk_seq)
            speaker = self._speakers.get(source[0], AutopilotComponent())
            said = [select_component_message(speaker, source[1], one) for one in (message, *more) if one is not None]
            heard = [one for one in said if one is not None]
            own = source[1] == speaker.component and frame.get_type() != RADIO
            first = heard.pop(0) if heard else None
            yield DecodedFrame(*source, frame.get_seq(), bytes(frame.get_msgbuf()), first, tuple(heard), own)

    def _find_rejection(self, frame: Frame, source: Sender) -> FrameRejection | None:
        if self._signing is None:
            return None
        refusal = self._signing.check_signature(bytes(frame.get_msgbuf()), *source)
        if refusal is FrameRejection.UNSIGNED and frame.get_type() == RADIO and source in (self.radios or ()):
            return None
        return refusal

    def _follow_speaker(self, source: Sender, beat: messages.Heartbeat) -> None:
        system, component = source
        speaker = self._speakers[system] = update_autopilot_component(
            self._speakers.get(system, AutopilotComponent()), component, beat
        )
        if speaker.component == component:
            self.autopilots[system] = beat.autopilot

    def parse_whole(self, frame: bytes) -> Frame:
        """Return a frame, known to be complete, with its fields by MAVLink name."""
        return self._mav.decode(bytearray(frame))

    def encode(self, message: messages.Outgoing, sysid: int, compid: int) -> bytes:
        """Return the frame of a message to one vehicle."""
        self._mav.seq = self._sent.get(sysid, 0)
        self._sent[sysid] = (self._mav.seq + 1) % 256
        if self._signing is not None:
            self._signing.prepare(self._mav)
        frame = bytes(_to_mavlink(message, sysid, compid, self.autopilots.get(sysid)).pack(self._mav))
        if isinstance(message, messages.SendHeartbeat):
            self._beats.append(frame)
        return frame

    def read_fields(
        self, name: str, sysid: int, compid: int, fields: Mapping[str, object]
    ) -> tuple[bytes, tuple[messages.Message, ...]] | None:
        """Return the frame and the messages of fields that another parser decoded; None if the message is unknown.

        Args:
            name: MAVLink name of the message.
            sysid: System id of the sender.
            compid: Component id of the sender.
            fields: Fields by MAVLink name; None stands for a float that is not finite.
        """
        packed = _pack_fields(name, sysid, compid, fields)
        if packed is None:
            return None
        [received] = self.read(FrameParser(in_datagrams=True).feed(packed))
        message = received.message
        if isinstance(message, messages.ParamValue) and fields["param_value"] is None:
            message = messages.ParamRefused(message.name, absent=False)
        return packed, tuple(one for one in (message, *received.more) if one is not None)

    def write_fields(
        self, message: messages.Outgoing, sysid: int, compid: int
    ) -> tuple[str, Mapping[str, object], bytes] | None:
        """Return the name, fields and frame of a message; None if its fields as numbers would differ."""
        packed = self.encode(message, sysid, compid)
        frame = self._mav.decode(bytearray(packed))
        fields = {
            field: None if isinstance(value := getattr(frame, field), float) and not math.isfinite(value) else value
            for field in frame.fieldnames
        }
        if isinstance(message, messages.SendParamSet) and fields["param_value"] is None:
            return None
        return frame.get_type(), fields, packed

    def _parse_message(self, frame: Frame) -> messages.Message | None:
        if frame.get_type() in _ORDERS:
            return self._parse_order(frame)
        if not self._is_for_us(frame):
            return None
        if frame.get_type() == "PARAM_VALUE":
            name = formatting.escape_controls(frame.param_id)
            value = frame_layout.from_wire(
                frame.param_value, frame.param_type, self.autopilots.get(frame.get_srcSystem())
            )
            return filter_implausible(messages.ParamValue(name, value, frame.param_type)) or messages.ParamRefused(
                name, absent=False
            )
        if frame.get_type() == RADIO and not self._is_accepted_radio(frame):
            return None
        if frame.get_type() == "HEARTBEAT" and bytes(frame.get_msgbuf()) in self._beats:
            return None  # a router's echo of our frame
        read = _READERS.get(frame.get_type())
        message = None if read is None else read(frame)
        return None if message is None else filter_implausible(message)

    def _parse_order(self, frame: Frame) -> messages.OrderSeen | None:
        """Return another station's command if it changes a mode."""
        # With our own id it may be a router's echo of our frame.
        source, target = (frame.get_srcSystem(), frame.get_srcComponent()), frame.target_system
        ordered = message_readers.read_mode_order(frame, self.autopilots.get(target))
        if ordered is None:
            return None
        is_ours = source == self.station and not self.overhears
        return messages.OrderSeen(*ordered, None if is_ours else source[0], target)

    def _parse_acknowledged_order(self, ack: Frame) -> Iterator[messages.OrderSeen]:
        """Yield the command that an autopilot acknowledges if it changes a mode."""
        system, to, command = ack.get_srcSystem(), ack.target_system, message_readers.read_accepted_order(ack)
        if ack.get_srcComponent() != self._speakers.get(system, AutopilotComponent()).component or to == system:
            return  # from a gimbal, or to a companion computer
        if command is not None:
            yield messages.OrderSeen(command, None, None if self._is_for_us(ack) else to, system)

    def _parse_px4_event(self, unknown: Frame) -> Iterator[messages.OwnFailsafe | messages.ModeChange]:
        raw, system = bytes(unknown.get_msgbuf()), unknown.get_srcSystem()
        if message_id_of(raw) != EVENT or self.autopilots.get(system) != mav.MAV_AUTOPILOT_PX4:
            return
        number, boot_ms, sequence, *_, arguments = message_readers.EVENT_LAYOUT.unpack(
            frame_layout.payload_of(raw, message_readers.EVENT_LAYOUT.size)
        )
        said, told = parse_px4_event(number, arguments), self._events.setdefault(system, deque(maxlen=KEPT_EVENTS))
        if said is not None and (number, boot_ms, sequence) not in told:
            told.append((number, boot_ms, sequence))
            yield said

    def _is_for_us(self, frame: Frame) -> bool:
        """Return whether a message is not addressed to another ground station; 0 addresses all."""
        ours = zip(("target_system", "target_component"), self.station, strict=True)
        return self.overhears or all(getattr(frame, field, 0) in {0, number} for field, number in ours)

    def _is_accepted_radio(self, radio: Frame) -> bool:
        named = self.radios is None or (radio.get_srcSystem(), radio.get_srcComponent()) in self.radios
        return named or self._signing is not None  # which accepted it


_ORDERS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
_COMMANDS = mav.enums["MAV_CMD"]


def name_command(number: int) -> str:
    """Return the MAVLink name of a MAV_CMD."""
    return str(_COMMANDS[number].name) if number in _COMMANDS else f"command {number}"


@cache
def _find_target_offset(number: int) -> int | None:
    kind = mav.mavlink_map.get(number)
    if kind is None or "target_system" not in kind.fieldnames:
        return None
    at = kind.ordered_fieldnames.index("target_system")
    parts = zip(kind.native_format.decode()[1:], kind.array_lengths, strict=True)
    offset: int = sum(struct.calcsize(part) * max(1, length) for part, length in list(parts)[:at])
    return offset


def target_of(frame: bytes) -> int:
    """Return a complete frame's target system; 0 for all."""
    at = _find_target_offset(message_id_of(frame))
    return 0 if at is None else frame_layout.payload_of(frame, at + 1)[at]


_BY_NAME = {kind.msgname: kind for kind in mav.mavlink_map.values()}


def _pack_fields(name: str, sysid: int, compid: int, fields: Mapping[str, object]) -> bytes | None:
    """Return the frame of a message; None if it is unknown, or the other parser's definition differs."""
    if name == message_readers.EVENT_NAME:
        return message_readers.build_event_frame(fields, sysid, compid)
    kind = _BY_NAME.get(name)
    if kind is None:
        return None
    try:
        frame = kind(*(_to_field(fields.get(field)) for field in kind.fieldnames))
        return bytes(frame.pack(mav.MAVLink(None, srcSystem=sysid, srcComponent=compid)))
    except (struct.error, TypeError, AttributeError):
        return None


def _to_field(value: object) -> object:
    if isinstance(value, str):
        return value.encode()
    if isinstance(value, list):
        return [_to_field(one) for one in value]
    return math.nan if value is None else value


def _read_heartbeat(frame: Frame) -> messages.Heartbeat | messages.StationHeard | messages.CameraHeard | None:
    if frame.type == mav.MAV_TYPE_GCS:
        return messages.StationHeard(frame.get_srcSystem(), frame.get_srcComponent())
    if frame.autopilot == mav.MAV_AUTOPILOT_INVALID:
        component = frame.get_srcComponent()
        return (
            messages.CameraHeard(component)
            if frame.type == mav.MAV_TYPE_CAMERA and component >= FIRST_COMPONENT
            else None
        )
    return message_readers.read_heartbeat(frame)


def _make_mission_reader(
    build: Callable[..., messages.Message], read_part: Callable[[Any], object], *more: Callable[[Any], object]
) -> Any:  # noqa: ANN401
    """Return a reader for a part of a mission, fence or rally-point transfer: the part, its list, and more."""

    def read(frame: Frame) -> messages.Message | None:
        kind = _KINDS.get(frame.mission_type)
        return None if kind is None else build(read_part(frame), kind, *(one(frame) for one in more))

    return read


def _read_version(frame: Frame) -> messages.Version | None:
    packed = frame.flight_sw_version
    if packed == 0:
        return None  # not set
    return messages.Version(packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255, _RELEASES.get(packed & 255, ""))


def _read_file_reply(frame: Frame) -> messages.FileReply | None:
    payload = bytes(frame.payload)
    number, session, opcode, size, *_ = FILE_HEAD.unpack_from(payload)
    data = payload[FILE_HEAD.size :][:size]
    if opcode == FILE_ACK:
        return messages.FileReply(number - 1 & 0xFFFF, session, data=data)
    return messages.FileReply(number - 1 & 0xFFFF, session, data[0]) if opcode == FILE_NAK and data else None


_READERS: dict[str, Any] = {
    **message_readers.READERS,
    "HEARTBEAT": _read_heartbeat,
    "MISSION_REQUEST": _make_mission_reader(messages.MissionRequest, attrgetter("seq")),
    "MISSION_REQUEST_INT": _make_mission_reader(messages.MissionRequest, attrgetter("seq")),
    "MISSION_ACK": _make_mission_reader(messages.MissionAck, attrgetter("type"), message_readers.read_opaque_id),
    "MISSION_COUNT": _make_mission_reader(messages.MissionCount, attrgetter("count"), message_readers.read_opaque_id),
    "MISSION_ITEM_INT": _make_mission_reader(messages.MissionItemInt, message_readers.read_mission_item),
    "PARAM_ERROR": lambda frame: messages.ParamRefused(
        formatting.escape_controls(frame.param_id), absent=frame.error == mav.MAV_PARAM_ERROR_DOES_NOT_EXIST
    ),
    "COMMAND_ACK": lambda frame: messages.CommandAck(frame.command, frame.result),
    "AUTOPILOT_VERSION": _read_version,
    "MESSAGE_INTERVAL": lambda frame: messages.MessageInterval(frame.message_id, frame.interval_us > 0),
    "FILE_TRANSFER_PROTOCOL": _read_file_reply,
}


NOBODY = 255
"""Target system of a filler: a vehicle answers only messages for itself or for all."""


def _build_file_payload(request: messages.FileRequest) -> list[int]:
    head = FILE_HEAD.pack(request.number, request.session, request.operation, len(request.data), 0, 0, request.offset)
    return list((head + request.data).ljust(FILE_BYTES, b"\0"))


def _to_mavlink(message: messages.Outgoing, sysid: int, compid: int, autopilot: int | None) -> Any:  # noqa: ANN401, C901, PLR0911
    match message:
        case messages.SendHeartbeat():
            return mav.MAVLink_heartbeat_message(
                mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3
            )
        case messages.SendFiller():
            return mav.MAVLink_ping_message(1, 0, NOBODY, NOBODY)
        case messages.MissionCount(count, kind):
            return mav.MAVLink_mission_count_message(sysid, compid, count, kind)
        case messages.MissionItemInt(item, kind):
            return mav.MAVLink_mission_item_int_message(
                sysid, compid, item.seq, item.frame, item.command, int(item.current), int(item.autocontinue),
                item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, kind,
            )  # fmt: skip
        case messages.MissionRequestList(kind):
            return mav.MAVLink_mission_request_list_message(sysid, compid, kind)
        case messages.MissionRequest(seq, kind):
            return mav.MAVLink_mission_request_int_message(sysid, compid, seq, kind)
        case messages.MissionAck(result, kind):
            return mav.MAVLink_mission_ack_message(sysid, compid, result, kind)
        case messages.FileRequest():
            return mav.MAVLink_file_transfer_protocol_message(0, sysid, compid, _build_file_payload(message))
        case messages.SendCommand(command, params, confirmation):
            target = compid if message.component is None else message.component
            return mav.MAVLink_command_long_message(sysid, target, command, confirmation, *params)
        case messages.SendParamRequest(name):
            return mav.MAVLink_param_request_read_message(sysid, compid, name.encode(), -1)
        case messages.SendParamSet(name, value, kind):
            wire = frame_layout.to_wire(value, kind, autopilot)
            return mav.MAVLink_param_set_message(sysid, compid, name.encode(), wire, kind)
