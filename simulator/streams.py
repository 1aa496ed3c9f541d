"""Which telemetry is due when; rates follow the vehicle's own time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

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
