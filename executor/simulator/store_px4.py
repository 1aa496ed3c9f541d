"""PX4's side of the mission protocol: a second buffer that replaces the mission at its last item.

Measured on v1.17.0 unless a line says otherwise.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import replace

from executor.simulator.enums import MissionResult, Severity
from executor.simulator.messages import (
    MISSION_TYPE_MISSION,
    ItemReceived,
    MissionAckReceived,
    MissionClearAll,
    MissionCount,
    MissionMessage,
    MissionRequest,
    MissionRequestList,
    Outbound,
    Peer,
)
from executor.simulator.mission_store import (
    StoreStep,
    Transfer,
    UploadFault,
    ack,
    count_message,
    item_message,
    request_message,
    to_item,
)
from missions.items import Command, Frame, MissionItem

CAPACITY = 500
ASK_AGAIN_S = 0.25
GIVE_UP_S = 5.0
NAV_VTOL_TAKEOFF, NAV_VTOL_LAND = 84, 85
"""Known to PX4, so accepted; no mission of a multicopter, so not flown."""
BUSY = "WPM: REJ. CMD: Busy"
COMMANDS = frozenset({*Command, NAV_VTOL_TAKEOFF, NAV_VTOL_LAND})
FRAMES = frozenset(Frame)
TIMEOUT_TEXT = (Severity.WARNING, "Operation timeout")


def mission_checksum(items: Sequence[MissionItem]) -> int:
    """Return the mission's identity: a CRC32 over everything but ``current``; 0 is the empty mission."""
    crc = 0
    for item in items:
        crc = zlib.crc32(
            struct.pack(
                "<BHB4fiif", item.frame, item.command, item.autocontinue, item.param1, item.param2, item.param3,
                item.param4, item.x, item.y, item.z,
            ),
            crc,
        )  # fmt: skip
    return crc


