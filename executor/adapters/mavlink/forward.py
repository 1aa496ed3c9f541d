"""Share vehicles with other ground stations: pass vehicles' frames to them, and their frames to vehicles if allowed.

Their ports are endpoints like those of vehicles. A frame from a station to a vehicle also counts on that vehicle's own
link, so that a command is attributed to its station.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field, replace
from functools import partial

from executor.adapters.mavlink import frame_layout
from executor.adapters.mavlink.codec import DecodedFrame, MavlinkCodec, Sender, name_command, target_of
from executor.adapters.mavlink.endpoints import Router, VehicleLink, Write, describe_open_error, open_endpoint
from executor.adapters.mavlink.frame_layout import LinkSigning
from executor.adapters.mavlink.joined_link import JoinedLink
from executor.adapters.mavlink.message_readers import Frame
from executor.core import forwarding
from executor.core.formatting import escape_controls, format_count
from executor.core.interface import messages
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.ports import Keyring
from executor.core.lines import link
from executor.core.radio_budget import ALONE, RadioShare
from executor.errors import ConnectionFailed
from executor.supervised import call_safely, run_beside
from missions import MissionKind

AnyLink = VehicleLink | JoinedLink

FIRST_LINK_ID = 128
"""First signature link id for stations; the vehicles' own links count from 0."""
GONE_S = 30.0
"""Silence after which a station that connected by UDP is sent nothing more."""
MOST_STATIONS, MOST_CHANNELS = 32, 200
SAME_S = 10.0
"""Seconds within which a station's repeated action is reported once."""
TOLD_HZ, TOLD_AT_ONCE = 0.1, 6.0
"""Rate and burst of lines about one station: a thousand parameter changes are a few lines."""
AGAIN_S = 5.0
"""Real seconds between two attempts to open a port."""
LISTS = {
    int(MissionKind.MISSION): "a mission", int(MissionKind.FENCE): "a fence", int(MissionKind.RALLY): "rally points",
}  # fmt: skip
STEERING = frozenset({"RC_CHANNELS_OVERRIDE", "MANUAL_CONTROL", "SET_ATTITUDE_TARGET"})
ASKS = ("MAV_CMD_REQUEST_", "MAV_CMD_GET_", "MAV_CMD_SET_MESSAGE_INTERVAL", "MAV_CMD_RUN_PREARM_CHECKS")


def read_station_frame(codec: MavlinkCodec, raw: bytes) -> forwarding.StationFrame:
    """Return the fields of a complete frame that the forwarding rules use."""
    frame = codec.parse_whole(raw)
    system = 3 if raw[0] == frame_layout.V1 else 5
    target = getattr(frame, "target", 0) if frame.get_type() == "MANUAL_CONTROL" else target_of(raw)
    return forwarding.StationFrame(
        raw[system], raw[system + 1], frame_layout.message_id_of(raw), len(raw), target,
        frame.command if frame.get_type() in {"COMMAND_LONG", "COMMAND_INT"} else None,
        describe_act(frame, codec.autopilots.get(target)),
    )  # fmt: skip


def describe_act(frame: Frame, autopilot: int | None) -> str:  # noqa: PLR0911 - one line for each kind
    """Return in words what a frame changes on board; empty if nothing."""
    match frame.get_type():
        case "PARAM_SET":
            value = frame_layout.from_wire(frame.param_value, frame.param_type, autopilot)
            return link.SETS.format(name=escape_controls(frame.param_id), value=value)
        case "MISSION_COUNT" | "MISSION_CLEAR_ALL" as kind:
            named = LISTS.get(frame.mission_type, "all lists")
            if kind == "MISSION_CLEAR_ALL":
                return link.CLEARS.format(list=named)
            return link.UPLOADS.format(list=named, count=format_count(frame.count, "item"))
        case "MISSION_SET_CURRENT":
            return link.MOVES_MISSION.format(seq=frame.seq)
        case "MISSION_WRITE_PARTIAL_LIST":
            return link.CHANGES_ITEMS.format(first=frame.start_index, last=frame.end_index)
        case "SET_MODE":
            return link.ORDERS_MODE.format(mode=frame.custom_mode)
        case "COMMAND_LONG" | "COMMAND_INT":
            name = name_command(frame.command)
            return "" if name.startswith(ASKS) else link.SENDS_COMMAND.format(command=name)
        case kind if kind in STEERING or kind.startswith("SET_POSITION_TARGET"):
            return link.STEERS
        case _:
            return ""


@dataclass(eq=False, slots=True)
class _Peer:
    """One route to stations."""

    calls_us: bool
    heard_s: float
    stations: set[int] = field(default_factory=set)
    """Systems that send from there."""


