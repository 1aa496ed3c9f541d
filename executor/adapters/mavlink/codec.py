"""MAVLink frames to our messages and back: the only place where pymavlink is used to fly.

Only pymavlink's codec class is used: its connections block. Whatever a vehicle marks as unknown becomes None here, and
so does what it cannot mean; of its components the autopilot alone speaks for it, and no text has what a terminal obeys.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink import camera_messages, integers, px4_events
from executor.adapters.mavlink.frame_parser import FrameParser
from executor.adapters.mavlink.signing import FrameRejection, LinkSigning
from executor.adapters.mavlink.statustext import StatusTextAssembler
from executor.core import formatting
from executor.core.interface.messages import (
    GROUND_STATION,
    Attitude,
    Battery,
    CameraHeard,
    CommandAck,
    EstimatorStatus,
    FenceStatus,
    Gps,
    Heartbeat,
    HeightTarget,
    Home,
    LandedState,
    Message,
    MissionAck,
    MissionCount,
    MissionCurrent,
    MissionItemReceived,
    MissionReached,
    MissionRequest,
    ModeChange,
    OrderSeen,
    Outgoing,
    OwnFailsafe,
    ParamRefused,
    ParamValue,
    Position,
    Radio,
    RcChannels,
    SendCommand,
    SendHeartbeat,
    SendMissionAck,
    SendMissionCount,
    SendMissionItem,
    SendMissionRequest,
    SendMissionRequestList,
    SendParamRequest,
    SendParamSet,
    StationHeard,
    SystemStatus,
    Version,
    Wind,
)
from executor.core.interface.recorded_log import MODE_COMMANDS
from executor.core.telemetry.autopilot_component import (
    AutopilotComponent,
    select_component_message,
    update_autopilot_component,
)
from executor.core.telemetry.plausibility import filter_implausible
from missions import MissionItem, MissionKind
from missions.cameras import FIRST_COMPONENT

_KINDS = {int(kind): kind for kind in MissionKind}
"""MAV_MISSION_TYPE of the lists that are followed here."""
PREARM_CHECK = 0x10000000
POS_HORIZ_ABS, CONST_POS_MODE = 16, 128
"""Of EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS."""
NO_SATELLITES = 255
"""Of satellites_visible: nobody knows."""
RADIO = "RADIO_STATUS"
_RELEASES = {0: "dev", 64: "alpha", 128: "beta", 192: "rc"}
"""FIRMWARE_VERSION_TYPE; 255, official, goes without a word."""


Sender = tuple[int, int]
"""System and component that a frame names as its sender."""


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """One frame that was understood."""

    sysid: int
    compid: int
    seq: int
    frame: bytes
    message: Message | None
    """None for a message that nobody here follows."""
    more: tuple[Message, ...] = ()
    """What else this frame brings to an end: a text whose last part never came."""
    own: bool = True
    """Whether the vehicle's autopilot says it, not another component, or a radio on the way."""
    refused: FrameRejection | None = None
    """Why it is not believed, where frames must be signed."""


