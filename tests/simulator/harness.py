"""Drives one autopilot in simulated time, as a ground station that knows the protocol would; no sockets, no clock."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from missions.items import Command as ItemCommand
from missions.items import Frame, MissionItem, MissionKind
from simulator.airframe import Event
from simulator.autopilot import STEP_S, Autopilot
from simulator.config import AutopilotKind, SimVehicle
from simulator.fleet import make_autopilot
from simulator.messages import (
    Body,
    Command,
    FieldValue,
    Heartbeat,
    ItemReceived,
    MavCommand,
    MissionCount,
    MissionRequest,
    MissionRequestList,
    Outbound,
    Peer,
    Received,
)
from simulator.truth import Truth

GCS = Peer(255, 190)
OTHER = Peer(254, 190)
LAT_DEG, LON_DEG, ALT_M = 50.345749, 13.325244, 300.0
AUTO, GUIDED, LOITER, RTL, LAND, BRAKE = 3, 4, 5, 6, 9, 17
PX4_LOITER, PX4_MISSION, PX4_RTL, PX4_LAND = (4 << 16 | sub << 24 for sub in (3, 4, 5, 6))


def is_happening(event: Event | Truth) -> bool:
    """Return whether it is more than an order or a change of mode."""
    return event.sender is None and not event.what.startswith("mode ")


def sim_vehicle(kind: AutopilotKind, **changes: object) -> SimVehicle:
    """Return a vehicle at the recorded flights' place."""
    base = SimVehicle("uav1", 11, kind, "udpout://127.0.0.1:14550", LAT_DEG, LON_DEG, ALT_M)
    return replace(base, **changes)  # type: ignore[arg-type]


def place_e7(north_m: float, east_m: float) -> tuple[int, int]:
    """Return latitude and longitude of a place about the pad."""
    home = make_autopilot(sim_vehicle(AutopilotKind.PX4)).home
    return home.lat_lon_e7(east_m, north_m)


def waypoint(north_m: float, east_m: float, up_m: float = 25.0, *, hold_s: float = 0.0) -> MissionItem:
    x, y = place_e7(north_m, east_m)
    return MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, ItemCommand.NAV_WAYPOINT, param1=hold_s, x=x, y=y, z=up_m)


def speed(m_s: float) -> MissionItem:
    return MissionItem(0, Frame.MISSION, ItemCommand.DO_CHANGE_SPEED, param1=1.0, param2=m_s, param3=-1.0)


def takeoff(up_m: float = 25.0) -> MissionItem:
    x, y = place_e7(0.0, 0.0)
    return MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, ItemCommand.NAV_TAKEOFF, x=x, y=y, z=up_m)


def rtl() -> MissionItem:
    return MissionItem(0, Frame.MISSION, ItemCommand.NAV_RETURN_TO_LAUNCH)


def land(north_m: float = 0.0, east_m: float = 0.0) -> MissionItem:
    x, y = place_e7(north_m, east_m)
    return MissionItem(0, Frame.GLOBAL_RELATIVE_ALT, ItemCommand.NAV_LAND, x=x, y=y)


def numbered(items: Iterable[MissionItem], current: int | None = None) -> tuple[MissionItem, ...]:
    return tuple(replace(item, seq=seq, current=seq == current) for seq, item in enumerate(items))


def on_wire(item: MissionItem) -> ItemReceived:
    return ItemReceived(item, MissionKind.MISSION)


