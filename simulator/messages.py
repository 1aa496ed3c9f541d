"""Messages between vehicle and ground station, independent of the wire format.

Incoming messages are typed, as decisions depend on them. An outgoing message is a MAVLink name with fields; the wire
module refuses a name or field that MAVLink does not have, and a test sends every one of them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from missions.items import MissionItem


class Severity(IntEnum):
    """MAV_SEVERITY, as far as used."""

    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT, as far as used."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


class MavCommand(IntEnum):
    """MAV_CMD of supported commands."""

    NAV_LOITER_UNLIM = 17
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    DO_ORBIT = 34
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_CHANGE_ALTITUDE = 186
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_FENCE_ENABLE = 207
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    GET_HOME_POSITION = 410
    INJECT_FAILURE = 420
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    DO_SEND_BANNER = 42428


class FileOperation(IntEnum):
    """MAVFTP's opcodes."""

    NONE = 0
    TERMINATESESSION = 1
    RESETSESSION = 2
    LISTDIRECTORY = 3
    OPENFILERO = 4
    READFILE = 5
    CREATEFILE = 6
    WRITEFILE = 7
    REMOVEFILE = 8
    CREATEDIRECTORY = 9
    REMOVEDIRECTORY = 10
    OPENFILEWO = 11
    TRUNCATEFILE = 12
    RENAME = 13
    CALCFILECRC = 14
    BURSTREADFILE = 15
    ACK = 128
    NAK = 129


class MissionState(IntEnum):
    """MISSION_STATE."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


INT32_MAX = 2147483647
FieldValue = int | float | bytes | Sequence[int] | Sequence[float]

TEXT_CHUNK = 50
"""Bytes of text in one STATUSTEXT."""


@dataclass(frozen=True, slots=True)
class Peer:
    """A sender or receiver."""

    sysid: int
    compid: int
    link: int = field(default=0, compare=False)
    """Link of the vehicle."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT."""

    ground_station: bool


@dataclass(frozen=True, slots=True)
class Command:
    """COMMAND_LONG or COMMAND_INT."""

    number: int
    params: tuple[float, float, float, float, float, float, float]
    frame: int | None = None
    """MAV_FRAME of a COMMAND_INT, whose params 5 and 6 are in 1e-7 degrees; None for a COMMAND_LONG, in degrees."""

    @property
    def place_e7(self) -> tuple[int, int] | None:
        """Latitude and longitude in 1e-7 degrees; None if it names none."""
        x, y = self.params[4], self.params[5]
        if not (math.isfinite(x) and math.isfinite(y)) or (self.frame is not None and x == y == INT32_MAX):
            return None
        return (round(x * 1e7), round(y * 1e7)) if self.frame is None else (int(x), int(y))

    def integer_param(self, position: int) -> int:
        """Return a parameter as a whole number, counted from 0; -1 for NaN or infinity."""
        value = self.params[position]
        return int(value) if math.isfinite(value) else -1


@dataclass(frozen=True, slots=True)
class SetPoint:
    """SET_POSITION_TARGET_GLOBAL_INT or SET_POSITION_TARGET_LOCAL_NED."""

    frame: int
    """MAV_FRAME."""
    ignored: int
    """POSITION_TARGET_TYPEMASK."""
    place: tuple[float, float, float]
    """1e-7 degrees and metres up, or metres north, east and down."""
    velocity: tuple[float, float, float]
    """North, east and down in m/s."""
    local: bool
    """Whether the place is in metres."""


@dataclass(frozen=True, slots=True)
class SetMode:
    """SET_MODE."""

    custom_mode: int


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT."""

    count: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionWritePartialList:
    """MISSION_WRITE_PARTIAL_LIST: announces new versions of some items on board."""

    first: int
    last: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class ItemReceived:
    """MISSION_ITEM_INT, or MISSION_ITEM with its degrees turned into 1e-7 degrees."""

    item: MissionItem
    mission_type: int
    integer: bool = True
    """Whether it came as MISSION_ITEM_INT."""


@dataclass(frozen=True, slots=True)
class MissionRequestList:
    """MISSION_REQUEST_LIST."""

    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionRequest:
    """MISSION_REQUEST or MISSION_REQUEST_INT: the ground station requests an item."""

    seq: int
    mission_type: int
    integer: bool
    """Whether it requested MISSION_ITEM_INT."""


@dataclass(frozen=True, slots=True)
class MissionAckReceived:
    """MISSION_ACK."""

    result: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionClearAll:
    """MISSION_CLEAR_ALL."""

    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionSetCurrent:
    """MISSION_SET_CURRENT."""

    seq: int


@dataclass(frozen=True, slots=True)
class ParamRequestList:
    """PARAM_REQUEST_LIST."""


@dataclass(frozen=True, slots=True)
class ParamRequestRead:
    """PARAM_REQUEST_READ."""

    name: str
    index: int
    """Index; -1 if requested by name."""


@dataclass(frozen=True, slots=True)
class ParamSet:
    """PARAM_SET."""

    name: str
    raw: float
    """Value as on the wire; PX4 stores integer bits in it."""
    kind: int


@dataclass(frozen=True, slots=True)
class RequestDataStream:
    """REQUEST_DATA_STREAM."""

    stream: int
    rate_hz: int
    start: bool


@dataclass(frozen=True, slots=True)
class Timesync:
    """TIMESYNC."""

    tc1: int
    ts1: int


@dataclass(frozen=True, slots=True)
class FileRequest:
    """FILE_TRANSFER_PROTOCOL."""

    number: int
    session: int
    operation: int
    """MAVFTP's opcode."""
    offset: int
    data: bytes
    size: int = 0
    """Size to send or to read."""