class MavlinkCodec:
    """Frames of all vehicles behind one endpoint to messages, and messages to their frames."""

    def __init__(
        self,
        signing: LinkSigning | None = None,
        radios: Collection[Sender] | None = None,
        systems: Collection[int] | None = None,
    ) -> None:
        """Begin knowing nobody.

        Args:
            signing: Frames are signed with it, both ways.
            radios: Whose RADIO_STATUS is taken without a signature: of these, or, if it is None, of everybody where
                nothing is signed and of nobody where frames are.
            systems: Whose frames are read, everybody's if None; see `FrameParser`.
        """
        self.systems = systems
        self._signing = signing
        self._radios = radios
        system, component = GROUND_STATION
        self._mav = mav.MAVLink(None, srcSystem=system, srcComponent=component)
        self._datagrams = FrameParser(in_datagrams=True, systems=systems)
        self._texts = StatusTextAssembler()
        self._sent: dict[int, int] = {}
        """How many frames went to each system: each is numbered as a stream of its own."""
        self._speakers: dict[int, AutopilotComponent] = {}
        self._events: dict[int, px4_events.Px4EventDecoder] = {}
        self.autopilots: dict[int, int] = {}
        """MAV_AUTOPILOT of each system, once its heartbeat was heard: they pack integer parameters in two ways."""
        self.garbage = 0
        """Runs of bytes in datagrams that could not be understood."""

    def decode(self, data: bytes) -> Iterator[DecodedFrame]:
        """Yield every frame of a datagram; no frame goes on in the next."""
        frames = self._datagrams.feed(data)
        self.garbage = self._datagrams.close()
        yield from self.read(frames)

    def read(self, frames: Iterable[Any]) -> Iterator[DecodedFrame]:
        """Yield what a `FrameParser`'s frames say."""
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
            more: list[Message] = [*self._texts.count_frame(source)]
            message = self._parse_message(frame)
            if isinstance(message, Heartbeat):
                self._follow_speaker(source, message)
            if frame.get_type() == "COMMAND_ACK":
                more += self._parse_acknowledged_order(frame)
            elif isinstance(frame, mav.MAVLink_unknown):
                more += self._parse_px4_event(frame)
            if frame.get_type() == "STATUSTEXT":
                # The raw field: pymavlink's own reading loses every byte that is not ASCII.
                raw = frame._text_raw  # noqa: SLF001
                more += self._texts.add_part(source, frame.severity, raw, frame.id, frame.chunk_seq)
            speaker = self._speakers.get(source[0], AutopilotComponent())
            said = [select_component_message(speaker, source[1], one) for one in (message, *more) if one is not None]
            heard = [one for one in said if one is not None]
            own = source[1] == speaker.component and frame.get_type() != RADIO
            first = heard.pop(0) if heard else None
            yield DecodedFrame(*source, frame.get_seq(), bytes(frame.get_msgbuf()), first, tuple(heard), own)

    def _find_rejection(self, frame: Any, source: Sender) -> FrameRejection | None:  # noqa: ANN401
        if self._signing is None:
            return None
        refusal = self._signing.check_signature(bytes(frame.get_msgbuf()), *source)
        if refusal is FrameRejection.UNSIGNED and frame.get_type() == RADIO and source in (self._radios or ()):
            return None
        return refusal

    def _follow_speaker(self, source: Sender, beat: Heartbeat) -> None:
        system, component = source
        speaker = self._speakers[system] = update_autopilot_component(
            self._speakers.get(system, AutopilotComponent()), component, beat
        )
        if speaker.component == component:
            self.autopilots[system] = beat.autopilot

    def encode(self, message: Outgoing, sysid: int, compid: int) -> bytes:
        """Return the frame of a message to one vehicle."""
        self._mav.seq = self._sent.get(sysid, 0)
        self._sent[sysid] = (self._mav.seq + 1) % 256
        if self._signing is not None:
            self._signing.prepare(self._mav)
        return bytes(_to_mavlink(message, sysid, compid, self.autopilots.get(sysid)).pack(self._mav))

    def read_fields(
        self, name: str, sysid: int, compid: int, fields: Mapping[str, object]
    ) -> tuple[bytes, tuple[Message, ...]] | None:
        """Return a frame of a message that another parser took apart, and what it says; None if it is not known.

        Args:
            name: MAVLink's name of the message.
            sysid: who sent it.
            compid: its component.
            fields: by MAVLink's names; None stands for a float that is not finite.
        """
        if name == px4_events.NAME:
            return self._read_event(sysid, compid, fields)
        kind = _BY_NAME.get(name)
        if kind is None:
            return None
        try:
            frame = kind(*(_to_field(fields.get(field)) for field in kind.fieldnames))
            packed = bytes(frame.pack(mav.MAVLink(None, srcSystem=sysid, srcComponent=compid)))
        except (struct.error, TypeError, AttributeError):
            return None  # another parser's definition of the message is another one
        lost = name == "PARAM_VALUE" and fields["param_value"] is None and frame.param_type in integers.INTEGER_TYPES
        [received] = self.read([frame])
        message = ParamRefused(formatting.escape_controls(frame.param_id), absent=False) if lost else received.message
        said = (message, *received.more)
        return packed, tuple(one for one in said if one is not None)

    def _read_event(
        self, sysid: int, compid: int, fields: Mapping[str, object]
    ) -> tuple[bytes, tuple[Message, ...]] | None:
        packed = px4_events.build_event_frame(fields, sysid, compid)
        if packed is None:
            return None
        [received] = self.read(FrameParser(in_datagrams=True).feed(packed))
        return packed, tuple(one for one in (received.message, *received.more) if one is not None)

    def write_fields(
        self, message: Outgoing, sysid: int, compid: int
    ) -> tuple[str, Mapping[str, object], bytes] | None:
        """Return the name, fields and frame of a message; None if its fields as numbers would not be the same."""
        packed = self.encode(message, sysid, compid)
        frame = self._mav.decode(bytearray(packed))
        fields = {
            field: None if isinstance(value := getattr(frame, field), float) and not math.isfinite(value) else value
            for field in frame.fieldnames
        }
        if isinstance(message, SendParamSet) and fields["param_value"] is None:
            return None
        return frame.get_type(), fields, packed

    def _parse_message(self, frame: Any) -> Message | None:  # noqa: ANN401 - pymavlink's classes are generated and untyped
        if frame.get_type() in _ORDERS:
            return self._parse_order(frame)
        if not _is_for_us(frame):
            return None
        if frame.get_type() == "PARAM_VALUE":
            name = formatting.escape_controls(frame.param_id)
            value = integers.from_wire(frame.param_value, frame.param_type, self.autopilots.get(frame.get_srcSystem()))
            return filter_implausible(ParamValue(name, value, frame.param_type)) or ParamRefused(name, absent=False)
        if frame.get_type() == RADIO and not self._is_accepted_radio(frame):
            return None
        read = _READERS.get(frame.get_type())
        message = None if read is None else read(frame)
        return None if message is None else filter_implausible(message)

    def _parse_order(self, frame: Any) -> OrderSeen | None:  # noqa: ANN401
        """Return what another station orders, if that changes a mode."""
        # Under our own number it may be a router's echo of ours.
        source = (frame.get_srcSystem(), frame.get_srcComponent())
        by, target, mode = None if source == GROUND_STATION else source[0], frame.target_system, None
        if frame.get_type() == "SET_MODE":
            return OrderSeen(mav.MAV_CMD_DO_SET_MODE, frame.custom_mode, by, target)
        main, sub = frame.param2, frame.param3
        if frame.command == mav.MAV_CMD_DO_SET_MODE and all(0 <= one < MOST_MODES for one in (main, sub)):
            px4 = self.autopilots.get(target) == mav.MAV_AUTOPILOT_PX4
            mode = int(main) << 16 | int(sub) << 24 if px4 else int(main)
        return OrderSeen(frame.command, mode, by, target) if frame.command in MODE_COMMANDS else None

    def _parse_acknowledged_order(self, ack: Any) -> Iterator[OrderSeen]:  # noqa: ANN401
        """Yield the order that an autopilot says it follows, if that changes a mode."""
        system, to = ack.get_srcSystem(), ack.target_system
        command = mav.MAV_CMD_DO_SET_MODE if ack.command == mav.MAVLINK_MSG_ID_SET_MODE else ack.command
        if ack.get_srcComponent() != self._speakers.get(system, AutopilotComponent()).component or to == system:
            return  # of a gimbal, or to a computer on board
        if command in MODE_COMMANDS and ack.result in ACCEPTED:
            yield OrderSeen(command, None, None if _is_for_us(ack) else to, system)

    def _parse_px4_event(self, unknown: Any) -> Iterator[OwnFailsafe | ModeChange]:  # noqa: ANN401
        """Yield what an event of PX4 is evidence of."""
        raw, system = bytes(unknown.get_msgbuf()), unknown.get_srcSystem()
        if not px4_events.is_event(raw) or self.autopilots.get(system) != mav.MAV_AUTOPILOT_PX4:
            return
        number, boot_ms, sequence, *_, arguments = px4_events.LAYOUT.unpack(px4_events.payload_of(raw))
        said = self._events.setdefault(system, px4_events.Px4EventDecoder()).decode(
            number, boot_ms, sequence, arguments
        )
        if said is not None:
            yield said

    def _is_accepted_radio(self, radio: Any) -> bool:  # noqa: ANN401
        named = self._radios is None or (radio.get_srcSystem(), radio.get_srcComponent()) in self._radios
        return named or self._signing is not None  # which has let it through


