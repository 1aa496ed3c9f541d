"""What vehicle and ground station say to each other, without the wire, and which of it is due when.

What comes in is typed, for decisions hang on it. What goes out is a MAVLink message by its name and fields; the wire
refuses a name or field that MAVLink does not have, and a test sends every one of them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from simulator import physics


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
    """MAV_CMD of commands, as far as understood."""

    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_PAUSE_CONTINUE = 193
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    DO_GIMBAL_MANAGER_CONFIGURE = 1001


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


FieldValue = int | float | bytes | Sequence[int] | Sequence[float]

MISSION_TYPE_MISSION = 0
TEXT_CHUNK = 50
"""Bytes of text in one STATUSTEXT."""


@dataclass(frozen=True, slots=True)
class Peer:
    """Who speaks."""

    sysid: int
    compid: int
    link: int = field(default=0, compare=False)
    """Over which of the vehicle's links."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT."""

    ground_station: bool


@dataclass(frozen=True, slots=True)
class Command:
    """COMMAND_LONG or COMMAND_INT."""

    number: int
    params: tuple[float, float, float, float, float, float, float]

    def integer_param(self, position: int) -> int:
        """Return a parameter as a whole number, counted from 0; -1 for NaN or infinity."""
        value = self.params[position]
        return int(value) if math.isfinite(value) else -1


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
class ItemReceived:
    """MISSION_ITEM_INT, or MISSION_ITEM with its degrees turned into 1e-7 degrees."""

    seq: int
    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    current: bool
    autocontinue: bool
    mission_type: int
    integer: bool = True
    """Whether it came as MISSION_ITEM_INT."""


@dataclass(frozen=True, slots=True)
class MissionRequestList:
    """MISSION_REQUEST_LIST."""

    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionRequest:
    """MISSION_REQUEST or MISSION_REQUEST_INT: the ground station wants an item."""

    seq: int
    mission_type: int
    integer: bool
    """Whether it asked for a MISSION_ITEM_INT."""


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
    """-1 when asked by name."""


@dataclass(frozen=True, slots=True)
class ParamSet:
    """PARAM_SET."""

    name: str
    raw: float
    """As on the wire: PX4 hides the bits of integers in it."""
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
    """How much it says that it sends, or wants."""


@dataclass(frozen=True, slots=True)
class RadioStatus:
    """RADIO_STATUS of the vehicle's own radio."""

    txbuf_pct: int
    """How much of its buffer is free."""


@dataclass(frozen=True, slots=True)
class Ping:
    """PING."""

    time_usec: int
    seq: int
    target_sysid: int


MissionMessage = (
    MissionCount | ItemReceived | MissionRequestList | MissionRequest | MissionAckReceived | MissionClearAll
)
Body = (
    Heartbeat | Command | SetMode | MissionMessage | MissionSetCurrent | ParamRequestList | ParamRequestRead | ParamSet
    | FileRequest | RequestDataStream | RadioStatus | Timesync | Ping
)  # fmt: skip


def describe_order(body: Body) -> str:
    """Return what a message orders, as a truth says it; empty for one that changes nothing.

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
        case MissionSetCurrent(seq):
            return f"order item {seq}"
        case ParamSet(name):
            return f"order parameter {name}"
        case _:
            return ""


@dataclass(frozen=True, slots=True)
class Received:
    """One message from somebody."""

    sender: Peer
    body: Body
    component: int = 0
    """Which of the vehicle's components it is for; 0 is all of them."""


@dataclass(frozen=True, slots=True)
class Outbound:
    """One message to everybody who listens."""

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


def build_ping_answer(ping: Ping, to: Peer) -> Outbound:
    """Return the answer to a PING."""
    return build_message(
        "PING", time_usec=ping.time_usec, seq=ping.seq, target_system=to.sysid, target_component=to.compid
    )