@dataclass(eq=False, repr=False)
class Forwarder:
    """Pass frames between vehicles and stations; all times are those of `now_s`, in seconds."""

    rules: forwarding.ForwardRules
    now_s: Callable[[], float]
    shares: Mapping[int, RadioShare] = field(default_factory=dict)
    """Share of its radio for each vehicle, by system id."""
    is_busy: Callable[[AnyLink], bool] = lambda _: False
    """Whether a transfer of ours is in progress on its channel."""
    links: dict[int, AnyLink] = field(default_factory=dict)
    """Links to the vehicles by system id, once they are open."""
    _peers: dict[Write, _Peer] = field(default_factory=dict)
    _on_radio: set[int] = field(default_factory=set)
    """Vehicles behind a radio that sends RADIO_STATUS."""
    autopilots: dict[int, int] = field(default_factory=dict)
    """MAV_AUTOPILOT of vehicles, by system id."""
    _allowances: dict[object, tuple[float | None, forwarding.Allowance]] = field(default_factory=dict)
    """Allowance of each channel, with the share that it was computed from."""
    _told_s: dict[tuple[object, ...], float] = field(default_factory=dict)
    _lines: dict[Sender, forwarding.Bucket] = field(default_factory=dict)
    """Remaining lines about each station."""

    def tap(self, received: DecodedFrame, about: Collection[int]) -> None:
        """Pass a frame of a vehicle, or of a radio, to the stations."""
        if isinstance(received.message, messages.Radio):
            self._on_radio.update(about)
        elif isinstance(received.message, messages.Heartbeat):
            self.autopilots[received.sysid] = received.message.autopilot
        if not self._peers:
            return
        target, now_s = target_of(received.frame), self.now_s()
        for write, peer in tuple(self._peers.items()):
            if peer.calls_us and now_s - peer.heard_s > GONE_S:
                del self._peers[write]
            elif self.rules.is_for_station(target, peer.stations):
                call_safely("handing a frame on", write, received.frame)

    def add_peer(self, write: Write, *, calls_us: bool) -> _Peer:
        """Add a route to a station."""
        known = self._peers
        if write not in known and len(known) >= MOST_STATIONS:
            del known[min(known, key=lambda one: (not known[one].calls_us, known[one].heard_s))]
        return self._peers.setdefault(write, _Peer(calls_us, self.now_s()))

    def remove_peer(self, write: Write) -> None:
        """Remove a closed route."""
        self._peers.pop(write, None)

    def take(self, codec: MavlinkCodec, received: DecodedFrame, write: Write) -> None:
        """Process a frame from a station: check it, and pass it on if allowed."""
        peer = self._peers.get(write) or self.add_peer(write, calls_us=True)
        peer.heard_s = self.now_s()
        frame = read_station_frame(codec, received.frame)
        if frame.system not in self.rules.vehicles and len(peer.stations) < MOST_STATIONS:
            peer.stations.add(frame.system)
        why = self.rules.find_refusal(frame, signed=received.refused is None)
        if why:
            if frame.number != forwarding.HEARTBEAT:
                self._tell(frame, why, passed=False)
            elif self._admit(frame, None):
                self._hear(received, self.rules.vehicles)
            return
        reached = self._pass_on(frame, received.frame)
        self._hear(received, reached)
        if frame.does:
            for sysid in sorted(reached):
                self._tell(frame, frame.does, sysid)

    def _pass_on(self, frame: forwarding.StationFrame, raw: bytes) -> set[int]:
        """Send a frame to its targets, once over each channel; return the vehicles that it goes to."""
        reached, sent = set[int](), dict[object, bool]()
        for sysid in sorted(self.rules.select_targets(frame)):
            vehicle = self.links.get(sysid)
            if vehicle is None or vehicle.peer is None:
                continue
            if vehicle.peer not in sent:
                sent[vehicle.peer] = self._admit(frame, vehicle)
                if sent[vehicle.peer]:
                    vehicle.send_frame(raw, to_all=frame.target == 0)
            if sent[vehicle.peer]:
                reached.add(sysid)
        return reached

    def _admit(self, frame: forwarding.StationFrame, vehicle: AnyLink | None) -> bool:
        """Return whether a channel has room for a frame; without a vehicle, whether to process it here now."""
        share = ALONE
        if vehicle is not None:
            share = self.shares.get(vehicle.sysid, ALONE).find_link_share(vehicle.connection)
        carries = share.find_capacity_bytes_s(on_radio=vehicle is not None and vehicle.sysid in self._on_radio)
        theirs, channel = None if carries is None else share.find_others_bytes_s(carries), vehicle and vehicle.peer
        if len(self._allowances) > MOST_CHANNELS:
            self._allowances.clear()
        known = self._allowances.get(channel)
        allowance = forwarding.make_allowance(theirs) if known is None or known[0] != theirs else known[1]
        after, why = allowance.admit(frame, self.now_s(), busy=vehicle is not None and self.is_busy(vehicle))
        self._allowances[channel] = theirs, after
        if why:
            self._tell(frame, why, passed=False)
        return why is None

    def _hear(self, received: DecodedFrame, sysids: Iterable[int]) -> None:
        """Pass a frame to the links of its target vehicles, as if it had been received there."""
        message = received.message
        if isinstance(message, messages.StationHeard):
            message = replace(message, behind=True)
        elif not isinstance(message, messages.OrderSeen):
            return
        for sysid in sysids:
            if sysid in self.links:
                self.links[sysid].hear(message)

    def report(self, words: str, *, still: bool = False) -> None:
        """Report the state of a port to the crew; once while it is `still` the same."""
        for vehicle in tuple(self.links.values())[:1]:
            vehicle.hear(messages.StationActed(0, 0, words, passed=not still))

    def _tell(
        self, frame: forwarding.StationFrame, words: str, sysid: int | None = None, *, passed: bool = True
    ) -> None:
        """Report to the crew what a station does to a vehicle, or why it may not."""
        key, now_s = (frame.sender, words, sysid), self.now_s()
        if now_s - self._told_s.get(key, -SAME_S) < SAME_S:
            return
        if frame.sender not in self._lines and len(self._lines) >= MOST_STATIONS:
            return
        bucket = self._lines.setdefault(frame.sender, forwarding.Bucket(TOLD_HZ, TOLD_AT_ONCE))
        if passed:
            left = bucket.take(1.0, now_s)
            if left is None:
                return
            self._lines[frame.sender] = left
            words += link.OTHERS_NOT_LISTED if left.left < 1.0 else ""
        self._told_s = {one: at_s for one, at_s in self._told_s.items() if now_s - at_s < SAME_S} | {key: now_s}
        to = self.links.get(min(self.links, default=0) if sysid is None else sysid)
        if to is not None:
            to.hear(messages.StationActed(*frame.sender, words, passed))