_ORDERS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
ACCEPTED = frozenset({mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_IN_PROGRESS})
MOST_MODES = 128
_BY_NAME = {kind.msgname: kind for kind in mav.mavlink_map.values()}


def _to_field(value: object) -> object:
    if isinstance(value, str):
        return value.encode()
    if isinstance(value, list):
        return [_to_field(one) for one in value]
    return math.nan if value is None else value


def _read_channels(frame: Any) -> RcChannels:  # noqa: ANN401
    values = (getattr(frame, f"chan{number}_raw") for number in range(1, min(18, frame.chancount) + 1))
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in values))


NO_CHANNEL = 65535


def _is_for_us(frame: Any) -> bool:  # noqa: ANN401
    """Return whether a message is not addressed to another ground station's dialogue; 0 is everybody."""
    ours = zip(("target_system", "target_component"), GROUND_STATION, strict=True)
    return all(getattr(frame, field, 0) in {0, number} for field, number in ours)


def _to_percent(value: float) -> float | None:
    return value if 0 <= value <= 100 else None


def _read_heartbeat(frame: Any) -> Heartbeat | StationHeard | CameraHeard | None:  # noqa: ANN401
    if frame.type == mav.MAV_TYPE_GCS:
        return StationHeard(frame.get_srcSystem(), frame.get_srcComponent())
    if frame.autopilot == mav.MAV_AUTOPILOT_INVALID:
        component = frame.get_srcComponent()
        return CameraHeard(component) if frame.type == mav.MAV_TYPE_CAMERA and component >= FIRST_COMPONENT else None
    armed = bool(frame.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)
    return Heartbeat(frame.autopilot, frame.custom_mode, armed, frame.system_status, frame.type)


