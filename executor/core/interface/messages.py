"""Define the messages from and to vehicles, in SI units; the codec converts them from and to MAVLink frames.

Unknown is ``None``, never zero: both autopilots send -1, -100, 65535 or 0 for values they do not have.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from missions.cameras import PictureProof
from missions.items import MissionItem, MissionKind

GROUND_STATION = (255, 190)
"""System and component without a `station_sysid` in the site file: ArduPilot's GCS failsafe counts only HEARTBEATs of
MAV_GCS_SYSID, 255 by default."""


BOOT = 1
"""MAV_STATE_BOOT: ArduPilot sends it while it starts, and never again."""
CRITICAL = 5
"""MAV_STATE_CRITICAL: both autopilots send it, or a higher one, while a failsafe is active (measured)."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT of an autopilot component."""

    autopilot: int
    """MAV_AUTOPILOT: 3 ArduPilot, 12 PX4."""
    custom_mode: int
    armed: bool
    system_status: int
    """MAV_STATE: 3 standby, 4 active, 5 critical, 6 emergency, 8 flight terminated."""
    vehicle_type: int | None = None
    """MAV_TYPE; None in logs from before it was recorded."""


@dataclass(frozen=True, slots=True)
class Position:
    """GLOBAL_POSITION_INT."""

    boot_s: float
    """The vehicle's own clock, seconds since boot."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    alt_rel_m: float
    """Above the vehicle's own home."""
    north_m_s: float
    east_m_s: float
    down_m_s: float
    heading_deg: float | None


@dataclass(frozen=True, slots=True)
class Battery:
    """BATTERY_STATUS."""

    battery: int
    remaining_pct: float | None
    voltage_v: float | None
    """Of the whole pack."""
    current_a: float | None
    consumed_ah: float | None
    charge_state: int
    """MAV_BATTERY_CHARGE_STATE: 0 unknown, 1 ok, 2 low, 3 critical, 4 emergency, 5 failed, 6 unhealthy."""
    faults: int
    """MAV_BATTERY_FAULT bits."""
    cells_v: tuple[float, ...] = ()
    """Each cell, where the vehicle measures them; most report the pack alone."""


@dataclass(frozen=True, slots=True)
class SystemStatus:
    """SYS_STATUS."""

    remaining_pct: float | None
    voltage_v: float | None
    unhealthy: int
    """MAV_SYS_STATUS_SENSOR bits of sensors enabled and not healthy."""
    prearm_ok: bool | None
    """MAV_SYS_STATUS_PREARM_CHECK, None where the vehicle does not report it."""
    current_a: float | None = None


@dataclass(frozen=True, slots=True)
class LandedState:
    """EXTENDED_SYS_STATE."""

    on_ground: bool | None


@dataclass(frozen=True, slots=True)
class Attitude:
    """ATTITUDE."""

    roll_deg: float
    pitch_deg: float


@dataclass(frozen=True, slots=True)
class Gps:
    """GPS_RAW_INT, GPS2_RAW."""

    fix: int
    """GPS_FIX_TYPE: 0 no GPS, 1 no fix, 2 two-dimensional, 3 three-dimensional, 4 differential, 5 and 6 RTK."""
    satellites: int | None
    accuracy_m: float | None = None
    """Horizontal accuracy, as the receiver reports it."""
    measured_s: float | None = None
    """When the fix was measured, by the receiver's or the vehicle's clock; it does not advance without a new fix."""
    receiver: int = 0
    """Number of the receiver."""


@dataclass(frozen=True, slots=True)
class EstimatorStatus:
    """EKF_STATUS_REPORT of ArduPilot, ESTIMATOR_STATUS of PX4."""

    is_absolute: bool
    """Whether its global position is known, and its GPS is not rejected."""


@dataclass(frozen=True, slots=True)
class Wind:
    """WIND_COV of PX4, WIND of ArduPilot."""

    speed_m_s: float
    from_deg: float
    """Direction the wind comes from, clockwise from north."""


