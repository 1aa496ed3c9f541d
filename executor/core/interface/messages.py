"""What vehicles say and what we say to them, in SI units; the codec turns MAVLink frames into these and back.

Unknown is ``None``, never zero: both autopilots send -1, -100, 65535 or 0 for values that they do not have.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from missions.cameras import PictureProof
from missions.items import MissionItem, MissionKind

GROUND_STATION = (255, 190)
"""Our system and component where the site file has no `station_sysid`: ArduPilot's GCS failsafe counts only heartbeats
of MAV_GCS_SYSID, 255 by default."""


BOOT = 1
"""MAV_STATE_BOOT: ArduPilot says it while it starts, and never again."""
CRITICAL = 5
"""MAV_STATE_CRITICAL: both autopilots say it, or more, as long as a failsafe acts (measured)."""


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
    """MAV_TYPE; None in logs that were written before it was kept."""


@dataclass(frozen=True, slots=True)
class Position:
    """GLOBAL_POSITION_INT."""

    boot_s: float
    """The vehicle's own clock, seconds since its start."""
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
    """Each cell, where the vehicle tells them apart; most report the pack alone."""


@dataclass(frozen=True, slots=True)
class SystemStatus:
    """SYS_STATUS."""

    remaining_pct: float | None
    voltage_v: float | None
    unhealthy: int
    """MAV_SYS_STATUS_SENSOR bits of what is enabled but not healthy."""
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
    """Of the place, horizontally, by the receiver's own word."""
    measured_s: float | None = None
    """When the fix was measured, by the receiver's or the vehicle's clock: it stands still where no new one comes."""
    receiver: int = 0
    """Which of its receivers."""


@dataclass(frozen=True, slots=True)
class EstimatorStatus:
    """EKF_STATUS_REPORT of ArduPilot, ESTIMATOR_STATUS of PX4."""

    is_absolute: bool
    """Whether it knows where it is on the earth, and its GPS is not rejected."""


@dataclass(frozen=True, slots=True)
class Wind:
    """WIND_COV of PX4, WIND of ArduPilot."""

    speed_m_s: float
    from_deg: float
    """Where the air comes from, clockwise from north."""


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
"""Of mission items: there is none, or nobody knows."""


@dataclass(frozen=True, slots=True)
class MissionCurrent:
    """MISSION_CURRENT."""

    seq: int
    total: int | None
    mission_id: int | None = None
    """A number that changes with the items; only PX4 sends it."""


@dataclass(frozen=True, slots=True)
class MissionReached:
    """MISSION_ITEM_REACHED."""

    seq: int


@dataclass(frozen=True, slots=True)
class MissionRequest:
    """MISSION_REQUEST or MISSION_REQUEST_INT, by the side that downloads; both are answered with MISSION_ITEM_INT."""

    seq: int
    kind: MissionKind = MissionKind.MISSION


@dataclass(frozen=True, slots=True)
class MissionAck:
    """MISSION_ACK, by the side that downloads: closes a transfer (0), or cancels it (15)."""

    result: int
    """MAV_MISSION_RESULT."""
    kind: MissionKind = MissionKind.MISSION
    checksum: int | None = None
    """`opaque_id`: of the list that it takes; None from a vehicle that has none."""


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT: opens an upload, and answers a request for the list."""

    count: int
    kind: MissionKind = MissionKind.MISSION
    checksum: int | None = None
    """`opaque_id`: of the list on board; None from a vehicle that has none."""


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
    """STATUSTEXT of a component of the vehicle that is not its autopilot."""

    component: int
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Traffic:
    """What came of a vehicle's frames since the last such message, by their sequence numbers."""

    received: int
    missing: int
    link_bytes: int = 0
    """Of all frames from it and to it; none where nobody counted them."""
    round_trip_s: float | None = None
    """Of our questions to it, where one was measured since."""