def split_status_text(severity: int, text: str, chunk_id: int) -> Iterator[Outbound]:
    """Yield the text in as many STATUSTEXT as it takes.

    Args:
        severity: MAV_SEVERITY.
        text: ASCII.
        chunk_id: what ties the parts of a long text together, not 0; a short text is sent with 0, as ArduPilot does.
    """
    raw = text.encode("ascii", errors="replace")
    chunks = [raw[start : start + TEXT_CHUNK] for start in range(0, len(raw), TEXT_CHUNK)] or [b""]
    if len(raw) % TEXT_CHUNK == 0 and len(chunks) > 1:
        # A last part of full length has no terminating zero: without an empty one the reader would wait for more.
        chunks.append(b"")
    for number, chunk in enumerate(chunks):
        yield build_message(
            "STATUSTEXT", severity=severity, text=chunk, id=chunk_id if len(chunks) > 1 else 0, chunk_seq=number
        )


WITHHELD_TEXTS = 20
"""Texts that a vehicle keeps for the time when somebody listens again."""


class VehicleOutbox:
    """Collects messages until they are taken away."""

    def __init__(self, *, tab: bool) -> None:
        self._outbox: list[tuple[int | None, Outbound]] = []
        """Over which of its links each goes; None is all of them."""
        self._withheld: deque[Outbound] = deque(maxlen=WITHHELD_TEXTS)
        self._tab = "\t" if tab else ""
        """PX4's texts end in a tab."""
        self._texts = 0
        self.muted = False
        """Whether texts are kept back: PX4 does so while no ground station is heard."""

    def send(self, messages: Iterable[Outbound], link: int | None = None) -> None:
        """Send messages over one of its links, or over all."""
        self._outbox.extend((link, message) for message in messages)

    def send_text(self, severity: int, text: str) -> None:
        """Send a text, in parts when it is long."""
        self._texts += 1
        chunk_id = (self._texts - 1) % 65535 + 1
        parts = split_status_text(severity, text + self._tab, chunk_id)
        if self.muted:
            self._withheld.extend(parts)
        else:
            self.send(parts)

    def release_withheld(self) -> None:
        """Send the texts that were kept back."""
        self.muted = False
        self.send(self._withheld)
        self._withheld.clear()

    def drain(self) -> list[Outbound]:
        """Take away what is to be sent."""
        return [message for _, message in self.drain_by_link()]

    def drain_by_link(self) -> list[tuple[int | None, Outbound]]:
        """Take away what is to be sent, and over which of its links; None is all of them."""
        messages, self._outbox = self._outbox, []
        return messages


MESSAGE_IDS: Mapping[str, int] = {
    "HEARTBEAT": 0, "SYS_STATUS": 1, "SYSTEM_TIME": 2, "GPS_RAW_INT": 24, "ATTITUDE": 30, "LOCAL_POSITION_NED": 32,
    "GLOBAL_POSITION_INT": 33, "MISSION_CURRENT": 42, "VFR_HUD": 74, "TIMESYNC": 111, "BATTERY_STATUS": 147,
    "AUTOPILOT_VERSION": 148, "FENCE_STATUS": 162, "WIND": 168, "EKF_STATUS_REPORT": 193, "ESTIMATOR_STATUS": 230,
    "WIND_COV": 231,    "HOME_POSITION": 242, "EXTENDED_SYS_STATE": 245,
}  # fmt: skip
MESSAGE_NAMES = {number: name for name, number in MESSAGE_IDS.items()}
STREAMS: Mapping[int, tuple[str, ...]] = {
    1: ("GPS_RAW_INT",), 2: ("SYS_STATUS", "MISSION_CURRENT", "GPS_RAW_INT"),
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"), 10: ("ATTITUDE",), 11: ("VFR_HUD",),
    12: ("BATTERY_STATUS", "SYSTEM_TIME", "EXTENDED_SYS_STATE"),
}  # fmt: skip
"""What REQUEST_DATA_STREAM asks for, by MAV_DATA_STREAM; 0 is all of it."""


