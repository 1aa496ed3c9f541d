"""PX4's side of the mission protocol: a second buffer that replaces the mission at its last item.

Measured on v1.17.0 unless a line names another source.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from missions.items import Command, Frame, MissionItem, MissionKind, PlaceCommand, compute_list_checksum
from simulator import messages
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

CAPACITY = 500
ASK_AGAIN_S = 0.25
GIVE_UP_S = 5.0
NAV_VTOL_TAKEOFF, NAV_VTOL_LAND = 84, 85
"""Commands that PX4 accepts but a multicopter cannot fly."""
BUSY = "WPM: REJ. CMD: Busy"
COMMANDS = frozenset({*Command, NAV_VTOL_TAKEOFF, NAV_VTOL_LAND})
FRAMES = frozenset(Frame)
MOST: Mapping[int, int] = {MissionKind.MISSION: CAPACITY, MissionKind.FENCE: 64, MissionKind.RALLY: 32}
"""Items (dataman)."""
_KNOWN: Mapping[int, Collection[int]] = {
    MissionKind.MISSION: COMMANDS, MissionKind.FENCE: frozenset({*PlaceCommand} - {PlaceCommand.RALLY_POINT}),
    MissionKind.RALLY: {PlaceCommand.RALLY_POINT},
}  # fmt: skip
TIMEOUT_TEXT = (messages.Severity.WARNING, "Operation timeout")


class _Lists:
    """Lists on board, shared by all links."""

    def __init__(self) -> None:
        self.items: dict[int, tuple[MissionItem, ...]] = dict.fromkeys(MOST, ())
        """The mission, the fence and the rally points."""
        self.mission_id = 0
        """CRC32 of the mission."""
        self.stores: list[Px4Store] = []


class Px4Store(Uploading):
    """The mission on board, and the transfers over one link: `beside` is the first link's store."""

    def __init__(self, patience_s: float = 0.0, beside: Px4Store | None = None) -> None:
        self.fault = UploadFault.NONE
        """Effect of an injected fault on uploads."""
        self._give_up_s = max(GIVE_UP_S, patience_s)
        self.lists: _Lists = _Lists() if beside is None else beside.lists
        self.lists.stores.append(self)
        self._download: Transfer | None = None
        self._partner: messages.Peer | None = None
        """Partner of the present or last transfer."""
        self._integer = True
        """Whether it requests items with MISSION_REQUEST_INT."""
        self._last_count, self._last_kind = 0, int(MissionKind.MISSION)
        """Length and kind of the last transfer, whose final ACK may be lost."""

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The mission."""
        return self.lists.items[MissionKind.MISSION]

    @property
    def fence(self) -> tuple[MissionItem, ...]:
        """The fence on board."""
        return self.lists.items[MissionKind.FENCE]

    @property
    def rally(self) -> tuple[MissionItem, ...]:
        """The rally points on board."""
        return self.lists.items[MissionKind.RALLY]

    @property
    def is_busy(self) -> bool:
        """Whether a transfer is under way."""
        return self._upload is not None or self._download is not None

    def handle(
        self,
        message: messages.MissionMessage,
        sender: messages.Peer,
        now_s: float,
        *,
        locked: bool,  # noqa: ARG002
    ) -> StoreStep:
        """Handle a protocol message; this dialect accepts a clear in flight, ``locked`` or not."""
        if isinstance(message, messages.MissionAckReceived):
            return self._end(message, sender)
        if message.mission_type not in MOST:
            return acknowledge(sender, messages.MissionResult.UNSUPPORTED, message.mission_type)
        match message:
            case messages.MissionCount():
                return self._begin(message, sender, now_s)
            case messages.MissionWritePartialList():
                return StoreStep()  # this dialect lacks the message
            case messages.ItemReceived():
                return self._store(message, sender, now_s)
            case messages.MissionRequestList():
                return self._begin_download(sender, now_s, message.mission_type)
            case messages.MissionRequest():
                return self._read(message, sender, now_s)
            case messages.MissionClearAll():
                return self._clear(sender, message.mission_type)

    def tick(self, now_s: float) -> StoreStep:
        """Repeat a request after 250 ms; give up after 5 s or the configured time, with a text and without an ACK."""
        if self._download is not None and now_s - self._download.heard_s >= self._give_up_s:
            self._download = None
            return StoreStep(texts=(TIMEOUT_TEXT,))
        upload = self._upload
        if upload is None:
            return StoreStep()
        if now_s - upload.heard_s >= self._give_up_s:
            self._upload = None
            return StoreStep(texts=(TIMEOUT_TEXT,))
        if upload.is_stalled(self.fault) or now_s - upload.asked_s < ASK_AGAIN_S:
            return StoreStep()
        return StoreStep((self._ask(upload, now_s),))

    def forget_transfers(self) -> None:
        """Drop the present transfer."""
        self._upload = self._download = None

    def _clear(self, sender: messages.Peer, kind: int) -> StoreStep:
        if self.is_busy:
            return _reject_with_text("WPM: IGN CLEAR CMD: Busy")
        return self._empty_list(sender, kind)

    def _empty_list(self, sender: messages.Peer, kind: int) -> StoreStep:
        self._replace(kind, ())
        accepted = acknowledge(sender, messages.MissionResult.ACCEPTED, kind)
        return replace(accepted, fenced=kind == MissionKind.FENCE, cleared=kind == MissionKind.MISSION)

    def _begin(self, message: messages.MissionCount, sender: messages.Peer, now_s: float) -> StoreStep:
        refused = acknowledge(sender, messages.MissionResult.ERROR, message.mission_type)
        if self.fault is UploadFault.REFUSE:
            return refused
        if self._download is not None:
            return replace(refused, texts=_build_critical_text("WPM: IGN MISSION_COUNT: Busy"))
        if any(other.is_receiving for other in self.lists.stores if other is not self):
            return refused  # from its source: one upload over all links; a request on another prolongs nothing
        if self._upload is not None and (sender != self._upload.partner or self._upload.next > 0):
            # A refused request from any sender prolongs the transfer.
            self._upload.heard_s = now_s
            return refused if sender != self._upload.partner else replace(refused, texts=_build_critical_text(BUSY))
        self._partner = sender
        self._upload = None
        if message.count > MOST[message.mission_type]:
            return acknowledge(sender, messages.MissionResult.NO_SPACE, message.mission_type)
        if message.count == 0:
            return self._empty_list(sender, message.mission_type)
        self._upload = Transfer(sender, message.count, heard_s=now_s, asked_s=now_s, kind=message.mission_type)
        return StoreStep((self._ask(self._upload, now_s),))

    def _store(self, message: messages.ItemReceived, sender: messages.Peer, now_s: float) -> StoreStep:
        if sender != self._partner:
            return _reject_with_text("REJ. MIS ITEM: partner id mismatch")
        upload = self._upload
        # It continues with the request type that was answered.
        self._integer = message.integer
        if upload is None:
            return self._handle_late_item(message, sender)
        upload.heard_s = now_s
        item = message.item
        if item.seq != upload.next or message.mission_type != upload.kind:
            return StoreStep()
        refusal = None
        if item.frame not in FRAMES:
            refusal = messages.MissionResult.UNSUPPORTED_FRAME
        elif item.command not in _KNOWN[upload.kind]:
            refusal = messages.MissionResult.UNSUPPORTED
        if refusal is not None:
            self._upload = None
            return acknowledge(sender, refusal, upload.kind, _build_critical_text("IGN MISSION_ITEM: Invalid item"))
        if item.command in {PlaceCommand.INCLUSION_VERTEX, PlaceCommand.EXCLUSION_VERTEX} and item.param1 < 3:
            self._upload = None  # too few corners
            return acknowledge(sender, messages.MissionResult.ERROR, upload.kind)
        upload.items.append(item)
        upload.next += 1
        if upload.next == upload.count:
            return self._finish(upload)
        if upload.is_stalled(self.fault):
            return StoreStep()
        return StoreStep((self._ask(upload, now_s),))

    def _handle_late_item(self, message: messages.ItemReceived, sender: messages.Peer) -> StoreStep:
        refused = acknowledge(sender, messages.MissionResult.ERROR, message.mission_type)
        if self._download is not None:
            return replace(refused, texts=_build_critical_text("IGN MISSION_ITEM: Busy"))
        if message.item.seq == self._last_count - 1 and message.mission_type == self._last_kind:
            if message.mission_type != MissionKind.MISSION:
                return acknowledge(sender, messages.MissionResult.ACCEPTED, message.mission_type)
            # The final ACK was lost: it is repeated.
            return acknowledge(sender, messages.MissionResult.ACCEPTED, opaque_id=self.lists.mission_id)
        return replace(refused, texts=_build_critical_text("IGN MISSION_ITEM: No transfer"))

    def _finish(self, upload: Transfer) -> StoreStep:
        self._upload = None
        self._last_count, self._last_kind = upload.count, upload.kind
        if upload.kind != MissionKind.MISSION:
            self._replace(upload.kind, tuple(upload.items))
            accepted = acknowledge(upload.partner, messages.MissionResult.ACCEPTED, upload.kind)
            return replace(accepted, fenced=upload.kind == MissionKind.FENCE)
        crc = compute_list_checksum(upload.items)
        reply = acknowledge(upload.partner, messages.MissionResult.ACCEPTED, opaque_id=crc)
        if crc == self.lists.mission_id:
            # Identical content is not evaluated again, not even for its ``current``.
            return reply
        flagged = [item.seq for item in upload.items if item.current]
        self._replace(upload.kind, tuple(upload.items))
        return replace(reply, swapped=True, current=flagged[0] if flagged else None)

    def _replace(self, kind: int, items: tuple[MissionItem, ...]) -> None:
        self.lists.items[kind] = items
        self.lists.mission_id = compute_list_checksum(self.items)

    def _end(self, message: messages.MissionAckReceived, sender: messages.Peer) -> StoreStep:
        if sender != self._partner:
            return _reject_with_text("REJ. WP CMD: partner id mismatch")
        self._download = None
        if message.result == messages.MissionResult.OPERATION_CANCELLED:
            self._upload = None
        return StoreStep()

    def _begin_download(self, sender: messages.Peer, now_s: float, kind: int) -> StoreStep:
        others = self._download is not None and self._download.partner != sender
        if self._upload is not None or others:
            # A text to all, and no ACK.
            return StoreStep(texts=((messages.Severity.INFO, "Mission download request ignored, already active"),))
        self._partner = sender
        items = self.lists.items[kind]
        self._download = Transfer(sender, len(items), heard_s=now_s, asked_s=now_s, kind=kind)
        return StoreStep((build_mission_count(sender, len(items), compute_list_checksum(items), kind),))

    def _read(self, message: messages.MissionRequest, sender: messages.Peer, now_s: float) -> StoreStep:
        self._integer = message.integer
        if sender != self._partner:
            return _reject_with_text("WPM: REJ. CMD: partner id mismatch")
        if self._upload is not None:
            return _reject_with_text(BUSY)
        download = self._download
        if download is None:
            return StoreStep()
        download.heard_s = now_s
        expected = message.seq in {download.next, download.next - 1} and message.seq < download.count
        if not expected or message.mission_type != download.kind:
            self._download = None
            text = _build_critical_text("WPM: REJ. CMD: Req. WP was unexpected")
            return acknowledge(sender, messages.MissionResult.ERROR, message.mission_type, text)
        download.next = message.seq + 1
        item = _to_message_form(self.lists.items[download.kind][message.seq], integer=message.integer)
        return StoreStep((build_mission_item(sender, item, integer=message.integer, mission_type=download.kind),))

    def _ask(self, upload: Transfer, now_s: float) -> messages.Outbound:
        upload.asked_s = now_s
        name = "MISSION_REQUEST_INT" if self._integer else "MISSION_REQUEST"
        return build_mission_request(name, upload.partner, upload.next, upload.kind)


def _to_message_form(item: MissionItem, *, integer: bool) -> MissionItem:
    """Return the item as sent: frames with and without _INT are equal, and follow the message type."""
    pairs = ((Frame.GLOBAL, Frame.GLOBAL_INT), (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT))
    frame = next((pair[integer] for pair in pairs if item.frame in pair), item.frame)
    return replace(item, frame=frame)


def _build_critical_text(text: str) -> tuple[tuple[int, str], ...]:
    return ((messages.Severity.CRITICAL, text),)


def _reject_with_text(text: str) -> StoreStep:
    return StoreStep(texts=_build_critical_text(text))