@dataclass(frozen=True, slots=True)
class Radio:
    """RADIO_STATUS of our end of the link, in the device's units; None where it does not know."""

    rssi: int | None
    remote_rssi: int | None
    noise: int | None
    remote_noise: int | None
    free_buffer_pct: int | None


@dataclass(frozen=True, slots=True)
class OrderSeen:
    """A ground station told the vehicle what to do, or the vehicle accepted that.

    COMMAND_ACK is an order's shadow: who hears only what the vehicle sends sees nothing else of it.
    """

    command: int
    """MAV_CMD; 176 also for the older SET_MODE."""
    custom_mode: int | None = None
    """The mode that it orders, if it names one."""
    by: int | None = None
    """The system that orders; None where nothing tells it from us: it has our number, or an answer names nobody."""
    to: int = 0
    """The system that is ordered, where a connection carries more than one; 0 for everybody on it."""


class Actor(Enum):
    """Who changed a mode, by the autopilot's own record of it."""

    PILOT = "pilot"
    """By the transmitter: its mode switch, its sticks."""
    GROUND_STATION = "ground station"
    FAILSAFE = "failsafe"
    MISSION = "mission"
    """A mission that ended, or one of its items."""
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class ModeChange:
    """The autopilot's own record of a change of mode: MODE of DataFlash with its reason, or what PX4 says."""

    custom_mode: int | None
    """None for one that is not named: the one that its HEARTBEAT shows then."""
    by: Actor


@dataclass(frozen=True, slots=True)
class RcChannels:
    """RC_CHANNELS, RC_CHANNELS_RAW or RCIN: what the pilot's transmitter says."""

    values_us: tuple[int, ...]
    """Of channel 1 and on; 0 where there is none."""


@dataclass(frozen=True, slots=True)
class VehicleSetting:
    """A parameter of the vehicle that was seen on its way, or in its own log: nobody here asked for it."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class ListedItem:
    """An item of the vehicle's mission that was seen on its way, or in its own log: nobody here asked for it."""

    item: MissionItem


@dataclass(frozen=True, slots=True)
class HeightTarget:
    """NAV_CONTROLLER_OUTPUT, POSITION_TARGET_LOCAL_NED, or what a log has of them: the height that its autopilot wants.

    ArduPilot moves its target with a vehicle that cannot follow: it is never more than some metres away.
    """

    below_m: float
    """How far the vehicle is below it; negative above it."""


@dataclass(frozen=True, slots=True)
class OwnFailsafe:
    """The autopilot's own record of a failsafe: ERR of DataFlash, failsafe flags of PX4."""

    what: str
    """battery, crash, ekf, gps, compass, motor, rc, ground station, fence, terrain, vibration, attitude or other."""
    active: bool
    words: str
    """As a person reads it."""


@dataclass(frozen=True, slots=True)
class ParamValue:
    """PARAM_VALUE."""

    name: str
    value: float
    kind: int
    """MAV_PARAM_TYPE."""


@dataclass(frozen=True, slots=True)
class ParamRefused:
    """PARAM_ERROR, or a PARAM_VALUE that is no number: an answer without a value."""

    name: str
    absent: bool
    """Whether the vehicle says that it does not have it."""


@dataclass(frozen=True, slots=True)
class Version:
    """AUTOPILOT_VERSION."""

    major: int
    minor: int
    patch: int
    release: str = ""
    """dev, alpha, beta or rc; empty for an official release, or where nobody knows."""

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}" + (f"-{self.release}" if self.release else "")


@dataclass(frozen=True, slots=True)
class StationHeard:
    """HEARTBEAT of a ground station other than ours, which the vehicle or a router passes on."""

    system: int
    component: int
    behind: bool = False
    """Whether it is behind `[forward]`: nobody hears it but through us."""


@dataclass(frozen=True, slots=True)
class StationActed:
    """A ground station behind `[forward]` changes something on board, or is kept from it."""

    system: int
    """0 where it is about a port, and no station."""
    component: int
    words: str
    """What it does, or why it may not."""
    passed: bool = True
    """Whether the vehicle gets it."""