FRAME_BYTES: Mapping[str, int] = {
    "SYS_STATUS": 43, "SYSTEM_TIME": 24, "GPS_RAW_INT": 64, "ATTITUDE": 40, "LOCAL_POSITION_NED": 40,
    "GLOBAL_POSITION_INT": 40, "MISSION_CURRENT": 30, "VFR_HUD": 32, "TIMESYNC": 28, "BATTERY_STATUS": 66,
    "WIND_COV": 52, "HOME_POSITION": 72, "EXTENDED_SYS_STATE": 14, "ESTIMATOR_STATUS": 54,
}  # fmt: skip
"""Of MAVLink 2 with all fields."""


class Streams:
    """The schedule of a vehicle's telemetry over one of its links, and what that link's radio makes of it."""

    def __init__(
        self,
        defaults_s: Mapping[str, float],
        now_s: float,
        slow_down: Callable[[Streams, float], float] = lambda _, interval_s: interval_s,
    ) -> None:
        """Begin; `slow_down` returns the interval that is kept, in seconds, for one that was asked for."""
        self._defaults_s, self._slow_down = defaults_s, slow_down
        self._interval_s = dict(defaults_s)
        self._due_s = dict.fromkeys(defaults_s, now_s)
        self.radio_slow_s = 0.0
        """By how much ArduPilot makes every interval longer for the radio's buffer."""
        self.radio_factor, self.radio_heard_s = 1.0, 0.0
        """What PX4 leaves of the rates of its streams for it."""

    @property
    def bytes_s(self) -> float:
        """What everything on schedule but HEARTBEAT needs, as PX4 counts it: without signatures."""
        return sum(FRAME_BYTES.get(name, 60) / one for name, one in self._interval_s.items() if name != "HEARTBEAT")

    def interval_s(self, name: str) -> float | None:
        """Return the interval, or None when the message is not sent by itself."""
        return self._interval_s.get(name)

    def set_interval(self, name: str, interval_us: float, now_s: float) -> None:
        """Follow SET_MESSAGE_INTERVAL: microseconds, 0 for the default, -1 for never."""
        if interval_us > 0:
            interval_s: float | None = interval_us * 1e-6
        else:
            interval_s = self._defaults_s.get(name) if interval_us == 0 else None
        if interval_s is None:
            self._interval_s.pop(name, None)
            self._due_s.pop(name, None)
            return
        self._interval_s[name] = interval_s
        self._due_s[name] = now_s + interval_s

    def request(self, stream: int, rate_hz: int, now_s: float) -> None:
        """Follow REQUEST_DATA_STREAM; a rate of 0 stops the stream."""
        for name in {name for number, names in STREAMS.items() if stream in {0, number} for name in names}:
            self.set_interval(name, 1e6 / rate_hz if rate_hz > 0 else -1.0, now_s)

    def schedule_now(self, name: str, now_s: float) -> None:
        """Send a streamed message now, because what it says has changed."""
        if name in self._due_s:
            self._due_s[name] = now_s

    def take_due(self, now_s: float) -> Iterator[str]:
        """Yield what is to be sent now; after a gap each message comes once, not in a burst."""
        for name, due_s in self._due_s.items():
            if due_s <= now_s + 1e-9:
                interval_s = self._interval_s[name]
                if name != "HEARTBEAT":
                    interval_s = self._slow_down(self, interval_s)
                self._due_s[name] = due_s + interval_s if due_s + interval_s > now_s else now_s + interval_s
                yield name


INT16_MAX = 32767
UINT16_MAX = 65535
UNUSED_CELLS = (UINT16_MAX,) * 9
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)


def heading_cdeg(body: physics.Body) -> int:
    """Return where its nose points, in hundredths of a degree."""
    return round(math.degrees(body.yaw_rad) * 100) % 36000


def _to_centi(value_m_s: float) -> int:
    return round(value_m_s * 100)


