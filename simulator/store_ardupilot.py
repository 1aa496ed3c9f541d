"""ArduPilot's side of the mission protocol, measured on Copter 4.7-dev unless a line names another source.

A mission changes item by item, a fence and rally points take effect at the last item of an upload.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missions.items import Command, Frame, MissionItem, MissionKind, PlaceCommand
from missions.stored_items import predict_stored_item
from simulator.messages import (
    ItemReceived,
    MissionAckReceived,
    MissionClearAll,
    MissionCount,
    MissionMessage,
    MissionRequest,
    MissionRequestList,
    MissionResult,
    MissionWritePartialList,
    Peer,
    Severity,
)
from simulator.mission_file import FilePart
from simulator.mission_store import (
    StoreStep,
    Transfer,
    UploadFault,
    Uploading,
    acknowledge,
    build_mission_count,
    build_mission_item,
    build_mission_request,
)

MOST = {MissionKind.MISSION: 650, MissionKind.FENCE: 70, MissionKind.RALLY: 20}
"""Item capacity of the board (measured); other boards hold more."""
ASK_AGAIN_S = 1.0
GIVE_UP_S = 8.0
NAMES = {MissionKind.MISSION: "Mission", MissionKind.FENCE: "Fence", MissionKind.RALLY: "Rally"}
_SHAPES = frozenset({*PlaceCommand} - {PlaceCommand.RALLY_POINT})
_POLYGONS = frozenset({PlaceCommand.INCLUSION_VERTEX, PlaceCommand.EXCLUSION_VERTEX})


class ArduPilotList(Uploading):
    """A list of items and the dialogue that changes it: a fence, rally points, or a mission, which extends it."""

    def __init__(self, kind: MissionKind, patience_s: float = 0.0) -> None:
        self.kind = kind
        self.fault = UploadFault.NONE
        self._items: tuple[MissionItem, ...] = ()
        self._give_up_s = max(GIVE_UP_S, patience_s)
        self.slow_s = 0.0
        """Additional delay of repeated requests on a slow radio."""

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """Items on board."""
        return self._items

    def handle(self, message: MissionMessage, sender: Peer, now_s: float, *, locked: bool) -> StoreStep:
        """Handle a protocol message; ``locked`` means that the list cannot be cleared now."""
        if isinstance(message, MissionAckReceived):
            # The end of a download; it needs no state here. It is not accepted as cancellation of an upload.
            return StoreStep()
        reads = isinstance(message, MissionRequestList | MissionRequest)
        if self._upload is not None and (reads or self._upload.partner != sender):
            return self._build_ack(sender, MissionResult.DENIED)
        match message:
            case MissionCount(count):
                return self._begin(count, sender, now_s)
            case MissionWritePartialList(first, last):
                return self._begin_part(first, last, sender, now_s)
            case ItemReceived():
                return self._take(message, sender, now_s)
            case MissionClearAll():
                return self._build_ack(sender, MissionResult.ERROR) if locked else self._clear(sender)
            case MissionRequestList():
                return StoreStep((build_mission_count(sender, len(self.items), mission_type=self.kind),))
            case MissionRequest():
                return self._read(message, sender)

    def tick(self, now_s: float) -> StoreStep:
        """Repeat a request after a second; give up after eight or the configured time."""
        upload = self._upload
        if upload is None:
            return StoreStep()
        if now_s - upload.heard_s >= self._give_up_s:
            self._upload = None
            timeout = ((Severity.WARNING, f"{NAMES[self.kind]} upload timeout"),)
            return self._build_ack(upload.partner, MissionResult.OPERATION_CANCELLED, timeout)
        if upload.is_stalled(self.fault) or now_s - upload.asked_s < ASK_AGAIN_S + self.slow_s:
            return StoreStep()
        return self._request_next_item(upload, now_s)

    def forget_transfers(self) -> None:
        """Drop the present transfer."""
        self._upload = None

    # Overridden for a mission.

    def _begin(self, count: int, sender: Peer, now_s: float) -> StoreStep:
        if self.fault is UploadFault.REFUSE:
            return self._build_ack(sender, MissionResult.DENIED)
        if count > MOST[self.kind]:
            text = ((Severity.WARNING, f"Only {MOST[self.kind]} items are supported"),)
            return self._build_ack(sender, MissionResult.NO_SPACE, text)
        upload = Transfer(sender, count, heard_s=now_s, asked_s=now_s, kind=self.kind)
        self._upload = upload if count > 0 else None
        step = self._finish(upload, sender) if count == 0 else self._request_next_item(upload, now_s)
        return replace(step, truncated=self._truncate(count))

    def _begin_part(self, first: int, last: int, sender: Peer, now_s: float) -> StoreStep:
        """Request a part of the list on board; the rest stays."""
        if self._upload is not None:
            return self._build_ack(sender, MissionResult.DENIED)
        if not 0 <= first <= last <= len(self.items):
            text = ((Severity.WARNING, "Flight plan update rejected"),)
            return self._build_ack(sender, MissionResult.ERROR, text)
        before, rest = list(self.items[:first]), self.items[last + 1 :]
        self._upload = Transfer(sender, last + 1, now_s, now_s, first, before, self.kind, rest)
        return self._request_next_item(self._upload, now_s)

    def _truncate(self, count: int) -> bool:  # noqa: ARG002 - it is replaced at its last item
        """Shorten the list on board to an upload's length; returns whether that happens at the announcement."""
        return False

    def _take(self, message: ItemReceived, sender: Peer, now_s: float) -> StoreStep:
        upload = self._upload
        if upload is None:
            return self._build_ack(sender, MissionResult.ERROR)
        if message.item.seq != upload.next:
            # A warning only: the upload continues.
            return self._build_ack(sender, MissionResult.INVALID_SEQUENCE)
        refusal = self._refuse_item(message.item)
        if refusal is not None:
            self._upload = None
            return self._build_ack(sender, refusal)
        self._keep_item(upload, message.item)
        upload.next += 1
        upload.heard_s = now_s
        if upload.next == upload.count:
            self._upload = None
            return self._comment(message, self._finish(upload, sender))
        stalled = upload.is_stalled(self.fault)
        return self._comment(message, StoreStep() if stalled else self._request_next_item(upload, now_s))

    def _comment(self, message: ItemReceived, step: StoreStep) -> StoreStep:  # noqa: ARG002 - nothing to say
        return step

    def _refuse_item(self, item: MissionItem) -> MissionResult | None:
        known = _SHAPES if self.kind is MissionKind.FENCE else {PlaceCommand.RALLY_POINT}
        return None if item.command in known else MissionResult.UNSUPPORTED

    def _keep_item(self, upload: Transfer, item: MissionItem) -> None:
        # It is sent back without flags, and a rally point with the height in whole metres.
        if self.kind is MissionKind.RALLY:
            item = replace(item, frame=Frame.GLOBAL_RELATIVE_ALT, z=float(int(item.z)))
        else:
            item = replace(item, frame=Frame.GLOBAL, param2=0.0, param3=0.0, z=0.0)
        upload.items.append(replace(item, current=False, autocontinue=False))

    def _finish(self, upload: Transfer, sender: Peer) -> StoreStep:
        items = (*upload.items, *upload.rest)
        if self.kind is MissionKind.FENCE and not is_complete_list(items):
            return self._build_ack(sender, MissionResult.ERROR, ((Severity.WARNING, "Fence validation failed"),))
        return self._replace_items(items, sender)

    def _clear(self, sender: Peer) -> StoreStep:
        return self._replace_items((), sender)

    def _read(self, message: MissionRequest, sender: Peer) -> StoreStep:
        if not 0 <= message.seq < len(self.items):
            return self._build_ack(sender, MissionResult.INVALID_SEQUENCE)
        item = self.items[message.seq]
        return StoreStep((build_mission_item(sender, item, integer=message.integer, mission_type=self.kind),))

    # Answers.

    def _replace_items(self, items: tuple[MissionItem, ...], sender: Peer) -> StoreStep:
        self._items = items
        texts = ((Severity.DEBUG, "Fence Indexed OK"),) if self.kind is MissionKind.FENCE else ()
        return replace(self._build_ack(sender, MissionResult.ACCEPTED, texts), fenced=self.kind is MissionKind.FENCE)

    def _request_next_item(self, upload: Transfer, now_s: float) -> StoreStep:
        upload.asked_s = now_s
        return StoreStep((build_mission_request("MISSION_REQUEST", upload.partner, upload.next, self.kind),))

    def _build_ack(self, sender: Peer, result: MissionResult, texts: tuple[tuple[int, str], ...] = ()) -> StoreStep:
        return acknowledge(sender, result, self.kind, texts)