def _read_position(frame: Any) -> Position:  # noqa: ANN401
    return Position(
        boot_s=frame.time_boot_ms / 1e3,
        lat_deg=frame.lat / 1e7,
        lon_deg=frame.lon / 1e7,
        alt_msl_m=frame.alt / 1e3,
        alt_rel_m=frame.relative_alt / 1e3,
        north_m_s=frame.vx / 100,
        east_m_s=frame.vy / 100,
        down_m_s=frame.vz / 100,
        heading_deg=None if frame.hdg == 65535 else frame.hdg / 100,
    )


def _read_battery(frame: Any) -> Battery:  # noqa: ANN401
    cells = [cell for cell in frame.voltages if cell != 65535]
    cells += [cell for cell in getattr(frame, "voltages_ext", ()) if cell not in {0, 65535}]
    return Battery(
        battery=frame.id,
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=sum(cells) / 1e3 if cells else None,
        current_a=None if frame.current_battery < 0 else frame.current_battery / 100,
        consumed_ah=None if frame.current_consumed < 0 else frame.current_consumed / 1e3,
        charge_state=getattr(frame, "charge_state", 0),
        faults=getattr(frame, "fault_bitmask", 0),
        cells_v=tuple(cell / 1e3 for cell in cells) if len(cells) > 1 else (),
    )


def _read_attitude(frame: Any) -> Attitude:  # noqa: ANN401
    return Attitude(math.degrees(frame.roll), math.degrees(frame.pitch))