def build_global_position(home: physics.Home, body: physics.Body, boot_ms: int, off: tuple[float, float]) -> Outbound:
    """Return GLOBAL_POSITION_INT; `off` is how far east, and faster to the east, it takes itself to be."""
    lat, lon = home.lat_lon_e7(body.east_m + off[0], body.north_m)
    return build_message(
        "GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=lat, lon=lon, alt=round((home.alt_m + body.up_m) * 1000),
        relative_alt=round(body.up_m * 1000), vx=_to_centi(body.v_north_m_s),
        vy=_to_centi(body.v_east_m_s + off[1]), vz=_to_centi(-body.v_up_m_s), hdg=heading_cdeg(body),
    )  # fmt: skip


def build_gps_raw(home: physics.Home, body: physics.Body, boot_ms: int, *, fix: int) -> Outbound:
    """Return GPS_RAW_INT; accuracies as in the recorded flights."""
    lat, lon = home.lat_lon_e7(body.east_m, body.north_m)
    alt_mm = round((home.alt_m + body.up_m) * 1000)
    course = round(math.degrees(math.atan2(body.v_east_m_s, body.v_north_m_s)) * 100) % 36000
    return build_message(
        "GPS_RAW_INT", time_usec=boot_ms * 1000, fix_type=fix, lat=lat, lon=lon, alt=alt_mm, eph=121, epv=200,
        vel=_to_centi(body.ground_speed_m_s), cog=course, satellites_visible=10, alt_ellipsoid=alt_mm, h_acc=300,
        v_acc=300, vel_acc=0, hdg_acc=0, yaw=0,
    )  # fmt: skip


def build_battery_status(
    *,
    voltage_v: float,
    current_ca: int,
    consumed_mah: int,
    energy_hj: int,
    remaining_pct: int,
    charge_state: int,
    kind: int,
) -> Outbound:
    """Return BATTERY_STATUS as both autopilots fill it: the pack in the first cell, the rest unused.

    Args:
        voltage_v: of the pack.
        current_ca: centiamperes, -1 unknown.
        consumed_mah: -1 unknown.
        energy_hj: hectojoules, -1 unknown.
        remaining_pct: -1 unknown.
        charge_state: MAV_BATTERY_CHARGE_STATE.
        kind: MAV_BATTERY_TYPE, and function: 0 unknown, 1 lithium polymer for everything.
    """
    return build_message(
        "BATTERY_STATUS", id=0, battery_function=kind, type=kind, temperature=INT16_MAX,
        voltages=(round(voltage_v * 1000), *UNUSED_CELLS), current_battery=current_ca, current_consumed=consumed_mah,
        energy_consumed=energy_hj, battery_remaining=remaining_pct, time_remaining=0, charge_state=charge_state,
        voltages_ext=(0, 0, 0, 0), mode=0, fault_bitmask=0,
    )  # fmt: skip


def build_sys_status(
    sensors: tuple[int, int, int], *, voltage_v: float, current_ca: int, remaining_pct: int
) -> Outbound:
    """Return SYS_STATUS; ``sensors`` is (present, enabled, healthy)."""
    return build_message(
        "SYS_STATUS", onboard_control_sensors_present=sensors[0], onboard_control_sensors_enabled=sensors[1],
        onboard_control_sensors_health=sensors[2], load=0, voltage_battery=round(voltage_v * 1000),
        current_battery=current_ca, battery_remaining=remaining_pct, drop_rate_comm=0, errors_comm=0, errors_count1=0,
        errors_count2=0, errors_count3=0, errors_count4=0,
    )  # fmt: skip


def build_autopilot_version(*, capabilities: int, version: tuple[int, int, int, int], uid: int) -> Outbound:
    """Return AUTOPILOT_VERSION; ``version`` is three numbers and FIRMWARE_VERSION_TYPE."""
    software = version[0] << 24 | version[1] << 16 | version[2] << 8 | version[3]
    return build_message(
        "AUTOPILOT_VERSION", capabilities=capabilities, flight_sw_version=software, middleware_sw_version=software,
        os_sw_version=0, board_version=0, flight_custom_version=(0,) * 8, middleware_custom_version=(0,) * 8,
        os_custom_version=(0,) * 8, vendor_id=0, product_id=0, uid=uid, uid2=(uid, *(0,) * 17),
    )  # fmt: skip
