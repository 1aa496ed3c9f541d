"""Join several links to one vehicle: a message counts from whichever link delivers it first.

Both autopilots number their frames for each link separately, and send each stream over a link as requested there. So an
identical frame is a router's copy, and all else is merged by its kind: positions count if newer than the last one;
states count from the link in use while they arrive there, so that a slow link does not restore the mode of a second
ago; texts and commands of other stations, which are broadcast once, count once. A mission is uploaded and downloaded
over one link, the one on which it was announced.
"""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator, Callable, Collection, Hashable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial

from executor.adapters.listeners import Listeners
from executor.adapters.mavlink.codec import Sender
from executor.adapters.mavlink.endpoints import Tap, VehicleLink, leave_frame, open_mavlink_links
from executor.core.interface import messages
from executor.core.interface.ports import Keyring, LinkCounts, LinkRequest, LinkView
from executor.core.state.link_choice import LinkChoice, LinkHealth, choose_link
from executor.core.state.link_quality import FULL_BUFFER_PCT

OF_THE_WAY = (messages.Traffic, messages.Radio)
TRANSFERS = (messages.MissionRequest, messages.MissionAck, messages.MissionCount, messages.MissionItemInt)
ANSWERS = (
    messages.CommandAck, messages.ParamValue, messages.ParamRefused, messages.Version, messages.FileReply,
    messages.StationHeard, messages.StationActed, messages.DoubleHeard,
)  # fmt: skip
SAID_ONCE = (
    messages.StatusText, messages.ComponentText, messages.MissionReached, messages.OrderSeen, messages.OwnFailsafe,
    messages.PictureTaken,
)  # fmt: skip
CANCELLED = 15
"""MAV_MISSION_OPERATION_CANCELLED."""
COPY_S = 5.0
"""Longest delay of a copy: the worst of a mesh of radios, with a margin."""
KEPT_FRAMES, KEPT_SAID = 256, 32
STATE_S = 2.5
"""Seconds without a state on the link in use after which another link's counts: the slowest stream is requested every
two seconds."""
BEHIND_S = 3.0
"""Most seconds by which a position over another link is late; older ones are from another vehicle, or after a
reboot."""
TRANSFER_S = 3.0
"""Seconds without a sent message after which a transfer is over."""
FOLLOWS = 0.2
"""Weight of the newest position in a link's estimated delay."""
REBOOTED_S = 5.0