@dataclass(frozen=True, slots=True)
class DoubleHeard:
    """Two vehicles have the same sysid: frames come from two addresses in turn, or positions go to and fro."""

    system: int
    """0 where who hears it does not know its number."""
    places: tuple[str, ...]
    """The addresses; nothing where both speak from one."""


@dataclass(frozen=True, slots=True)
class PictureTaken:
    """CAMERA_IMAGE_CAPTURED, CAMERA_FEEDBACK or CAMERA_TRIGGER: a camera says that it took a picture, or failed to."""

    source: PictureProof
    component: int
    """Who says it."""
    camera: int
    """Of a camera at the autopilot: which, counted from 1; 0 where nobody says."""
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
    """Of the camera where it says so itself, else of the vehicle, as the next two."""
    pitch_deg: float | None = None
    yaw_deg: float | None = None
    file: str = ""
    """How the camera calls it."""


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """CAMERA_CAPTURE_STATUS or STORAGE_INFORMATION."""

    component: int
    films: bool | None
    images: int | None
    """How many it has taken."""
    free_mib: float | None
    """Room on its card."""


@dataclass(frozen=True, slots=True)
class CameraHeard:
    """HEARTBEAT of a camera."""

    component: int


@dataclass(frozen=True, slots=True)
class GimbalAttitude:
    """GIMBAL_DEVICE_ATTITUDE_STATUS or MOUNT_ORIENTATION."""

    pitch_deg: float
    """From the horizon."""
    yaw_deg: float
    """From the nose, or from north."""
    from_north: bool
    failed: bool = False
    """Whether it says that something is wrong with it."""


@dataclass(frozen=True, slots=True)
class MessageInterval:
    """MESSAGE_INTERVAL: whether a message is sent by itself."""

    message: int
    sent: bool


PayloadMessage = PictureTaken | CameraStatus | CameraHeard | GimbalAttitude
"""What cameras and gimbals say, whichever component of the vehicle they are."""


LinkMessage = Traffic | Radio | StationHeard | StationActed | DoubleHeard
"""What others say about a vehicle, which does not mean that it was heard."""
EvidenceMessage = OrderSeen | ModeChange | RcChannels | VehicleSetting | OwnFailsafe
"""What is about a vehicle and says nothing of where it is or what it does."""

SensorMessage = Position | Battery | SystemStatus | Attitude | Gps | EstimatorStatus | Wind | Home | HeightTarget
"""What its sensors and its estimator say."""
StatusMessage = Heartbeat | LandedState | FenceStatus | MissionCurrent | MissionReached | ListedItem
"""What it does, and on which mission."""
TextMessage = StatusText | ComponentText
FlightMessage = SensorMessage | StatusMessage | TextMessage | LinkMessage | EvidenceMessage | PayloadMessage
"""What the core follows in flight; it is logged and replayed."""


@dataclass(frozen=True, slots=True)
class FileReply:
    """FILE_TRANSFER_PROTOCOL from the vehicle: the answer to a `FileRequest`."""

    number: int
    """Of the request."""
    session: int
    error: int | None = None
    """Why it was refused, by MAVFTP's numbers; None where it was not."""
    data: bytes = b""


TransferMessage = MissionRequest | MissionAck | MissionCount | MissionItemInt
"""Of transfers of a mission, or of another list of items; both sides say the same."""
DialogueMessage = TransferMessage | FileReply | CommandAck | ParamValue | ParamRefused | Version | MessageInterval
"""What only an open dialogue waits for."""

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
    """Another component than the autopilot."""


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
    """Our HEARTBEAT: an input to every vehicle's ground-station failsafe."""


@dataclass(frozen=True, slots=True)
class SendFiller:
    """PING that is for nobody: bytes behind which a reader finds the next frame again."""


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