@dataclass(frozen=True, slots=True)
class FenceStatus:
    """FENCE_STATUS."""

    breached: bool


@dataclass(frozen=True, slots=True)
class Home:
    """HOME_POSITION."""

    lat_deg: float
    lon_deg: float
    alt_msl_m: float


NO_ITEM = 65535
"""Mission item number for none, or unknown."""


@dataclass(frozen=True, slots=True)
class MissionCurrent:
    """MISSION_CURRENT."""

    seq: int
    total: int | None
    mission_id: int | None = None
    """A checksum of the items; only PX4 sends it."""


@dataclass(frozen=True, slots=True)
class MissionReached:
    """MISSION_ITEM_REACHED."""

    seq: int


@dataclass(frozen=True, slots=True)
class MissionRequest:
    """MISSION_REQUEST or MISSION_REQUEST_INT, by the downloading side; both are answered with MISSION_ITEM_INT."""

    seq: int
    kind: MissionKind = MissionKind.MISSION


@dataclass(frozen=True, slots=True)
class MissionAck:
    """MISSION_ACK, by the downloading side: closes a transfer (0), or cancels it (15)."""

    result: int
    """MAV_MISSION_RESULT."""
    kind: MissionKind = MissionKind.MISSION
    checksum: int | None = None
    """`opaque_id` of the accepted list; None from a vehicle that has none."""


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT: opens an upload, and answers a request for the list."""

    count: int
    kind: MissionKind = MissionKind.MISSION
    checksum: int | None = None
    """`opaque_id` of the list on board; None from a vehicle that has none."""


@dataclass(frozen=True, slots=True)
class MissionItemInt:
    """MISSION_ITEM_INT, during an upload or a download."""

    item: MissionItem
    kind: MissionKind = MissionKind.MISSION


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK."""

    command: int
    result: int
    """MAV_RESULT: 0 accepted, 1 temporarily rejected, 2 denied, 3 unsupported, 4 failed, 5 in progress."""


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT, chunks put together."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class ComponentText:
    """STATUSTEXT of a component of the vehicle other than its autopilot."""

    component: int
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames received and missing since the last such message, by sequence number."""

    received: int
    missing: int
    link_bytes: int = 0
    """Bytes of all frames in both directions; 0 where they are not counted."""
    round_trip_s: float | None = None
    """Round trip of our requests, where one was measured since."""


@dataclass(frozen=True, slots=True)
class Radio:
    """RADIO_STATUS of our end of the link, in the device's units; None for unknown values."""

    rssi: int | None
    remote_rssi: int | None
    noise: int | None
    remote_noise: int | None
    free_buffer_pct: int | None


@dataclass(frozen=True, slots=True)
class OrderSeen:
    """A command to the vehicle by another ground station, or its acceptance.

    COMMAND_ACK may be its only trace: a listener to the vehicle alone does not receive the command.
    """

    command: int
    """MAV_CMD; 176 also for the older SET_MODE."""
    custom_mode: int | None = None
    """The mode it commands, if any."""
    by: int | None = None
    """The commanding system; None where it cannot be distinguished from us: it has our id, or the answer names none."""
    to: int = 0
    """The addressed system, where a connection carries several; 0 for all."""


class Actor(Enum):
    """The party that changed a mode, by the autopilot's own record."""

    PILOT = "pilot"
    """With the transmitter: its mode switch or sticks."""
    GROUND_STATION = "ground station"
    FAILSAFE = "failsafe"
    MISSION = "mission"
    """The end of a mission, or one of its items."""
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class ModeChange:
    """The autopilot's own record of a mode change: MODE of DataFlash with its reason, or PX4's report."""

    custom_mode: int | None
    """None if not named: the mode in its HEARTBEAT at that time."""
    by: Actor


@dataclass(frozen=True, slots=True)
class RcChannels:
    """RC_CHANNELS, RC_CHANNELS_RAW or RCIN: the channels of the pilot's transmitter."""

    values_us: tuple[int, ...]
    """From channel 1 on; 0 where there is none."""


