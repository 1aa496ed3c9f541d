"""Schedule of a vehicle's messages: requested rates, due times, and the effect of a radio."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

MESSAGE_IDS: Mapping[str, int] = {
    "HEARTBEAT": 0, "SYS_STATUS": 1, "SYSTEM_TIME": 2, "GPS_RAW_INT": 24, "ATTITUDE": 30, "LOCAL_POSITION_NED": 32,
    "GLOBAL_POSITION_INT": 33, "MISSION_CURRENT": 42, "VFR_HUD": 74, "TIMESYNC": 111, "BATTERY_STATUS": 147,
    "AUTOPILOT_VERSION": 148, "FENCE_STATUS": 162, "WIND": 168, "EKF_STATUS_REPORT": 193, "ESTIMATOR_STATUS": 230,
    "WIND_COV": 231, "HOME_POSITION": 242, "EXTENDED_SYS_STATE": 245,
    # Sent on request.
    "SCALED_IMU": 26, "RAW_IMU": 27, "SCALED_PRESSURE": 29, "ATTITUDE_QUATERNION": 31, "SERVO_OUTPUT_RAW": 36,
    "GPS_GLOBAL_ORIGIN": 49, "NAV_CONTROLLER_OUTPUT": 62, "RC_CHANNELS": 65, "POSITION_TARGET_LOCAL_NED": 85,
    "POSITION_TARGET_GLOBAL_INT": 87, "HIGHRES_IMU": 105, "HIL_STATE_QUATERNION": 115, "ALTITUDE": 141,
    "SIMSTATE": 164, "ODOMETRY": 331, "ORBIT_EXECUTION_STATUS": 360, "ACTUATOR_OUTPUT_STATUS": 375,
}  # fmt: skip
MESSAGE_NAMES = {number: name for name, number in MESSAGE_IDS.items()}
STREAMS: Mapping[int, tuple[str, ...]] = {
    1: ("GPS_RAW_INT",), 2: ("SYS_STATUS", "MISSION_CURRENT", "GPS_RAW_INT"),
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"), 10: ("ATTITUDE",), 11: ("VFR_HUD",),
    12: ("BATTERY_STATUS", "SYSTEM_TIME", "EXTENDED_SYS_STATE", "EKF_STATUS_REPORT"),
}  # fmt: skip
"""Messages of REQUEST_DATA_STREAM, by MAV_DATA_STREAM; 0 is all."""


FRAME_BYTES: Mapping[str, int] = {
    "SYS_STATUS": 43, "SYSTEM_TIME": 24, "GPS_RAW_INT": 64, "ATTITUDE": 40, "LOCAL_POSITION_NED": 40,
    "GLOBAL_POSITION_INT": 40, "MISSION_CURRENT": 30, "VFR_HUD": 32, "TIMESYNC": 28, "BATTERY_STATUS": 66,
    "WIND_COV": 52, "HOME_POSITION": 72, "EXTENDED_SYS_STATE": 14, "ESTIMATOR_STATUS": 54,
}  # fmt: skip
"""Bytes of each MAVLink 2 frame with all fields."""


class Streams:
    """Telemetry schedule of one of a vehicle's links, and the effect of that link's radio."""

    def __init__(
        self,
        defaults_s: Mapping[str, float],
        now_s: float,
        slow_down: Callable[[Streams, float], float] = lambda _, interval_s: interval_s,
    ) -> None:
        """Begin; `slow_down` returns the actual interval in seconds for a requested one."""
        self._defaults_s, self._slow_down = defaults_s, slow_down
        self._interval_s = dict(defaults_s)
        self._due_s = dict.fromkeys(defaults_s, now_s)
        self.radio_slow_s = 0.0
        """Time that ArduPilot adds to every interval because of the radio's buffer."""
        self.radio_factor, self.radio_heard_s = 1.0, 0.0
        """Factor that PX4 applies to its stream rates for the radio, and when it was heard."""

    @property
    def bytes_s(self) -> float:
        """Bytes a second of all scheduled messages but HEARTBEAT, as PX4 counts them: without signatures."""
        return sum(FRAME_BYTES.get(name, 60) / one for name, one in self._interval_s.items() if name != "HEARTBEAT")

    def interval_s(self, name: str) -> float | None:
        """Return the interval, or None if the message is not streamed."""
        return self._interval_s.get(name)

    def set_interval(self, name: str, interval_us: float, now_s: float) -> None:
        """Apply SET_MESSAGE_INTERVAL: microseconds, 0 for the default, -1 for never."""
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
        """Apply REQUEST_DATA_STREAM; a rate of 0 stops the stream."""
        for name in {name for number, names in STREAMS.items() if stream in {0, number} for name in names}:
            self.set_interval(name, 1e6 / rate_hz if rate_hz > 0 else -1.0, now_s)

    def schedule_now(self, name: str, now_s: float) -> None:
        """Send a streamed message now, because its content has changed."""
        if name in self._due_s:
            self._due_s[name] = now_s

    def take_due(self, now_s: float) -> Iterator[str]:
        """Yield the messages due now; after a gap each comes once, not in a burst."""
        for name, due_s in self._due_s.items():
            if due_s <= now_s + 1e-9:
                interval_s = self._interval_s[name]
                if name != "HEARTBEAT":
                    interval_s = self._slow_down(self, interval_s)
                self._due_s[name] = due_s + interval_s if due_s + interval_s > now_s else now_s + interval_s
                yield name
