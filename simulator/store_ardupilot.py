"""ArduPilot's side of the mission protocol: in place, item by item, not atomic.

Measured on Copter 4.7-dev unless a line says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import replace

from missions.items import PAYLOAD, Command, Frame, MissionItem
from simulator.enums import MissionResult, Severity
from simulator.lists_ardupilot import FENCE, RALLY, ArduPilotList
from simulator.messages import (
    MISSION_TYPE_MISSION,
    ItemReceived,
    MissionAckReceived,
    MissionMessage,
    MissionRequest,
    Peer,
)
from simulator.mission_store import (
    StoreStep,
    Transfer,
    build_mission_ack,
    build_mission_count,
    is_relative,
)

COMMANDS = frozenset(Command)
FRAMES = frozenset(Frame)
RECEIVED = ((Severity.INFO, "Flight plan received"),)
REQUEST_ADVICE = "got MISSION_REQUEST; use MISSION_REQUEST_INT!"
ITEM_ADVICE = "got MISSION_ITEM; GCS should send MISSION_ITEM_INT"


class ArduPilotStore(ArduPilotList):
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
        """Follow the protocol of the list that is spoken of; ``locked`` is that the mission runs, armed."""
        if isinstance(message, MissionAckReceived) or message.mission_type == self.kind:
            return super().handle(message, sender, now_s, locked=locked)
        beside = self._lists.get(message.mission_type)
        if beside is None:
            return StoreStep((build_mission_ack(sender, MissionResult.UNSUPPORTED, message.mission_type),))
        beside.fault = self.fault
        return beside.handle(message, sender, now_s, locked=False)

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

    def _truncate(self, count: int) -> bool:
        self._count = min(
            self._count, count
        )  # measured: 0 is accepted in AUTO too, and it flies on to its old waypoint
        return True

    def _comment(self, message: ItemReceived, step: StoreStep) -> StoreStep:
        advice = () if message.integer else self._recommend_int_messages(ITEM_ADVICE)
        return replace(step, texts=(*advice, *step.texts), stored=message.seq > 0)

    def _refuse_item(self, message: ItemReceived) -> MissionResult | None:
        if message.frame not in FRAMES:
            return MissionResult.UNSUPPORTED_FRAME
        return None if message.command in COMMANDS else MissionResult.UNSUPPORTED

    def _keep_item(self, upload: Transfer, item: MissionItem) -> None:  # noqa: ARG002 - it lies in its place at once
        if item.seq > 0:
            self._memory[item.seq : item.seq + 1] = [_to_stored(item)]
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
            # It tells how many there are.
            return StoreStep((build_mission_count(sender, self._count), *step.send))
        return replace(step, texts=() if message.integer else self._recommend_int_messages(REQUEST_ADVICE))

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