class JoinedLink(Listeners):
    """`ports.OpenLink` of a vehicle with several connections."""

    def __init__(self, links: Sequence[VehicleLink], now_s: Callable[[], float]) -> None:
        """Join the links, the preferred one first; `now_s` is the flight's time."""
        super().__init__()
        self._links = tuple(links)
        self._now_s = now_s
        self._measures = [LinkHealth() for _ in links]
        self._choice = LinkChoice()
        self._announced: VehicleLink | None = None
        """Link over which the last transfer was begun."""
        self._transferred_s = float("-inf")
        """Time at which a transfer message was sent last."""
        self._frames: dict[bytes, tuple[int, float]] = {}
        self._said: deque[tuple[messages.Message, set[int], float]] = deque(maxlen=KEPT_SAID)
        """Broadcast messages, the links that delivered each, and the time of the first."""
        self._position: tuple[int, float] = (0, float("-inf"))
        """Last position: its link, and the vehicle's clock."""
        self._states_s: dict[type[messages.Message], float] = {}
        """Time at which each kind of state last arrived over the link in use."""
        for number, link in enumerate(self._links):
            link.is_alive, link.is_used = False, link is self.used
            link.take_frame = partial(self._take_frame, number)
            link.listen(partial(self._take, number))

    @property
    def used(self) -> VehicleLink:
        """Return the link for commands."""
        return self._links[self._choice.used]

    @property
    def ways(self) -> tuple[VehicleLink, ...]:
        """Return all links, the one for commands first."""
        return (self.used, *(link for link in self._links if link is not self.used))

    @property
    def peer(self) -> Hashable | None:
        """Return the address that commands go to."""
        return self.used.peer

    @property
    def connection(self) -> str:
        """Return the connection for commands."""
        return self.used.connection

    @property
    def sysid(self) -> int:
        """Return the vehicle's system id."""
        return self.used.sysid

    @property
    def is_alive(self) -> bool:
        """Return whether the link for commands received something just now."""
        return self.used.is_alive

    @property
    def counts(self) -> LinkCounts:
        """Return the counts of all links so far."""
        whole = LinkCounts(missing=0)
        for link in self._links:
            one = link.counts
            whole.received += one.received
            whole.missing = (whole.missing or 0) + (one.missing or 0)
            whole.foreign += one.foreign
            for reason, count in one.refused.items():
                whole.refused[reason] = whole.refused.get(reason, 0) + count
            whole.strangers = one.strangers | whole.strangers
            whole.by_connection[link.connection] = one
        return whole

    def describe_links(self) -> tuple[LinkView, ...]:
        """Return the state of each link."""
        now_s = self._now_s()
        return tuple(
            LinkView(
                link.connection,
                None if known.heard_s == float("-inf") else round(max(0.0, now_s - known.heard_s), 1),
                None if known.lost is None else round(known.lost, 3),
                link is self.used,
            )
            for link, known in zip(self._links, self._measures, strict=True)
        )

    def send(self, message: messages.Outgoing) -> None:
        """Send over the better link, and our heartbeat over all."""
        if isinstance(message, messages.SendHeartbeat):
            for link in self._links:
                link.send(message)
            return
        self._choose()
        if isinstance(message, (*TRANSFERS, messages.MissionRequestList, messages.FileRequest)):
            self._transferred_s = self._now_s()
        if isinstance(message, messages.MissionCount | messages.MissionRequestList):
            left, self._announced = self._announced, self.used
            if left is not None and left is not self.used:
                # PX4 accepts no mission from another link while it waits for items on this one.
                left.send(messages.MissionAck(CANCELLED, message.kind))
        self.used.send(message)

    def send_frame(self, frame: bytes, *, to_all: bool = False) -> None:
        """Send a frame unchanged over the better link; `to_all` if it is for all systems behind the same port."""
        self.used.send_frame(frame, to_all=to_all)

    def hear(self, message: messages.Message) -> None:
        """Pass on a message about the vehicle that came over other links."""
        self.used.hear(message)

    def _choose(self) -> None:
        now_s = self._now_s()
        for link, known in zip(self._links, self._measures, strict=True):
            link.is_alive = known.is_alive(now_s)
        transfers = now_s - self._transferred_s < TRANSFER_S
        self._choice = choose_link(self._choice, self._measures, now_s, transfers=transfers)
        for link in self._links:
            link.is_used = link is self.used

    def _take_frame(self, number: int, frame: bytes) -> bool:
        """Note that a link is alive; return whether no other link has delivered this frame."""
        now_s = self._now_s()
        self._measures[number] = self._measures[number].hear(now_s)
        self._choose()
        by, at_s = self._frames.get(frame, (number, now_s))
        if by != number and now_s - at_s <= COPY_S:
            del self._frames[frame]  # a router sends no frame three times
            return False
        self._frames.pop(frame, None)
        self._frames[frame] = (number, now_s)
        if len(self._frames) > KEPT_FRAMES:
            del self._frames[next(iter(self._frames))]
        return True

    def _take(self, number: int, message: messages.Message) -> None:
        known = self._measures[number]
        match message:
            case messages.Traffic(received, missing):
                self._measures[number] = known.count(received, missing)
            case messages.Radio():
                free_pct = message.free_buffer_pct
                self._measures[number] = replace(known, is_full=free_pct is not None and free_pct < FULL_BUFFER_PCT)
            case messages.Position():
                self._measure_delay(number, message)
        if self._is_news(number, message):
            super().hear(message)

    def _measure_delay(self, number: int, position: messages.Position) -> None:
        known, behind_s = self._measures[number], self._now_s() - position.boot_s
        if known.behind_s is not None and abs(behind_s - known.behind_s) < REBOOTED_S:
            behind_s = known.behind_s + FOLLOWS * (behind_s - known.behind_s)
        self._measures[number] = replace(known, behind_s=behind_s)

    def _is_news(self, number: int, message: messages.Message) -> bool:
        now_s, used = self._now_s(), number == self._choice.used
        match message:
            case messages.Position():
                by, boot_s = self._position
                if by != number and 0.0 <= boot_s - message.boot_s <= BEHIND_S:
                    return False
                self._position = number, message.boot_s
                return True
            case _ if isinstance(message, (*OF_THE_WAY, *TRANSFERS)):
                return used
            case _ if isinstance(message, ANSWERS):
                return True
            case _ if isinstance(message, SAID_ONCE):
                return self._is_first(number, message, now_s)
        if used:
            self._states_s[type(message)] = now_s
        return used or now_s - self._states_s.get(type(message), float("-inf")) > STATE_S

    def _is_first(self, number: int, message: messages.Message, now_s: float) -> bool:
        for said, links, at_s in self._said:
            if said == message and number not in links and now_s - at_s <= COPY_S:
                links.add(number)
                return False
        self._said.append((message, {number}, now_s))
        return True


@asynccontextmanager
async def open_joined_links(
    orders: Mapping[str, LinkRequest],
    now_s: Callable[[], float],
    keyring: Keyring | None = None,
    radios: Collection[Sender] | None = None,
    *,
    one_radio: bool = False,
    may_be_absent: bool = False,
    station: Sender = messages.GROUND_STATION,
    tap: Tap = leave_frame,
) -> AsyncIterator[Mapping[str, VehicleLink | JoinedLink]]:
    """Open the links to vehicles by name; those of a vehicle with several are joined.

    Args:
        orders: The links.
        now_s: The flight's time.
        keyring: As for `open_mavlink_links`.
        radios: Radios whose RADIO_STATUS is accepted without a signature, as for `open_mavlink_links`.
        one_radio: Whether the first links of all vehicles use one radio.
        station: Our own system and component.
        tap: Called with received frames; of a vehicle with several links, those of the link in use.
        may_be_absent: Whether the device of one of several links may appear later.

    Raises:
        ConnectionFailed: A port is in use, a device is missing, or a host is unknown.
    """
    single = {
        f"{name}/{number}": replace(one, may_be_absent=may_be_absent and bool(order.more))
        for name, order in orders.items()
        for number, one in enumerate((order, *order.more))
    }
    async with open_mavlink_links(single, keyring, radios, one_radio=one_radio, station=station, tap=tap) as opened:
        links: dict[str, VehicleLink | JoinedLink] = {}
        for name, order in orders.items():
            first, *others = (opened[f"{name}/{number}"] for number in range(1 + len(order.more)))
            for other in others:
                other.radio = None
            links[name] = JoinedLink((first, *others), now_s) if others else first
        yield links