class Px4Store:
    """The mission on board."""

    def __init__(self, patience_s: float = 0.0) -> None:
        self._give_up_s = max(GIVE_UP_S, patience_s)
        self._items: tuple[MissionItem, ...] = ()
        self._mission_id = 0
        self._upload: Transfer | None = None
        self._download: Transfer | None = None
        self._partner: Peer | None = None
        """Of the last transfer, whether it is over or not."""
        self._integer = True
        """Whether it asks for items with MISSION_REQUEST_INT."""
        self._last_count = 0
        """Length of the last transfer, whose final ACK may have been lost."""
        self.fault = UploadFault.NONE

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The mission."""
        return self._items

    @property
    def mission_id(self) -> int:
        """CRC32 of the mission."""
        return self._mission_id

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way."""
        return self._upload is not None or self._download is not None

    def handle(self, message: MissionMessage, sender: Peer, now_s: float, *, locked: bool) -> StoreStep:  # noqa: ARG002
        """Follow the protocol; this dialect may be cleared in flight, ``locked`` or not."""
        if isinstance(message, MissionAckReceived):
            return self._end(message, sender)
        if message.mission_type != MISSION_TYPE_MISSION:
            return StoreStep((ack(sender, MissionResult.UNSUPPORTED, message.mission_type),))
        match message:
            case MissionCount():
                return self._begin(message, sender, now_s)
            case ItemReceived():
                return self._store(message, sender, now_s)
            case MissionRequestList():
                return self._list(sender, now_s)
            case MissionRequest():
                return self._read(message, sender, now_s)
            case MissionClearAll():
                return self._clear(sender)

    def tick(self, now_s: float) -> StoreStep:
        """Ask again after 250 ms, give up after 5 s, or what the simulation demands, with a text and without an ACK."""
        if self._download is not None and now_s - self._download.heard_s >= self._give_up_s:
            self._download = None
            return StoreStep(texts=(TIMEOUT_TEXT,))
        upload = self._upload
        if upload is None:
            return StoreStep()
        if now_s - upload.heard_s >= self._give_up_s:
            self._upload = None
            return StoreStep(texts=(TIMEOUT_TEXT,))
        if self._stalled(upload) or now_s - upload.asked_s < ASK_AGAIN_S:
            return StoreStep()
        return StoreStep((self._ask(upload, now_s),))

    def forget_transfers(self) -> None:
        """Drop what is under way."""
        self._upload = self._download = None

    def _clear(self, sender: Peer) -> StoreStep:
        if self.busy:
            return _complain("WPM: IGN CLEAR CMD: Busy")
        self._replace(())
        return StoreStep((ack(sender, MissionResult.ACCEPTED),), cleared=True)

    def _begin(self, message: MissionCount, sender: Peer, now_s: float) -> StoreStep:
        refused = StoreStep((ack(sender, MissionResult.ERROR),))
        if self.fault is UploadFault.REFUSE:
            return refused
        if self._download is not None:
            return replace(refused, texts=_critical("WPM: IGN MISSION_COUNT: Busy"))
        if self._upload is not None and (sender != self._upload.partner or self._upload.next > 0):
            # Whoever it is that asks in vain, the transfer lives longer by it.
            self._upload.heard_s = now_s
            return refused if sender != self._upload.partner else replace(refused, texts=_critical(BUSY))
        self._partner = sender
        self._upload = None
        if message.count > CAPACITY:
            return StoreStep((ack(sender, MissionResult.NO_SPACE),))
        if message.count == 0:
            self._replace(())
            return StoreStep((ack(sender, MissionResult.ACCEPTED),), cleared=True)
        self._upload = Transfer(sender, message.count, heard_s=now_s, asked_s=now_s)
        return StoreStep((self._ask(self._upload, now_s),))

    def _store(self, message: ItemReceived, sender: Peer, now_s: float) -> StoreStep:
        if sender != self._partner:
            return _complain("REJ. MIS ITEM: partner id mismatch")
        upload = self._upload
        # It asks on in the flavour that it was answered in.
        self._integer = message.integer
        if upload is None:
            return self._late_item(message, sender)
        upload.heard_s = now_s
        if message.seq != upload.next:
            return StoreStep()
        refusal = None
        if message.frame not in FRAMES:
            refusal = MissionResult.UNSUPPORTED_FRAME
        elif message.command not in COMMANDS:
            refusal = MissionResult.UNSUPPORTED
        if refusal is not None:
            self._upload = None
            return StoreStep((ack(sender, refusal),), _critical("IGN MISSION_ITEM: Invalid item"))
        upload.items.append(to_item(message))
        upload.next += 1
        if upload.next == upload.count:
            return self._finish(upload)
        if self._stalled(upload):
            return StoreStep()
        return StoreStep((self._ask(upload, now_s),))

    def _late_item(self, message: ItemReceived, sender: Peer) -> StoreStep:
        refused = StoreStep((ack(sender, MissionResult.ERROR),))
        if self._download is not None:
            return replace(refused, texts=_critical("IGN MISSION_ITEM: Busy"))
        if message.seq == self._last_count - 1:
            # The final ACK was lost: it is said again.
            return StoreStep((ack(sender, MissionResult.ACCEPTED, opaque_id=self._mission_id),))
        return replace(refused, texts=_critical("IGN MISSION_ITEM: No transfer"))

    def _finish(self, upload: Transfer) -> StoreStep:
        self._upload = None
        self._last_count = upload.count
        crc = mission_checksum(upload.items)
        reply = ack(upload.partner, MissionResult.ACCEPTED, opaque_id=crc)
        if crc == self._mission_id:
            # The same content is not looked at again, not even for its ``current``.
            return StoreStep((reply,))
        flagged = [item.seq for item in upload.items if item.current]
        self._replace(tuple(upload.items))
        return StoreStep((reply,), swapped=True, current=flagged[0] if flagged else None)

    def _replace(self, items: tuple[MissionItem, ...]) -> None:
        self._items = items
        self._mission_id = mission_checksum(items)

    def _end(self, message: MissionAckReceived, sender: Peer) -> StoreStep:
        if sender != self._partner:
            return _complain("REJ. WP CMD: partner id mismatch")
        self._download = None
        if message.result == MissionResult.OPERATION_CANCELLED:
            self._upload = None
        return StoreStep()

    def _list(self, sender: Peer, now_s: float) -> StoreStep:
        others = self._download is not None and self._download.partner != sender
        if self._upload is not None or others:
            # A text to everybody, and no ACK.
            return StoreStep(texts=((Severity.INFO, "Mission download request ignored, already active"),))
        self._partner = sender
        self._download = Transfer(sender, len(self._items), heard_s=now_s, asked_s=now_s)
        return StoreStep((count_message(sender, len(self._items), opaque_id=self._mission_id),))

    def _read(self, message: MissionRequest, sender: Peer, now_s: float) -> StoreStep:
        self._integer = message.integer
        if sender != self._partner:
            return _complain("WPM: REJ. CMD: partner id mismatch")
        if self._upload is not None:
            return _complain(BUSY)
        download = self._download
        if download is None:
            return StoreStep()
        download.heard_s = now_s
        expected = message.seq in {download.next, download.next - 1} and message.seq < download.count
        if not expected:
            self._download = None
            refusal = (ack(sender, MissionResult.ERROR),)
            return StoreStep(refusal, _critical("WPM: REJ. CMD: Req. WP was unexpected"))
        download.next = message.seq + 1
        item = _in_flavour(self._items[message.seq], integer=message.integer)
        return StoreStep((item_message(sender, item, integer=message.integer),))

    def _stalled(self, upload: Transfer) -> bool:
        """Return whether an injected fault keeps the vehicle from asking on."""
        return self.fault is UploadFault.HALF and upload.next >= upload.count // 2

    def _ask(self, upload: Transfer, now_s: float) -> Outbound:
        upload.asked_s = now_s
        name = "MISSION_REQUEST_INT" if self._integer else "MISSION_REQUEST"
        return request_message(name, upload.partner, upload.next)


def _in_flavour(item: MissionItem, *, integer: bool) -> MissionItem:
    """Return the item as it is sent: frames with and without _INT are one, and follow the kind of the message."""
    pairs = ((Frame.GLOBAL, Frame.GLOBAL_INT), (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT))
    frame = next((pair[integer] for pair in pairs if item.frame in pair), item.frame)
    return replace(item, frame=frame)


def _critical(text: str) -> tuple[tuple[int, str], ...]:
    return ((Severity.CRITICAL, text),)


def _complain(text: str) -> StoreStep:
    """Say no to everybody, in words alone."""
    return StoreStep(texts=_critical(text))
