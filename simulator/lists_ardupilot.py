"""ArduPilot's lists: how an upload of any of them goes on and ends; and its fence and rally points.

The latter have a dialogue of their own each, and take effect at its last item.

Measured on Copter 4.7-dev unless a line says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missions.items import Frame, MissionItem, PlaceCommand
from simulator.enums import MissionResult, Severity
from simulator.messages import (
    MISSION_TYPE_MISSION,
    ItemReceived,
    MissionClearAll,
    MissionCount,
    MissionMessage,
    MissionRequest,
    MissionRequestList,
    Peer,
)
from simulator.mission_store import (
    StoreStep,
    Transfer,
    UploadFault,
    build_mission_ack,
    build_mission_count,
    build_mission_item,
    build_mission_request,
    to_item,
)

FENCE, RALLY = 1, 2
MOST = {MISSION_TYPE_MISSION: 650, FENCE: 70, RALLY: 20}
"""Items that the board has room for; measured, other boards have room for more."""
ASK_AGAIN_S = 1.0
GIVE_UP_S = 8.0
NAMES = {MISSION_TYPE_MISSION: "Mission", FENCE: "Fence", RALLY: "Rally"}
_SHAPES = frozenset({*PlaceCommand} - {PlaceCommand.RALLY_POINT})
_POLYGONS = frozenset({PlaceCommand.INCLUSION_VERTEX, PlaceCommand.EXCLUSION_VERTEX})


class ArduPilotUploads:
    """The uploads of one list: who sends one, and what is asked for next."""

    def __init__(self, kind: int, patience_s: float) -> None:
        self.kind = kind
        self.fault = UploadFault.NONE
        self._give_up_s = max(GIVE_UP_S, patience_s)
        self._upload: Transfer | None = None

    def tick(self, now_s: float) -> StoreStep:
        """Ask again after a second, give up after eight or what the simulation demands."""
        upload = self._upload
        if upload is None:
            return StoreStep()
        if now_s - upload.heard_s >= self._give_up_s:
            self._upload = None
            timeout = ((Severity.WARNING, f"{NAMES[self.kind]} upload timeout"),)
            return self._build_ack(upload.partner, MissionResult.OPERATION_CANCELLED, timeout)
        if upload.is_stalled(self.fault) or now_s - upload.asked_s < ASK_AGAIN_S:
            return StoreStep()
        return self._request_next_item(upload, now_s)

    def forget_transfers(self) -> None:
        """Drop what is under way."""
        self._upload = None

    def _refuse_upload(self, count: int, sender: Peer) -> StoreStep | None:
        """Return why an upload of so many items does not begin."""
        if self.fault is UploadFault.REFUSE:
            return self._build_ack(sender, MissionResult.DENIED)
        if count > MOST[self.kind]:
            text = ((Severity.WARNING, f"Only {MOST[self.kind]} items are supported"),)
            return self._build_ack(sender, MissionResult.NO_SPACE, text)
        return None

    def _begin_upload(self, count: int, sender: Peer, now_s: float) -> StoreStep:
        self._upload = Transfer(sender, count, heard_s=now_s, asked_s=now_s, kind=self.kind)
        return self._request_next_item(self._upload, now_s)

    def _request_next_item(self, upload: Transfer, now_s: float) -> StoreStep:
        upload.asked_s = now_s
        return StoreStep((build_mission_request("MISSION_REQUEST", upload.partner, upload.next, self.kind),))

    def _build_ack(self, sender: Peer, result: MissionResult, texts: tuple[tuple[int, str], ...] = ()) -> StoreStep:
        return StoreStep((build_mission_ack(sender, result, self.kind),), texts)


class ArduPilotList(ArduPilotUploads):
    """A fence, or rally points."""

    def __init__(self, kind: int, patience_s: float = 0.0) -> None:
        super().__init__(kind, patience_s)
        self.items: tuple[MissionItem, ...] = ()

    def handle(self, message: MissionMessage, sender: Peer, now_s: float) -> StoreStep:  # noqa: PLR0911 - one each
        """Follow the protocol."""
        if self._upload is not None and self._upload.partner != sender:
            return self._build_ack(sender, MissionResult.DENIED)
        match message:
            case MissionCount(count):
                return self._begin(count, sender, now_s)
            case ItemReceived():
                return self._take(message, sender, now_s)
            case MissionRequestList() | MissionRequest() if self._upload is not None:
                return self._build_ack(sender, MissionResult.DENIED)
            case MissionRequestList():
                return StoreStep((build_mission_count(sender, len(self.items), mission_type=self.kind),))
            case MissionRequest(seq):
                if not 0 <= seq < len(self.items):
                    return self._build_ack(sender, MissionResult.INVALID_SEQUENCE)
                item = self.items[seq]
                return StoreStep((build_mission_item(sender, item, integer=message.integer, mission_type=self.kind),))
            case MissionClearAll():
                return self._replace_items((), sender)
            case _:
                return StoreStep()

    def _begin(self, count: int, sender: Peer, now_s: float) -> StoreStep:
        refusal = self._refuse_upload(count, sender)
        if refusal is not None:
            return refusal
        if count == 0:
            self._upload = None
            return self._replace_items((), sender)
        return self._begin_upload(count, sender, now_s)

    def _take(self, message: ItemReceived, sender: Peer, now_s: float) -> StoreStep:
        upload = self._upload
        if upload is None:
            return self._build_ack(sender, MissionResult.ERROR)
        if message.seq != upload.next:
            return self._build_ack(sender, MissionResult.INVALID_SEQUENCE)
        if message.command not in (_SHAPES if self.kind == FENCE else {PlaceCommand.RALLY_POINT}):
            self._upload = None
            return self._build_ack(sender, MissionResult.UNSUPPORTED)
        upload.items.append(_to_stored(to_item(message)))
        upload.next += 1
        upload.heard_s = now_s
        if upload.next < upload.count:
            return StoreStep() if upload.is_stalled(self.fault) else self._request_next_item(upload, now_s)
        self._upload = None
        if self.kind == FENCE and not is_whole(upload.items):
            return self._build_ack(sender, MissionResult.ERROR, ((Severity.WARNING, "Fence validation failed"),))
        return self._replace_items(tuple(upload.items), sender)

    def _replace_items(self, items: tuple[MissionItem, ...], sender: Peer) -> StoreStep:
        self.items = items
        texts = ((Severity.DEBUG, "Fence Indexed OK"),) if self.kind == FENCE else ()
        return replace(self._build_ack(sender, MissionResult.ACCEPTED, texts), fenced=self.kind == FENCE)


def is_whole(items: Sequence[MissionItem]) -> bool:
    """Return whether every polygon has three corners or more, and as many as it says."""
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


def _to_stored(item: MissionItem) -> MissionItem:
    """Return an item as it comes back: without flags, of a rally point the height in whole metres."""
    if item.command == PlaceCommand.RALLY_POINT:
        return replace(item, current=False, autocontinue=False, frame=Frame.GLOBAL_RELATIVE_ALT, z=float(int(item.z)))
    return replace(item, current=False, autocontinue=False, frame=Frame.GLOBAL, param2=0.0, param3=0.0, z=0.0)
