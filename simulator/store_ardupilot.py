"""ArduPilot's side of the mission protocol: in place, item by item, not atomic.

Measured on Copter 4.7-dev unless a line says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import replace

from missions.items import PAYLOAD, Command, Frame, MissionItem
from simulator.enums import MissionResult, Severity
from simulator.lists_ardupilot import FENCE, RALLY, ArduPilotList, ArduPilotUploads
from simulator.messages import (
    MISSION_TYPE_MISSION,
    ItemReceived,
    MissionAckReceived,
    MissionClearAll,
    MissionCount,
    MissionMessage,
    MissionRequest,
    MissionRequestList,
    Peer,
)
from simulator.mission_store import (
    StoreStep,
    build_mission_ack,
    build_mission_count,
    build_mission_item,
    is_relative,
    to_item,
)

_Order = MissionCount | ItemReceived | MissionRequestList | MissionRequest | MissionClearAll
COMMANDS = frozenset(Command)
FRAMES = frozenset(Frame)
RECEIVED = ((Severity.INFO, "Flight plan received"),)
REQUEST_ADVICE = "got MISSION_REQUEST; use MISSION_REQUEST_INT!"
ITEM_ADVICE = "got MISSION_ITEM; GCS should send MISSION_ITEM_INT"


class ArduPilotStore(ArduPilotUploads):
    """The mission on board; item 0 is the vehicle's own home and never overwritten."""

    mission_id = 0

    def __init__(self, home: MissionItem, patience_s: float = 0.0) -> None:
        super().__init__(MISSION_TYPE_MISSION, patience_s)
        self._memory: list[MissionItem] = [home]
        """Storage as it is on the board: what lies behind ``_count`` is stale but still there."""
        self._count = 1
        self._advised: set[str] = set()
        self._lists = {kind: ArduPilotList(kind, patience_s) for kind in (FENCE, RALLY)}

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The mission, home included."""
        return tuple(self._memory[: self._count])

    @property
    def fence(self) -> tuple[MissionItem, ...]:
        """The fence on board."""
        return self._lists[FENCE].items

    @property
    def rally(self) -> tuple[MissionItem, ...]:
        """The rally points on board."""
        return self._lists[RALLY].items

    def item_at(self, seq: int) -> MissionItem | None:
        """Return the item at an index of the mission, or None."""
        return self._memory[seq] if 0 <= seq < self._count else None

    @property
    def count(self) -> int:
        """Number of items, home included."""
        return self._count

    def stale_item_at(self, seq: int) -> MissionItem | None:
        """Return what the memory holds at an index, whether it still belongs to the mission or not."""
        return self._memory[seq] if 0 <= seq < len(self._memory) else None

    def handle(self, message: MissionMessage, sender: Peer, now_s: float, *, locked: bool) -> StoreStep:
        """Follow the protocol; ``locked`` is that the mission runs, armed: then it cannot be cleared."""
        if isinstance(message, MissionAckReceived):
            # The end of a download; it needs no state here. As a cancellation of an upload it is not understood.
            return StoreStep()
        if message.mission_type in self._lists:
            beside = self._lists[message.mission_type]
            beside.fault = self.fault
            return beside.handle(message, sender, now_s)
        if message.mission_type != MISSION_TYPE_MISSION:
            return StoreStep((build_mission_ack(sender, MissionResult.UNSUPPORTED, message.mission_type),))
        if self._upload is not None and self._upload.partner != sender:
            return self._build_ack(sender, MissionResult.DENIED)
        return self._handle_mission_message(message, sender, now_s, locked=locked)

    def tick(self, now_s: float) -> StoreStep:
        """Let the uploads of all three lists go on."""
        steps = [super().tick(now_s), *(one.tick(now_s) for one in self._lists.values())]
        said = [step for step in steps if step.send or step.texts]
        if not said:
            return StoreStep()
        return StoreStep(
            tuple(one for step in said for one in step.send), tuple(one for step in said for one in step.texts)
        )

    def forget_transfers(self) -> None:
        """Drop what is under way."""
        super().forget_transfers()
        for one in self._lists.values():
            one.forget_transfers()

    def _handle_mission_message(self, message: _Order, sender: Peer, now_s: float, *, locked: bool) -> StoreStep:
        match message:
            case MissionCount():
                return self._begin(message, sender, now_s)
            case ItemReceived():
                return self._store(message, sender, now_s)
            case MissionRequestList() | MissionRequest() if self._upload is not None:
                return self._build_ack(sender, MissionResult.DENIED)
            case MissionRequestList():
                return StoreStep((build_mission_count(sender, self._count),))
            case MissionRequest():
                return self._read(message, sender)
            case MissionClearAll():
                if locked:
                    return self._build_ack(sender, MissionResult.ERROR)
                self._count = 0
                self._upload = None
                return replace(self._build_ack(sender, MissionResult.ACCEPTED), cleared=True)

    def _begin(self, message: MissionCount, sender: Peer, now_s: float) -> StoreStep:
        refusal = self._refuse_upload(message.count, sender)
        if refusal is not None:
            return refusal
        self._count = min(self._count, message.count)
        if message.count == 0:
            # Measured: accepted in AUTO too, where the vehicle flies on to its old waypoint.
            self._upload = None
            return replace(self._build_ack(sender, MissionResult.ACCEPTED, RECEIVED), truncated=True)
        return replace(self._begin_upload(message.count, sender, now_s), truncated=True)

    def _store(self, message: ItemReceived, sender: Peer, now_s: float) -> StoreStep:
        upload = self._upload
        if upload is None:
            return self._build_ack(sender, MissionResult.ERROR)
        if message.seq != upload.next:
            # A warning only: the upload goes on.
            return self._build_ack(sender, MissionResult.INVALID_SEQUENCE)
        if message.frame not in FRAMES or message.command not in COMMANDS:
            self._upload = None
            known = message.frame in FRAMES
            return self._build_ack(sender, MissionResult.UNSUPPORTED if known else MissionResult.UNSUPPORTED_FRAME)
        if message.seq > 0:
            item = _to_stored(to_item(message))
            self._memory[message.seq : message.seq + 1] = [item]
        self._count = max(self._count, message.seq + 1)
        upload.next += 1
        upload.heard_s = now_s
        stored = message.seq > 0
        advice = () if message.integer else self._recommend_int_messages(ITEM_ADVICE)
        if upload.next == upload.count:
            self._upload = None
            return replace(self._build_ack(sender, MissionResult.ACCEPTED, (*advice, *RECEIVED)), stored=stored)
        asked = StoreStep() if upload.is_stalled(self.fault) else self._request_next_item(upload, now_s)
        return replace(asked, texts=advice, stored=stored)

    def _read(self, message: MissionRequest, sender: Peer) -> StoreStep:
        item = self.item_at(message.seq)
        if item is None:
            # It tells how many there are.
            refusal = build_mission_ack(sender, MissionResult.INVALID_SEQUENCE)
            return StoreStep((build_mission_count(sender, self._count), refusal))
        advice = () if message.integer else self._recommend_int_messages(REQUEST_ADVICE)
        return StoreStep((build_mission_item(sender, item, integer=message.integer),), advice)

    def _recommend_int_messages(self, text: str) -> tuple[tuple[int, str], ...]:
        """Recommend the younger messages, once."""
        if text in self._advised:
            return ()
        self._advised.add(text)
        return ((Severity.WARNING, text),)


def _to_stored(item: MissionItem) -> MissionItem:
    """Return the item as ArduPilot will send it back.

    Measured: ``current`` is 0 everywhere, DO_CHANGE_SPEED and RTL come back with frame 0. From the source of
    AP_Mission: frames with and without _INT are one, heights are kept in centimetres, the hold in whole seconds,
    of a landing's param4 the sign.
    """
    rewritten = replace(item, current=False, frame=Frame.GLOBAL_RELATIVE_ALT if is_relative(item) else Frame.GLOBAL)
    if item.command in {Command.DO_CHANGE_SPEED, Command.NAV_RETURN_TO_LAUNCH}:
        return replace(rewritten, frame=Frame.GLOBAL)
    if item.command in PAYLOAD - {Command.DO_SET_ROI_LOCATION}:
        return _payload_to_stored(replace(rewritten, frame=Frame.GLOBAL))
    rewritten = replace(rewritten, z=round(item.z * 100) / 100)
    if item.command == Command.NAV_LAND:
        return replace(rewritten, param4=-1.0 if item.param4 < 0 else 1.0)
    if item.command == Command.NAV_WAYPOINT:
        rewritten = replace(rewritten, param1=float(int(item.param1)))
    return rewritten


def _payload_to_stored(item: MissionItem) -> MissionItem:
    """Return an item for a camera or a gimbal as AP_Mission keeps it, by its source: what has no room there is 0."""
    match item.command:
        case Command.DO_SET_CAM_TRIGG_DIST:
            return replace(item, param2=0.0, param4=0.0, x=0, y=0, z=0.0)
        case Command.DO_GIMBAL_MANAGER_PITCHYAW:
            rates = (0.0 if math.isnan(rate) else float(int(rate)) for rate in (item.param3, item.param4))
            return replace(
                item, param1=float(int(item.param1)), param2=float(int(item.param2)), param3=next(rates),
                param4=next(rates), y=0,
            )  # fmt: skip
        case Command.DO_DIGICAM_CONTROL:
            return replace(item, y=0)
        case Command.IMAGE_START_CAPTURE:
            return replace(item, param3=float(int(item.param3)), param4=float(int(item.param4)), x=0, y=0, z=0.0)
        case _:
            return replace(item, param2=0.0, param3=0.0, param4=0.0, x=0, y=0, z=0.0)