class Operator:
    """A ground station and the vehicle before it."""

    def __init__(
        self, kind: AutopilotKind, changes: Mapping[str, object] | None = None, *, heartbeats: bool = True
    ) -> None:
        self.kind = kind
        self.vehicle: Autopilot = make_autopilot(sim_vehicle(kind, **(changes or {})))
        self.heartbeats = heartbeats
        self.log: list[tuple[float, Outbound]] = []
        self._beat_s = 0.0

    @property
    def now_s(self) -> float:
        return self.vehicle.now_s

    def send(self, body: Body, sender: Peer = GCS) -> list[Outbound]:
        """Send and return what comes back at once."""
        self.vehicle.receive(Received(sender, body))
        return self._collect()

    def run(self, seconds: float) -> None:
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-6:
            if self.heartbeats and self.now_s >= self._beat_s:
                self.send(Heartbeat(ground_station=True))
                self._beat_s = self.now_s + 1.0
            self.vehicle.advance(self.now_s + STEP_S)
            self._collect()

    def beat(self, sender: Peer) -> None:
        """Send one heartbeat of a ground station."""
        self.send(Heartbeat(ground_station=True), sender)

    def run_until(self, condition: Callable[[], bool], limit_s: float = 600.0) -> float:
        """Run until ``condition()`` holds and return how long it took; it must within the limit."""
        began_s = self.now_s
        while not condition():
            assert self.now_s - began_s < limit_s, "it never came true"
            self.run(STEP_S)
        return self.now_s - began_s

    def command(self, number: int, *params: float, sender: Peer = GCS) -> int:
        """Send a command and return its result: the last, for PX4 acknowledges a change of mode twice."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        one, two, three, four, five, six, seven = filled
        answers = self.send(Command(number, (one, two, three, four, five, six, seven)), sender)
        results = [fields_of(answer)["result"] for answer in answers if answer.name == "COMMAND_ACK"]
        assert len(results) == (2 if self.kind is AutopilotKind.PX4 and number == MavCommand.DO_SET_MODE else 1)
        result = results[-1]
        assert isinstance(result, int)
        return result

    def mode(self, number: int) -> int:
        if self.kind is AutopilotKind.PX4:
            return self.command(MavCommand.DO_SET_MODE, 1, number >> 16 & 255, number >> 24)
        return self.command(MavCommand.DO_SET_MODE, 1, number)

    def arm(self) -> int:
        return self.command(MavCommand.COMPONENT_ARM_DISARM, 1)

    def upload(self, items: Sequence[MissionItem], sender: Peer = GCS, pause_s: float = 0.0) -> int:
        """Upload and return the type of the final ACK."""
        return self._answer_requests(items, self.send(MissionCount(len(items), 0), sender), sender, pause_s)

    def upload_rest(self, items: Sequence[MissionItem]) -> int:
        """Go on with an upload that waits for its first item."""
        return self._answer_requests(items, self.send(on_wire(items[0])), GCS, 0.0)

    def _answer_requests(
        self, items: Sequence[MissionItem], answers: list[Outbound], sender: Peer, pause_s: float
    ) -> int:
        while True:
            for answer in answers:
                if answer.name == "MISSION_ACK":
                    kind = fields_of(answer)["type"]
                    assert isinstance(kind, int)
                    return kind
            asked = [fields_of(answer)["seq"] for answer in answers if answer.name.startswith("MISSION_REQUEST")]
            seq = asked[-1]
            assert isinstance(seq, int)
            if pause_s:
                self.run(pause_s)
            answers = self.send(on_wire(items[seq]), sender)

    def download(self) -> list[Mapping[str, FieldValue]]:
        answers = self.send(MissionRequestList(0))
        count = fields_of(next(answer for answer in answers if answer.name == "MISSION_COUNT"))["count"]
        assert isinstance(count, int)
        return [fields_of(self.send(MissionRequest(seq, 0, integer=True))[0]) for seq in range(count)]

    def fly(self, items: Sequence[MissionItem]) -> None:
        """Upload a mission and start it the way the autopilot wants it."""
        self.run(self.vehicle.vehicle.ready_after_s + 1.0)
        assert self.upload(items) == 0
        self.run(1.0)
        if self.kind is AutopilotKind.ARDUPILOT:
            assert self.mode(GUIDED) == 0
            assert self.arm() == 0
        assert self.command(MavCommand.MISSION_START) == 0

    def sent(self, name: str, since_s: float = -1.0) -> list[Mapping[str, FieldValue]]:
        return [fields_of(message) for at_s, message in self.log if message.name == name and at_s >= since_s]

    def texts(self, since_s: float = -1.0) -> list[str]:
        """Return the texts that were sent, parts put together."""
        parts: list[str] = []
        for fields in self.sent("STATUSTEXT", since_s):
            raw = fields["text"]
            assert isinstance(raw, bytes)
            if fields["chunk_seq"]:
                parts[-1] += raw.decode()
            else:
                parts.append(raw.decode())
        return parts

    def happenings(self) -> list[str]:
        """Return what really happened, without orders, and modes, of which the heartbeats tell."""
        return [event.what for event in self.vehicle.frame.drain_events() if is_happening(event)]

    def mission_current(self) -> Mapping[str, FieldValue]:
        answers = self.send(Command(MavCommand.REQUEST_MESSAGE, (42.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
        return fields_of(next(answer for answer in answers if answer.name == "MISSION_CURRENT"))

    def telemetry(self, name: str, number: int) -> Mapping[str, FieldValue]:
        answers = self.send(Command(MavCommand.REQUEST_MESSAGE, (float(number), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
        return fields_of(next(answer for answer in answers if answer.name == name))

    def _collect(self) -> list[Outbound]:
        messages = [message for _, message in self.vehicle.voice.drain()]
        if self.vehicle.is_mute:
            return []
        self.log += [(self.now_s, message) for message in messages]
        return messages


def fields_of(message: Outbound) -> Mapping[str, FieldValue]:
    return message.fields
