"""The autopilots' side of the mission, command and parameter protocols, message by message.

What each of the two does is written down in docs/autopilots_measured.md and field_guide.md; nothing is shared with the
simulated vehicles, so that a misreading there is not repeated here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from executor.core.interface.messages import (
    CommandAck,
    FileRequest,
    Heartbeat,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
    Outgoing,
    ParamValue,
    SendCommand,
    SendParamRequest,
    SendParamSet,
)
from executor.core.radio_budget import HEARTBEAT
from executor.protocols import vehicle_commands
from missions import Command, Dialect, Frame, MissionItem, MissionKind, ModeNumber, compute_list_checksum
from tests.fakes.mission_file import FakeMissionFile

ACCEPTED, ERROR, UNSUPPORTED, INVALID_SEQUENCE, DENIED, CANCELLED = 0, 1, 3, 13, 14, 15
HEARTBEAT_S = 1.0
ITEM_SILENCE_S = {"ardupilot": 1.0, "px4": 0.25}
"""It asks again for a missing item after this (measured)."""


@dataclass(slots=True)
class _Transfer:
    count: int
    heard_s: float
    asked_s: float
    items: list[MissionItem] = field(default_factory=list)


class FakeMissions:
    """A vehicle's mission memory and the protocol around it."""

    def __init__(self, dialect: Dialect, items: Sequence[MissionItem] = ()) -> None:
        """Begin with a mission on board."""
        self.dialect = dialect
        self.items = list(items)
        self.refuses: int | None = None
        """MAV_MISSION_RESULT with which every upload is refused."""
        self.stops_at: int | None = None
        """The item from which on it asks for nothing more."""
        self.spoils: int | None = None
        """The item that it stores with another height."""
        self.swallows_ack = False
        """Whether the next final acknowledgement gets lost."""
        self.other_until_s = float("-inf")
        """Until then another ground station's transfer, which is dead, keeps it busy."""
        self.file = FakeMissionFile(self._put_part, lambda: self.items)
        self._upload: _Transfer | None = None
        self._reading_until_s = float("-inf")
        self._last_count = 0

    @property
    def wake_s(self) -> float | None:
        """When it asks again or gives up."""
        upload = self._upload
        if upload is None:
            return None
        gives_up_s = upload.heard_s + self.dialect.upload_silence_s
        return gives_up_s if self._mute(upload) else min(gives_up_s, upload.asked_s + ITEM_SILENCE_S[self.dialect.name])

    def tick(self, now_s: float) -> list[Message]:
        """Ask again, or give up: ArduPilot with an acknowledgement, PX4 without."""
        upload = self._upload
        if upload is None:
            return []
        if now_s >= upload.heard_s + self.dialect.upload_silence_s:
            self._upload = None
            return [] if self.dialect.upload_is_atomic else [MissionAck(CANCELLED)]
        if self._mute(upload) or now_s < upload.asked_s + ITEM_SILENCE_S[self.dialect.name]:
            return []
        return self._ask(upload, now_s)

    def hear(self, message: Outgoing, now_s: float) -> list[Message]:
        """Take part in a transfer."""
        match message:
            case MissionCount(count):
                return self._begin(count, now_s)
            case MissionItemInt(item):
                return self._store(item, now_s)
            case MissionRequestList():
                return self._list(now_s)
            case MissionRequest(seq):
                return self._read(seq, now_s)
            case FileRequest() if self.dialect.takes_mission_file:
                return [self.file.hear(message, now_s)]
            case MissionAck(result):
                self._reading_until_s = float("-inf")
                if self.dialect.upload_is_atomic and result == CANCELLED:
                    self._upload = None
        return []

    def _begin(self, count: int, now_s: float) -> list[Message]:
        if self.refuses is not None:
            return [MissionAck(self.refuses)]
        if now_s < self.other_until_s:
            if self.dialect.upload_is_atomic:  # "Busy": whoever asks in vain, the transfer lives longer by it
                self.other_until_s = max(self.other_until_s, now_s + self.dialect.transfer_freed_s)
            return [MissionAck(ERROR if self.dialect.upload_is_atomic else DENIED)]
        if self.dialect.upload_is_atomic:
            if now_s < self._reading_until_s or (self._upload is not None and self._upload.items):
                return [MissionAck(ERROR)]  # "Busy"; the transfer goes on
            if count == 0:
                self.items = []
                return [MissionAck(ACCEPTED)]
        else:
            del self.items[count:]  # in place: what is longer than the new list is gone at once
        self._upload = _Transfer(count, now_s, now_s)
        return self._ask(self._upload, now_s)

    def _store(self, item: MissionItem, now_s: float) -> list[Message]:
        upload = self._upload
        if upload is None:
            again = self.dialect.upload_is_atomic and item.seq == self._last_count - 1
            return [MissionAck(ACCEPTED if again else ERROR)]
        if item.seq != len(upload.items):
            return [] if self.dialect.upload_is_atomic else [MissionAck(INVALID_SEQUENCE)]
        if item.command == 0:
            self._upload = None
            return [MissionAck(UNSUPPORTED)]
        upload.items.append(item)
        upload.heard_s = now_s
        stored = replace(self._stored(item), z=item.z + 1.0) if item.seq == self.spoils else self._stored(item)
        if not self.dialect.upload_is_atomic:
            self.items[item.seq : item.seq + 1] = [stored]
        if len(upload.items) < upload.count:
            return [] if self._mute(upload) else self._ask(upload, now_s)
        self._upload, self._last_count = None, upload.count
        if self.dialect.upload_is_atomic:
            self.items = [replace(one, z=one.z + 1.0) if one.seq == self.spoils else one for one in upload.items]
        if self.swallows_ack:
            self.swallows_ack = False
            return []
        return [MissionAck(ACCEPTED, checksum=self._checksum)]

    def _put_part(self, first: int, part: list[MissionItem]) -> None:
        for at, item in enumerate(part, start=first):
            stored = replace(self._stored(item), z=item.z + 1.0) if at == self.spoils else self._stored(item)
            self.items[at : at + 1] = [stored]

    @property
    def _checksum(self) -> int | None:
        return compute_list_checksum(self.items) if self.dialect.says_checksum else None

    def _stored(self, item: MissionItem) -> MissionItem:
        """What ArduPilot makes of an item: its own home, no `current`, speeds without a frame, a landing's turn."""
        if self.dialect.upload_is_atomic:
            return item
        if item.seq == 0:
            return MissionItem(0, Frame.GLOBAL, Command.NAV_WAYPOINT, x=496000000, y=156000000, z=450.0)
        frame = Frame.GLOBAL if item.command == Command.DO_CHANGE_SPEED else item.frame
        turn = 1.0 if item.command == Command.NAV_LAND else item.param4
        return replace(item, current=False, frame=frame, param4=turn)

    def _list(self, now_s: float) -> list[Message]:
        if self.dialect.upload_is_atomic and self._upload is not None:
            return [MissionAck(ERROR)]
        self._upload = None
        self._reading_until_s = now_s + self.dialect.upload_silence_s
        return [MissionCount(len(self.items), checksum=self._checksum)]

    def _read(self, seq: int, now_s: float) -> list[Message]:
        if (self.dialect.upload_is_atomic and now_s >= self._reading_until_s) or seq >= len(self.items):
            return [MissionAck(ERROR)]
        self._reading_until_s = now_s + self.dialect.upload_silence_s
        return [MissionItemInt(self.items[seq])]

    def _mute(self, upload: _Transfer) -> bool:
        return self.stops_at is not None and len(upload.items) >= self.stops_at

    def _ask(self, upload: _Transfer, now_s: float) -> list[Message]:
        upload.asked_s = now_s
        return [MissionRequest(len(upload.items))]