def is_complete_list(items: Sequence[MissionItem]) -> bool:
    """Return whether every polygon has at least three corners, and its stated number."""
    index = 0
    while index < len(items):
        item, size = items[index], 1
        if item.command in _POLYGONS:
            size = int(item.param1)
            ring = items[index : index + size]
            if size < 3 or len(ring) < size or any((one.command, one.param1) != (item.command, size) for one in ring):
                return False
        index += size
    return True


COMMANDS = frozenset(Command)
FRAMES = frozenset(Frame)
RECEIVED = ((Severity.INFO, "Flight plan received"),)
REQUEST_ADVICE = "got MISSION_REQUEST; use MISSION_REQUEST_INT!"
ITEM_ADVICE = "got MISSION_ITEM; GCS should send MISSION_ITEM_INT"


class ArduPilotStore(ArduPilotList):
    """The mission on board; item 0 is the vehicle's own home and never overwritten."""

    def __init__(self, home: MissionItem, patience_s: float = 0.0) -> None:
        super().__init__(MissionKind.MISSION, patience_s)
        self._memory: list[MissionItem] = [home]
        """Storage on the board; items beyond ``_count`` are stale but still present."""
        self._count = 1
        self._advised: set[str] = set()
        self._lists: dict[int, ArduPilotList] = {
            kind: ArduPilotList(kind, patience_s) for kind in (MissionKind.FENCE, MissionKind.RALLY)
        }

    @property
    def upload(self) -> Transfer | None:
        """Upload whose items it is requesting, of all three lists."""
        return next((one for one in (self._upload, *(one.upload for one in self._lists.values())) if one), None)

    def set_home(self, home: MissionItem) -> None:
        """Replace the vehicle's own home."""
        self._memory[0] = home

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The mission, home included."""
        return tuple(self._memory[: self._count])

    @property
    def fence(self) -> tuple[MissionItem, ...]:
        """The fence on board."""
        return self._lists[MissionKind.FENCE].items

    @property
    def rally(self) -> tuple[MissionItem, ...]:
        """The rally points on board."""
        return self._lists[MissionKind.RALLY].items

    def item_at(self, seq: int) -> MissionItem | None:
        """Return the item at an index of the mission, or None."""
        return self._memory[seq] if 0 <= seq < self._count else None

    @property
    def count(self) -> int:
        """Number of items, home included."""
        return self._count

    def stale_item_at(self, seq: int) -> MissionItem | None:
        """Return the stored item at an index, even beyond the mission's end."""
        return self._memory[seq] if 0 <= seq < len(self._memory) else None

    def handle(self, message: MissionMessage, sender: Peer, now_s: float, *, locked: bool) -> StoreStep:
        """Handle a message with the list it addresses; ``locked`` means that the mission runs, armed."""
        if isinstance(message, MissionAckReceived) or message.mission_type == self.kind:
            return super().handle(message, sender, now_s, locked=locked)
        beside = self._lists.get(message.mission_type)
        if beside is None:
            return acknowledge(sender, MissionResult.UNSUPPORTED, message.mission_type)
        beside.fault = self.fault
        return beside.handle(message, sender, now_s, locked=False)

    def put_file_part(self, part: FilePart, *, locked: bool) -> StoreStep:
        """Store a part of the mission that came as a file; ``locked`` means that the mission runs, armed."""
        cleared = not part.keeps_rest and not locked
        if cleared:
            self._count = 1
        for at, item in enumerate(part.items, start=part.first):
            if self._refuse_item(item) is not None or at > self._count:
                break
            self._put(replace(item, seq=at))
        return StoreStep(cleared=cleared, stored=True)

    def tick(self, now_s: float) -> StoreStep:
        """Continue the uploads of all three lists."""
        steps = [super().tick(now_s), *(one.tick(now_s) for one in self._lists.values())]
        said = [step for step in steps if step.send or step.texts]
        if not said:
            return StoreStep()
        return StoreStep(
            tuple(one for step in said for one in step.send), tuple(one for step in said for one in step.texts)
        )

    def forget_transfers(self) -> None:
        """Drop the present transfers."""
        super().forget_transfers()
        for one in self._lists.values():
            one.forget_transfers()

    def _truncate(self, count: int) -> bool:
        # Measured: 0 is accepted in AUTO too, and it continues to its old waypoint.
        self._count = min(self._count, count)
        return True

    def _comment(self, message: ItemReceived, step: StoreStep) -> StoreStep:
        advice = () if message.integer else self._recommend_int_messages(ITEM_ADVICE)
        return replace(step, texts=(*advice, *step.texts), stored=message.item.seq > 0)

    def _refuse_item(self, item: MissionItem) -> MissionResult | None:
        if item.frame not in FRAMES:
            return MissionResult.UNSUPPORTED_FRAME
        return None if item.command in COMMANDS else MissionResult.UNSUPPORTED

    def _keep_item(self, upload: Transfer, item: MissionItem) -> None:  # noqa: ARG002 - it lies in its place at once
        self._put(item)

    def _put(self, item: MissionItem) -> None:
        if item.seq > 0:
            self._memory[item.seq : item.seq + 1] = [predict_stored_item(item)]
        self._count = max(self._count, item.seq + 1)

    def _finish(self, upload: Transfer, sender: Peer) -> StoreStep:  # noqa: ARG002 - all is in place
        return self._build_ack(sender, MissionResult.ACCEPTED, RECEIVED)

    def _clear(self, sender: Peer) -> StoreStep:
        self._count = 0
        self._upload = None
        return replace(self._build_ack(sender, MissionResult.ACCEPTED), cleared=True)

    def _read(self, message: MissionRequest, sender: Peer) -> StoreStep:
        step = super()._read(message, sender)
        if self.item_at(message.seq) is None:
            # It reports the number of items.
            return StoreStep((build_mission_count(sender, self._count), *step.send))
        return replace(step, texts=() if message.integer else self._recommend_int_messages(REQUEST_ADVICE))

    def _recommend_int_messages(self, text: str) -> tuple[tuple[int, str], ...]:
        if text in self._advised:
            return ()
        self._advised.add(text)
        return ((Severity.WARNING, text),)
