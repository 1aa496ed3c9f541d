"""What a vehicle says: telemetry that both autopilots fill alike, which of it is due when, and the outbox of it all."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping

from simulator.messages import Outbound, build_message, split_status_text
from simulator.physics import Body, Home

WITHHELD_TEXTS = 20
"""Texts that a vehicle keeps for the time when somebody listens again."""


class VehicleOutbox:
    """Collects messages until they are taken away."""

    def __init__(self, *, tab: bool) -> None:
        self._outbox: list[Outbound] = []
        self._withheld: deque[Outbound] = deque(maxlen=WITHHELD_TEXTS)
        self._tab = "\t" if tab else ""
        """PX4's texts end in a tab."""
        self._texts = 0
        self.muted = False
        """Whether texts are kept back: PX4 does so while no ground station is heard."""

    def send(self, messages: Iterable[Outbound]) -> None:
        """Send messages."""
        self._outbox.extend(messages)

    def send_text(self, severity: int, text: str) -> None:
        """Send a text, in parts when it is long."""
        self._texts += 1
        chunk_id = (self._texts - 1) % 65535 + 1
        (self._withheld if self.muted else self._outbox).extend(split_status_text(severity, text + self._tab, chunk_id))

    def release_withheld(self) -> None:
        """Send the texts that were kept back."""
        self.muted = False
        self._outbox.extend(self._withheld)
        self._withheld.clear()

    def drain(self) -> list[Outbound]:
        """Take away what is to be sent."""
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


class Streams:
    """The schedule of one vehicle's telemetry."""

    def __init__(self, defaults_s: Mapping[str, float], now_s: float) -> None:
        self._defaults_s = defaults_s
        self._interval_s = dict(defaults_s)
        self._due_s = dict.fromkeys(defaults_s, now_s)

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
                self._due_s[name] = due_s + interval_s if due_s + interval_s > now_s else now_s + interval_s
                yield name


INT16_MAX = 32767
UINT16_MAX = 65535
UNUSED_CELLS = (UINT16_MAX,) * 9
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)


def heading_cdeg(body: Body) -> int:
    """Return where its nose points, in hundredths of a degree."""
    return round(math.degrees(body.yaw_rad) * 100) % 36000


def _to_centi(value_m_s: float) -> int:
    return round(value_m_s * 100)


def build_global_position(home: Home, body: Body, boot_ms: int, off: tuple[float, float] = (0.0, 0.0)) -> Outbound:
    """Return GLOBAL_POSITION_INT; `off` is how far east, and faster to the east, it takes itself to be."""
    lat, lon = home.lat_lon_e7(body.east_m + off[0], body.north_m)
    return build_message(
        "GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=lat, lon=lon, alt=round((home.alt_m + body.up_m) * 1000),
        relative_alt=round(body.up_m * 1000), vx=_to_centi(body.v_north_m_s),
        vy=_to_centi(body.v_east_m_s + off[1]), vz=_to_centi(-body.v_up_m_s), hdg=heading_cdeg(body),
    )  # fmt: skip


def build_gps_raw(home: Home, body: Body, boot_ms: int, *, fix: int) -> Outbound:
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