def _of(kind: MissionKind, message: Message) -> Message:
    """Return what is said of a mission as it is said of another list."""
    assert isinstance(message, MissionAck | MissionCount | MissionItemInt | MissionRequest)
    return replace(message, kind=kind)


class FakeAutopilot:
    """A vehicle that answers what is said to it, and sends its heartbeat."""

    def __init__(
        self, dialect: Dialect, *, items: Sequence[MissionItem] = (), parameters: Mapping[str, float] | None = None
    ) -> None:
        """Stand on the ground, disarmed."""
        self.dialect = dialect
        self.missions = FakeMissions(dialect, items)
        # Both autopilots take these as a whole (measured).
        self.beside = {
            kind: FakeMissions(replace(dialect, upload_is_atomic=True))
            for kind in (MissionKind.FENCE, MissionKind.RALLY)
        }
        self.parameters = dict(parameters or {})
        self.stubborn: set[str] = set()
        """Parameters that stay as they are."""
        self.results: dict[int, list[int]] = {}
        """MAV_RESULTs for a command, one for each time that it is given; the last one stays."""
        self.deaf: set[int] = set()
        """Commands that are acknowledged and not obeyed."""
        self.tires = False
        """Whether it disarms by itself as the mission starts: the order came too late."""
        self.unheard = False
        """Whether every heartbeat that was not asked for gets lost."""
        self.armed = False
        self.mode = dialect.modes.hold
        self.commands: list[int] = []
        self._beat_s = 0.0

    @property
    def wake_s(self) -> float:
        """The next heartbeat, or what the mission protocol waits for."""
        lists = (self.missions, *self.beside.values())
        return min(self._beat_s, *(one.wake_s for one in lists if one.wake_s is not None), self._beat_s)

    def tick(self, now_s: float) -> list[Message]:
        """Send what is due."""
        said = self.missions.tick(now_s)
        for kind, one in self.beside.items():
            said += [_of(kind, message) for message in one.tick(now_s)]
        if now_s >= self._beat_s:
            self._beat_s = now_s + HEARTBEAT_S
            said += [] if self.unheard else [self.heartbeat()]
        return said

    def heartbeat(self) -> Heartbeat:
        """What it says of itself."""
        status = 4 if self.armed else 3
        return Heartbeat(self.dialect.number, self.mode.custom_mode, self.armed, status, 2)

    def hear(self, message: Outgoing, now_s: float) -> list[Message]:
        """Answer."""
        match message:
            case SendCommand():
                return self._command(message)
            case SendParamRequest(name):
                return self._value(name, 9)
            case SendParamSet(name, value, kind):
                if name in self.parameters and name not in self.stubborn:
                    self.parameters[name] = value
                return self._value(name, kind)
            case _:
                which = getattr(message, "kind", None)
                if not isinstance(which, MissionKind) or which not in self.beside:
                    return self.missions.hear(message, now_s)
                return [_of(which, answer) for answer in self.beside[which].hear(message, now_s)]

    def _value(self, name: str, kind: int) -> list[Message]:
        return [ParamValue(name, self.parameters[name], kind)] if name in self.parameters else []

    def _command(self, message: SendCommand) -> list[Message]:
        self.commands.append(message.command)
        results = self.results.get(message.command, [ACCEPTED])
        result = results.pop(0) if len(results) > 1 else results[0]
        if result == ACCEPTED and message.command not in self.deaf:
            self._obey(message)
        asked = message.command == vehicle_commands.REQUEST_MESSAGE and message.params[0] == HEARTBEAT
        return [CommandAck(message.command, result), *([self.heartbeat()] if asked else [])]

    def _obey(self, message: SendCommand) -> None:
        modes = self.dialect.modes
        match message.command:
            case vehicle_commands.COMPONENT_ARM_DISARM:
                self.armed = message.params[0] == 1.0
            case vehicle_commands.MISSION_START:
                self.mode = modes.mission
                self.armed = self.armed and not self.tires
            case vehicle_commands.DO_SET_MODE:
                known: tuple[ModeNumber, ...] = (modes.mission, modes.hold, modes.guided, modes.return_home, modes.land)
                wanted = (message.params[1], message.params[2])
                self.change_mode(next(mode for mode in known if (mode.param2, mode.param3) == wanted))
            case vehicle_commands.DO_CHANGE_SPEED:
                self.change_speed(message.params[1])

    def change_mode(self, mode: ModeNumber) -> None:
        """Take on a mode."""
        self.mode = mode

    def change_speed(self, speed_m_s: float) -> None:
        """Take on a speed over ground."""