def _read_gps(frame: Any, receiver: int = 0) -> Gps:  # noqa: ANN401
    satellites, off_mm = frame.satellites_visible, getattr(frame, "h_acc", 0)
    return Gps(
        frame.fix_type,
        None if satellites == NO_SATELLITES else satellites,
        accuracy_m=off_mm / 1e3 or None,
        measured_s=frame.time_usec / 1e6 or None,
        receiver=receiver,
    )


def _estimator(frame: Any) -> EstimatorStatus:  # noqa: ANN401
    """Read flags that both autopilots number alike, as far as these two go."""
    return EstimatorStatus(frame.flags & (POS_HORIZ_ABS | CONST_POS_MODE) == POS_HORIZ_ABS)


def _read_wind(frame: Any) -> Wind:  # noqa: ANN401
    return Wind(frame.speed, frame.direction % 360)


def _read_wind_cov(frame: Any) -> Wind:  # noqa: ANN401
    """Read where the air moves to, north and east, as where it comes from."""
    north_m_s, east_m_s = frame.wind_x, frame.wind_y
    from_deg = math.degrees(math.atan2(-east_m_s, -north_m_s)) % 360
    return Wind(math.hypot(north_m_s, east_m_s), from_deg)


def _read_fence_status(frame: Any) -> FenceStatus | None:  # noqa: ANN401
    return FenceStatus(bool(frame.breach_status)) if frame.breach_status in {0, 1} else None


def _read_mission_id(frame: bytes | None) -> int | None:
    """Read the uint32 behind what pymavlink knows of MISSION_CURRENT; MAVLink 2 leaves zeros at the end out."""
    if not frame or frame[0] != mav.PROTOCOL_MARKER_V2:
        return None
    payload = bytes(frame[10 : 10 + frame[1]]).ljust(10, b"\0")
    return int.from_bytes(payload[6:10], "little") or None


def _read_system_status(frame: Any) -> SystemStatus:  # noqa: ANN401
    enabled, healthy = frame.onboard_control_sensors_enabled, frame.onboard_control_sensors_health
    present = bool(frame.onboard_control_sensors_present & PREARM_CHECK)
    return SystemStatus(
        # PX4 reports 65535 V and -1 % without a battery, ArduPilot 0 V and -1 % in its first seconds.
        remaining_pct=_to_percent(frame.battery_remaining),
        voltage_v=None if frame.voltage_battery in {0, 65535} else frame.voltage_battery / 1e3,
        unhealthy=enabled & ~healthy,
        prearm_ok=bool(healthy & PREARM_CHECK) if present else None,
        current_a=None if frame.current_battery == -1 else max(0.0, frame.current_battery / 100),
    )


def _read_mission_item(frame: Any) -> MissionItemReceived | None:  # noqa: ANN401
    kind = _KINDS.get(frame.mission_type)
    if kind is None:
        return None
    return MissionItemReceived(
        MissionItem(
            seq=frame.seq,
            frame=frame.frame,
            command=frame.command,
            param1=frame.param1,
            param2=frame.param2,
            param3=frame.param3,
            param4=frame.param4,
            x=frame.x,
            y=frame.y,
            z=frame.z,
            current=bool(frame.current),
            autocontinue=bool(frame.autocontinue),
        ),
        kind,
    )


def _make_mission_reader(build: Callable[[int, MissionKind], Message], field: str) -> Any:  # noqa: ANN401
    def read(frame: Any) -> Message | None:  # noqa: ANN401
        kind = _KINDS.get(frame.mission_type)
        return None if kind is None else build(getattr(frame, field), kind)

    return read


def _read_version(frame: Any) -> Version | None:  # noqa: ANN401
    packed = frame.flight_sw_version
    if packed == 0:
        return None  # not filled in
    return Version(packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255, _RELEASES.get(packed & 255, ""))