@dataclass(frozen=True, slots=True)
class VehicleSetting:
    """A parameter of the vehicle that was overheard, or read in its own log: we did not request it."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class ListedItem:
    """An item of the vehicle's mission that was overheard, or read in its own log: we did not request it."""

    item: MissionItem


@dataclass(frozen=True, slots=True)
class HeightTarget:
    """NAV_CONTROLLER_OUTPUT, POSITION_TARGET_LOCAL_NED, or their log records: the height that the autopilot wants.

    ArduPilot moves its target along with a vehicle that cannot follow: it is never more than some metres away.
    """

    below_m: float
    """Distance of the vehicle below it; negative above it."""


@dataclass(frozen=True, slots=True)
class OwnFailsafe:
    """The autopilot's own record of a failsafe: ERR of DataFlash, failsafe flags of PX4."""

    what: str
    """battery, crash, ekf, gps, compass, motor, rc, ground station, fence, terrain, vibration, attitude or other."""
    active: bool
    words: str
    """For people to read."""


@dataclass(frozen=True, slots=True)
class ParamValue:
    """PARAM_VALUE."""

    name: str
    value: float
    kind: int
    """MAV_PARAM_TYPE."""


@dataclass(frozen=True, slots=True)
class ParamRefused:
    """PARAM_ERROR, or a PARAM_VALUE that is not a number: an answer without a value."""

    name: str
    absent: bool
    """Whether the vehicle reports that it does not have it."""


@dataclass(frozen=True, slots=True)
class Version:
    """AUTOPILOT_VERSION."""

    major: int
    minor: int
    patch: int
    release: str = ""
    """dev, alpha, beta or rc; empty for an official release, or if unknown."""

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}" + (f"-{self.release}" if self.release else "")


@dataclass(frozen=True, slots=True)
class StationHeard:
    """HEARTBEAT of another ground station, passed on by the vehicle or a router."""

    system: int
    component: int
    behind: bool = False
    """Whether it is behind `[forward]`, and is received only through us."""


@dataclass(frozen=True, slots=True)
class StationActed:
    """An action of a ground station behind `[forward]` that changes the vehicle, or was blocked."""

    system: int
    """0 for a port without a station."""
    component: int
    words: str
    """The action, or why it was blocked."""
    passed: bool = True
    """Whether the vehicle receives it."""


@dataclass(frozen=True, slots=True)
class DoubleHeard:
    """Two vehicles with the same sysid: frames alternate between two addresses, or positions alternate."""

    system: int
    """0 where the observer does not know it."""
    places: tuple[str, ...]
    """The addresses; empty if both use one."""


@dataclass(frozen=True, slots=True)
class PictureTaken:
    """CAMERA_IMAGE_CAPTURED, CAMERA_FEEDBACK or CAMERA_TRIGGER: a camera took a picture, or failed to."""

    source: PictureProof
    component: int
    """The component that reports it."""
    camera: int
    """For a camera at the autopilot its number, from 1; 0 if not reported."""
    sequence: int
    ok: bool
    boot_s: float | None
    """By the vehicle's own clock."""
    unix_s: float | None
    """By the camera's clock, seconds since 1970."""
    lat_deg: float | None = None
    lon_deg: float | None = None
    alt_msl_m: float | None = None
    alt_rel_m: float | None = None
    roll_deg: float | None = None
    """Roll of the camera where it reports its own attitude, else of the vehicle; likewise the next two."""
    pitch_deg: float | None = None
    yaw_deg: float | None = None
    file: str = ""
    """The camera's name for it."""


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """CAMERA_CAPTURE_STATUS or STORAGE_INFORMATION."""

    component: int
    films: bool | None
    images: int | None
    """Pictures taken so far."""
    free_mib: float | None
    """Space left on its card."""