class StationPort(Router):
    """A port for other stations: passes their frames to the forwarder."""

    def __init__(self, forwarder: Forwarder, codec: MavlinkCodec, connection: Connection) -> None:
        super().__init__((), codec)
        self._forwarder, self._connection, self._lost = forwarder, connection, False
        self._way: Write | None = None
        """How to write to the other end, if there is only one."""

    def route_frames(self, frames: Iterable[DecodedFrame], write: Write, source: str = "") -> None:  # noqa: ARG002
        """Take a station's frames."""
        self.codec.autopilots.update(self._forwarder.autopilots)  # first: mode numbers depend on it
        for received in frames:
            self._forwarder.take(self.codec, received, self._way or write)

    def accept(self, write: Write) -> None:
        """Note a new station; it may never send anything."""
        self._forwarder.add_peer(write, calls_us=False)

    def connect_all(self, write: Write) -> None:
        """Send vehicles' frames to the other end."""
        self._way = write
        self._forwarder.add_peer(write, calls_us=False)
        if self._lost:
            self._forwarder.report(link.PORT_OPENED.format(port=self._connection))
        self._lost = False

    def disconnect(self, write: Write) -> None:
        """Note that `write` reaches no station any more."""
        self._forwarder.remove_peer(write)
        self._way = None
        if self._connection.scheme in {Scheme.TCP_OUT, Scheme.SERIAL}:
            self._lost = True
            self._forwarder.report(link.PORT_LOST.format(port=self._connection))


@asynccontextmanager
async def open_station_ports(
    forwarder: Forwarder,
    ports: Sequence[Connection],
    keyring: Keyring | None = None,
    station: Sender = messages.GROUND_STATION,
    *,
    strict: bool = True,
) -> AsyncIterator[None]:
    """Keep the ports of other stations open inside the block.

    Args:
        forwarder: Passes frames on.
        ports: Ports of stations.
        keyring: Key with which stations' frames must be signed to be passed on.
        station: Our own system and component.
        strict: Whether a port that cannot be opened at once is an error; else it is retried, and reported.

    Raises:
        ConnectionFailed: A port cannot be opened.
    """
    async with AsyncExitStack() as stack:
        for number, connection in enumerate(ports, start=FIRST_LINK_ID):
            signing = None if keyring is None else LinkSigning(keyring.key, number, keyring.unix_s)
            port = StationPort(forwarder, MavlinkCodec(signing, station=station), connection)
            try:
                await open_endpoint(connection, port, stack)
            except (OSError, ValueError) as error:
                if strict:
                    raise ConnectionFailed(f"forward.to: {_describe_failure(connection, error)}") from error
                opening = run_beside(f"opening {connection}", partial(_keep_opening, forwarder, connection, port))
                await stack.enter_async_context(opening)
        yield


async def _keep_opening(forwarder: Forwarder, connection: Connection, port: StationPort) -> None:
    while True:
        await asyncio.sleep(AGAIN_S)
        async with AsyncExitStack() as stack:
            try:
                await open_endpoint(connection, port, stack)
            except (OSError, ValueError) as error:
                forwarder.report(_describe_failure(connection, error), still=True)
                continue
            forwarder.report(link.PORT_OPENED.format(port=connection))
            await asyncio.Event().wait()


def _describe_failure(connection: Connection, error: Exception) -> str:
    return f"{connection}: cannot be opened: {describe_open_error(error)}"