def _read_radio(frame: Any) -> Radio:  # noqa: ANN401
    values = (frame.rssi, frame.remrssi, frame.noise, frame.remnoise)
    rssi, remote, noise, remote_noise = (None if value == 255 else value for value in values)
    return Radio(rssi, remote, noise, remote_noise, frame.txbuf if frame.txbuf <= 100 else None)


_READERS: dict[str, Any] = {
    "RADIO_STATUS": _read_radio,
    "HEARTBEAT": _read_heartbeat,
    "GLOBAL_POSITION_INT": _read_position,
    "BATTERY_STATUS": _read_battery,
    "SYS_STATUS": _read_system_status,
    "EXTENDED_SYS_STATE": lambda frame: LandedState({1: True, 2: False, 3: False, 4: False}.get(frame.landed_state)),
    "ATTITUDE": _read_attitude,
    "NAV_CONTROLLER_OUTPUT": lambda frame: HeightTarget(frame.alt_error),
    "GPS_RAW_INT": _read_gps,
    "GPS2_RAW": lambda frame: _read_gps(frame, 1),
    "EKF_STATUS_REPORT": _estimator,
    "ESTIMATOR_STATUS": _estimator,
    "WIND_COV": _read_wind_cov,
    "WIND": _read_wind,
    "FENCE_STATUS": _read_fence_status,
    "HOME_POSITION": lambda frame: Home(frame.latitude / 1e7, frame.longitude / 1e7, frame.altitude / 1e3),
    "MISSION_CURRENT": lambda frame: MissionCurrent(
        frame.seq, getattr(frame, "total", 0) or None, _read_mission_id(frame.get_msgbuf())
    ),
    "MISSION_ITEM_REACHED": lambda frame: MissionReached(frame.seq),
    "MISSION_REQUEST": _make_mission_reader(MissionRequest, "seq"),
    "MISSION_REQUEST_INT": _make_mission_reader(MissionRequest, "seq"),
    "MISSION_ACK": _make_mission_reader(MissionAck, "type"),
    "MISSION_COUNT": _make_mission_reader(MissionCount, "count"),
    "MISSION_ITEM_INT": _read_mission_item,
    "RC_CHANNELS": _read_channels,
    **camera_messages.READERS,
    "PARAM_ERROR": lambda frame: ParamRefused(
        formatting.escape_controls(frame.param_id), absent=frame.error == mav.MAV_PARAM_ERROR_DOES_NOT_EXIST
    ),
    "COMMAND_ACK": lambda frame: CommandAck(frame.command, frame.result),
    "AUTOPILOT_VERSION": _read_version,
}


def _to_mavlink(message: Outgoing, sysid: int, compid: int, autopilot: int | None) -> Any:  # noqa: ANN401, PLR0911
    match message:
        case SendHeartbeat():
            return mav.MAVLink_heartbeat_message(
                mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3
            )
        case SendMissionCount(count, kind):
            return mav.MAVLink_mission_count_message(sysid, compid, count, kind)
        case SendMissionItem(item, kind):
            return mav.MAVLink_mission_item_int_message(
                sysid, compid, item.seq, item.frame, item.command, int(item.current), int(item.autocontinue),
                item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, kind,
            )  # fmt: skip
        case SendMissionRequestList(kind):
            return mav.MAVLink_mission_request_list_message(sysid, compid, kind)
        case SendMissionRequest(seq, kind):
            return mav.MAVLink_mission_request_int_message(sysid, compid, seq, kind)
        case SendMissionAck(result, kind):
            return mav.MAVLink_mission_ack_message(sysid, compid, result, kind)
        case SendCommand(command, params, confirmation):
            target = compid if message.component is None else message.component
            return mav.MAVLink_command_long_message(sysid, target, command, confirmation, *params)
        case SendParamRequest(name):
            return mav.MAVLink_param_request_read_message(sysid, compid, name.encode(), -1)
        case SendParamSet(name, value, kind):
            wire = integers.to_wire(value, kind, autopilot)
            return mav.MAVLink_param_set_message(sysid, compid, name.encode(), wire, kind)