@dataclass(frozen=True, slots=True)
class CameraHeard:
    """HEARTBEAT of a camera."""

    component: int


@dataclass(frozen=True, slots=True)
class GimbalAttitude:
    """GIMBAL_DEVICE_ATTITUDE_STATUS or MOUNT_ORIENTATION."""

    pitch_deg: float
    """Relative to the horizon."""
    yaw_deg: float
    """Relative to the nose, or to north."""
    from_north: bool
    failed: bool = False
    """Whether it reports a failure."""


@dataclass(frozen=True, slots=True)
class MessageInterval:
    """MESSAGE_INTERVAL: whether a message is streamed."""

    message: int
    sent: bool


PayloadMessage = PictureTaken | CameraStatus | CameraHeard | GimbalAttitude
"""Messages of cameras and gimbals, from any component of the vehicle."""


LinkMessage = Traffic | Radio | StationHeard | StationActed | DoubleHeard
"""Messages of others about a vehicle; they are no contact with it."""
EvidenceMessage = OrderSeen | ModeChange | RcChannels | VehicleSetting | OwnFailsafe
"""Messages about a vehicle without its position or activity."""

SensorMessage = Position | Battery | SystemStatus | Attitude | Gps | EstimatorStatus | Wind | Home | HeightTarget
"""Reports of its sensors and its estimator."""
StatusMessage = Heartbeat | LandedState | FenceStatus | MissionCurrent | MissionReached | ListedItem
"""Reports of its activity and its mission."""
TextMessage = StatusText | ComponentText
FlightMessage = SensorMessage | StatusMessage | TextMessage | LinkMessage | EvidenceMessage | PayloadMessage
"""Messages that the core follows in flight; they are logged and replayed."""


@dataclass(frozen=True, slots=True)
class FileReply:
    """FILE_TRANSFER_PROTOCOL from the vehicle: the answer to a `FileRequest`."""

    number: int
    """Of the request."""
    session: int
    error: int | None = None
    """Why it was refused, as a MAVFTP error; None otherwise."""
    data: bytes = b""


TransferMessage = MissionRequest | MissionAck | MissionCount | MissionItemInt
"""Messages of a transfer of a mission or another list of items; both sides send the same ones."""
DialogueMessage = TransferMessage | FileReply | CommandAck | ParamValue | ParamRefused | Version | MessageInterval
"""Messages that only an open dialogue awaits."""

Message = FlightMessage | DialogueMessage


@dataclass(frozen=True, slots=True)
class MissionRequestList:
    """MISSION_REQUEST_LIST: opens a download."""

    kind: MissionKind = MissionKind.MISSION


@dataclass(frozen=True, slots=True)
class SendCommand:
    """COMMAND_LONG."""

    command: int
    params: tuple[float, float, float, float, float, float, float] = (0.0,) * 7
    confirmation: int = 0
    component: int | None = None
    """A component other than the autopilot."""


@dataclass(frozen=True, slots=True)
class SendParamRequest:
    """PARAM_REQUEST_READ by name."""

    name: str


@dataclass(frozen=True, slots=True)
class SendParamSet:
    """PARAM_SET."""

    name: str
    value: float
    kind: int


@dataclass(frozen=True, slots=True)
class FileRequest:
    """FILE_TRANSFER_PROTOCOL to the vehicle."""

    session: int
    operation: int
    """MAVFTP's opcode."""
    offset: int = 0
    data: bytes = b""
    number: int = 0
    """MAVFTP's sequence number; the answer has the next one."""


@dataclass(frozen=True, slots=True)
class SendHeartbeat:
    """Our HEARTBEAT, an input to every vehicle's GCS failsafe."""


@dataclass(frozen=True, slots=True)
class SendFiller:
    """PING without a target: filler bytes after which a reader finds the next frame again."""


Outgoing = (
    TransferMessage
    | FileRequest
    | MissionRequestList
    | SendCommand
    | SendParamRequest
    | SendParamSet
    | SendHeartbeat
    | SendFiller
)