@dataclass(frozen=True, slots=True)
class RadioStatus:
    """RADIO_STATUS of the vehicle's own radio."""

    txbuf_pct: int
    """Free share of its buffer."""


@dataclass(frozen=True, slots=True)
class Ping:
    """PING."""

    time_usec: int
    seq: int
    target_sysid: int


MissionMessage = (
    MissionCount | MissionWritePartialList | ItemReceived | MissionRequestList | MissionRequest | MissionAckReceived
    | MissionClearAll
)  # fmt: skip
Body = (
    Heartbeat | Command | SetMode | MissionMessage | MissionSetCurrent | ParamRequestList | ParamRequestRead | ParamSet
    | SetPoint | FileRequest | RequestDataStream | RadioStatus | Timesync | Ping
)  # fmt: skip


def describe_order(body: Body) -> str:
    """Return the change that a message commands, in a truth's words; empty if it changes nothing.

    >>> describe_order(Command(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    'order command 400 1'
    """
    match body:
        case Command(number, params):
            used = max((place + 1 for place, value in enumerate(params) if value), default=0)
            return " ".join(["order command", str(number), *(f"{value:g}" for value in params[:used])])
        case SetMode(mode):
            return f"order mode {mode}"
        case MissionCount(count):
            return f"order mission {count}"
        case FileRequest(operation=FileOperation.OPENFILEWO):
            return "order mission file"
        case MissionClearAll():
            return "order clear"
        case MissionSetCurrent(seq) | MissionWritePartialList(seq):
            return f"order item {seq}"
        case ParamSet(name):
            return f"order parameter {name}"
        case _:
            return ""


@dataclass(frozen=True, slots=True)
class Received:
    """A received message and its addressing."""

    sender: Peer
    body: Body
    component: int = 0
    """Target component; 0 is all."""


@dataclass(frozen=True, slots=True)
class Outbound:
    """An outgoing message to every listener."""

    name: str
    fields: Mapping[str, FieldValue]


def build_message(name: str, **fields: FieldValue) -> Outbound:
    """Return a message by MAVLink's names."""
    return Outbound(name, fields)


def build_command_ack(number: int, result: Result, to: Peer) -> Outbound:
    """Return a COMMAND_ACK."""
    return build_message(
        "COMMAND_ACK", command=number, result=int(result), progress=0, result_param2=0, target_system=to.sysid,
        target_component=to.compid,
    )  # fmt: skip


WITHHELD_TEXTS = 20
"""Most texts kept while no ground station is connected."""


class VehicleOutbox:
    """Collect messages until they are drained."""

    def __init__(self, *, tab: bool) -> None:
        self._outbox: list[tuple[int | None, Outbound]] = []
        """Outgoing messages with their link; None is all links."""
        self._withheld: deque[Outbound] = deque(maxlen=WITHHELD_TEXTS)
        self._tab = "\t" if tab else ""
        """PX4's texts end in a tab."""
        self._texts = 0
        self.muted = False
        """Whether texts are withheld, as PX4 does while no ground station is heard."""

    def send(self, messages: Iterable[Outbound], link: int | None = None) -> None:
        """Send messages on one link, or on all."""
        self._outbox.extend((link, message) for message in messages)

    def send_text(self, severity: int, text: str) -> None:
        """Send a text, in chunks if it is long."""
        self._texts += 1
        raw = (text + self._tab).encode("ascii", errors="replace")
        chunks = [raw[start : start + TEXT_CHUNK] for start in range(0, len(raw), TEXT_CHUNK)] or [b""]
        if len(raw) % TEXT_CHUNK == 0 and len(chunks) > 1:
            # A full last chunk has no terminating zero: without an empty chunk the reader would wait for more.
            chunks.append(b"")
        # Id that joins the chunks of a long text; a short text is sent with 0, as ArduPilot does.
        tie = (self._texts - 1) % 65535 + 1 if len(chunks) > 1 else 0
        parts = [
            build_message("STATUSTEXT", severity=severity, text=chunk, id=tie, chunk_seq=number)
            for number, chunk in enumerate(chunks)
        ]
        if self.muted:
            self._withheld.extend(parts)
        else:
            self.send(parts)

    def release_withheld(self) -> None:
        """Send the withheld texts."""
        self.muted = False
        self.send(self._withheld)
        self._withheld.clear()

    def drain(self) -> list[tuple[int | None, Outbound]]:
        """Remove and return the messages to send, each with its link; None is all links."""
        messages, self._outbox = self._outbox, []
        return messages
