"""Several links to one vehicle as one: what it says counts from whichever link brings it first.

Both autopilots number their frames for every link anew, and send of each stream over every link what was asked for
there. So a frame that comes twice is a copy that a router made, and everything else is told apart by what it is: of
positions only what is newer than the last one, of states what comes over the link in use, as long as it comes there,
so that a slow link does not bring back the mode of a second ago. What is said once to everybody, texts and orders seen,
counts once. A mission is given and read over one link, the one on which it was announced.
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
"""A copy comes no later than this: what a mesh of radios takes at its worst, and some."""
KEPT_FRAMES, KEPT_SAID = 256, 32
STATE_S = 2.5
"""A state that has not come over the link in use for so long is taken from another one: the slowest stream is asked for
every two seconds."""
BEHIND_S = 3.0
"""A position that is so much older than the last one, and comes over another link, is late; older ones are another
vehicle's, or of one that has rebooted."""
TRANSFER_S = 3.0
"""A transfer of which nothing was sent for so long is over."""
FOLLOWS = 0.2
"""How much the newest position says of how late a link is."""
REBOOTED_S = 5.0


class JoinedLink(Listeners):
    """`ports.OpenLink` of a vehicle that has several connections."""

    def __init__(self, links: Sequence[VehicleLink], now_s: Callable[[], float]) -> None:
        """Join them, the preferred one first; `now_s` is the flight's time."""
        super().__init__()
        self._links = tuple(links)
        self._now_s = now_s
        self._measures = [LinkHealth() for _ in links]
        self._choice = LinkChoice()
        self._announced: VehicleLink | None = None
        """Over which a transfer was begun last."""
        self._transferred_s = float("-inf")
        """When something of a transfer was sent last."""
        self._frames: dict[bytes, tuple[int, float]] = {}
        self._said: deque[tuple[messages.Message, set[int], float]] = deque(maxlen=KEPT_SAID)
        """What was said, over which links it has come, and when first."""
        self._position: tuple[int, float] = (0, float("-inf"))
        """Of the last position: the link, and the vehicle's clock."""
        self._states_s: dict[type[messages.Message], float] = {}
        """When each kind of state came last over the link in use."""
        for number, link in enumerate(self._links):
            link.is_alive, link.is_used = False, link is self.used
            link.take_frame = partial(self._take_frame, number)
            link.listen(partial(self._take, number))

    @property
    def used(self) -> VehicleLink:
        """The one that orders go over."""
        return self._links[self._choice.used]

    @property
    def ways(self) -> tuple[VehicleLink, ...]:
        """All of them, the one that orders go over first."""
        return (self.used, *(link for link in self._links if link is not self.used))

    @property
    def peer(self) -> Hashable | None:
        """What orders go to."""
        return self.used.peer

    @property
    def connection(self) -> str:
        """Of the one that orders go over."""
        return self.used.connection

    @property
    def sysid(self) -> int:
        """Of the vehicle."""
        return self.used.sysid

    @property
    def is_alive(self) -> bool:
        """Whether something came just now over the one that orders go over."""
        return self.used.is_alive

    @property
    def counts(self) -> LinkCounts:
        """What came so far, over all of them."""
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
        """Return the state of each."""
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
        """Send over the better link, and our heartbeat over all of them."""
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
                # PX4 takes no mission from another link as long as it waits for items on this one.
                left.send(messages.MissionAck(CANCELLED, message.kind))
        self.used.send(message)

    def send_frame(self, frame: bytes, *, to_all: bool = False) -> None:
        """Send a frame as it is, over the better link; `to_all` if it is for everybody behind the same port."""
        self.used.send_frame(frame, to_all=to_all)

    def hear(self, message: messages.Message) -> None:
        """Hand on what did not come over these links, and is about their vehicle."""
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
        """Note that a link is alive; returns whether this frame has not come over another one."""
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
    """Open the links to vehicles by name, those of a vehicle that has several as one.

    Args:
        orders: The links.
        now_s: The flight's time.
        keyring: As for `open_mavlink_links`, and so are `radios`.
        radios: Whose RADIO_STATUS is heard without a signature.
        one_radio: Whether the first links of all lead to one radio.
        station: Our own system and component.
        tap: Is shown what comes, of a vehicle with several links over the one in use.
        may_be_absent: Whether the device of one of several links may be there later.

    Raises:
        ConnectionFailed: a port is taken, a device is not there, or a host is not known.
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
