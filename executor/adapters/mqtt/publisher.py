"""Convert the flight's events to messages for the broker; docs/mqtt.md describes the payloads.

They follow VDA 5050 where it fits: a header with `headerId`, `timestamp` and `version`, a major version in the topic,
connection states. The flight itself is described in core's own terms, as on the page.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise, zip_longest
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from executor.adapters.mqtt.client import MqttMessage, Outbox, Presence
from executor.adapters.mqtt.intent_intake import IntakeReason, RefusedMessage
from executor.adapters.mqtt.topics import MqttTopics
from executor.core.fleet_view import FleetView, OfferView, PositionView, RadioView, ReplanView, VehicleView
from executor.core.imaging.asset_status import AssetState, AssetView
from executor.core.interface.codes import Check, Ending
from executor.core.interface.commands import Say
from executor.core.interface.events import Event, IntentReceived, Tick
from executor.core.interface.intents import IntentReason, IntentRecord
from executor.core.state.fleet_state import FleetState, Question
from executor.core.state.vehicle_state import FaultCode
from missions import PlanFile
from missions.plan_parts import PlanSegment
from missions.validation import Place, document_of

VERSION = "1.8.0"


class MqttPayload(BaseModel):
    """Common header of every message."""

    model_config = ConfigDict(frozen=True, extra="forbid", serialize_by_alias=True, use_attribute_docstrings=True)

    headerId: Annotated[int, Field(ge=0, le=2**32 - 1)]  # noqa: N815 - VDA 5050's name
    """Counter of the topic, from 0: a repeated number is a duplicate, a gap is dropped messages."""
    timestamp: str
    """Time of writing on the ground station's clock, ISO 8601 in UTC."""
    version: str = VERSION
    """Version of these topics and payloads."""
    run: str
    """Name of the flight's run directory."""


class ConnectionMessage(MqttPayload):
    """Connection state of the publisher; retained, and the last will."""

    connectionState: Literal["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]  # noqa: N815 - VDA 5050's name
    """OFFLINE: supervision has ended. CONNECTIONBROKEN: the broker lost the connection to it."""


class VehicleStateMessage(MqttPayload):
    """State of one vehicle; retained, sent on every change of its activity and at least every ten seconds."""

    vehicle: VehicleView


class TelemetryMessage(MqttPayload):
    """Telemetry of one vehicle, at the site's rate."""

    name: str
    state: str
    position: PositionView | None
    battery_pct: float | None
    """Battery level reported by the vehicle."""
    link_age_s: float | None
    """Seconds since the last message from it."""
    link_loss: float | None
    """Share of frames lost in the last seconds."""
    segment: int | None
    """Segment being inspected or approached."""
    segment_name: str | None
    """Asset name of that segment."""
    segment_share: float | None
    """Completed share of it, from 0 to 1."""


class FleetStateMessage(MqttPayload):
    """State of the whole flight; retained, sent on every change and at least every ten seconds."""

    flight_s: float | None
    """Seconds since the launch."""
    revision: int
    """Plan revision."""
    vehicles: tuple[str, ...]
    segments_total: int
    inspected: tuple[int, ...]
    uncovered: tuple[int, ...]
    """Segments that no vehicle can inspect."""
    missed: tuple[int, ...]
    """Segments flown but without the required pictures."""
    replan: ReplanView | None
    """Re-plan in progress."""
    all_silent: bool
    """Whether all vehicles are silent."""
    recalled: bool
    """Whether the flight was aborted."""
    finished: bool
    min_separation_m: float | None
    """Least distance between two flying vehicles so far."""
    checks: tuple[Check, ...]
    """Checklist before the flight."""
    question: Question | None
    """Question to the crew before the flight; an intent whose action is its `id` answers it."""
    offer: OfferView | None
    """Vehicles on the ground that could take over work; `include` starts one once its pad is clear."""
    radios: tuple[RadioView, ...]
    """Telemetry radios: throughput, and whether each is congested or weak."""
    dropped: dict[str, int]
    """Dropped messages by topic, as too many were queued."""


class AssetsMessage(MqttPayload):
    """State of each asset that needs pictures; retained."""

    assets_total: int
    """Number of assets."""
    assets: tuple[AssetView, ...]
    """Assets, except open ones without a picture."""


class EventMessage(MqttPayload):
    """One line for the operator: a decision with its reason."""

    at_s: float
    """Time on the flight's clock."""
    flight_s: float | None
    """Seconds since the launch, as on the page and in the terminal; null before it."""
    level: Literal["info", "warning", "fault"]
    text: str


class FaultMessage(MqttPayload):
    """Decision that a vehicle will not finish its route."""

    vehicle: str
    code: FaultCode
    """Fault code."""
    kind: str
    """Kind: link, battery, interruption, fence, operator, or another of core's terms."""
    reason: str
    detected_s: float
    """Time on the flight's clock."""


class PlanMessage(MqttPayload):
    """Current plan; retained. Of a large plan the first part; further segments are in separate messages."""

    revision: int
    parts: Annotated[int, Field(ge=1)] = 1
    """Number of parts of the plan, this one included: part 2 is on `fleet/plan/2`, and so on."""
    plan: Annotated[dict[str, Any], document_of(PlanFile)]
    """Plan as in a plan file (faultline-plan/2)."""


class PlanPartMessage(MqttPayload):
    """More segments of a large plan; retained."""

    revision: int
    """Revision of their plan."""
    part: Annotated[int, Field(ge=2)]
    parts: int
    segments: Annotated[list[dict[str, Any]], document_of(tuple[PlanSegment, ...])]
    """Segments that continue the plan's `segments` after those of the previous part."""
    tracks_m: Annotated[list[Any], document_of(tuple[tuple[Place, Place], ...])]
    """The same for the plan's `model.tracks_m`; empty if it has no `model`."""


class AcknowledgementMessage(MqttPayload):
    """Outcome of an intent: sent when it is accepted or refused, and again when it ends."""

    id: str | None
    """Id of the intent; null if unreadable."""
    action: str | None = None
    vehicle: str | None = None
    outcome: Literal["accepted", "done", "refused", "failed"]
    """Outcome; accepted means in progress."""
    code: IntentReason | Ending | IntakeReason | None = None
    """Machine-readable reason for refused or failed; null otherwise."""
    text: str
    """Reason in words."""
    question: str = ""
    """Question to confirm if that is why it was refused; a new intent with `confirmed` answers it."""


AT_LEAST_EVERY_S = 10.0
"""Longest real seconds between two states, even if nothing has changed."""
ASSETS_EVERY_S = 10.0
"""Least real seconds between two messages about assets, which change with each picture."""
ASSETS_S_PER_BYTE = 0.001
"""Additional pause per byte of that message, for a slow line."""
MOST_PLAN_BYTES = 120_000
"""Most bytes of one plan message; cloud brokers take 128 KB."""
Content = Mapping[str, object]
_FLEET = tuple(name for name in FleetStateMessage.model_fields if name in FleetView.__dataclass_fields__)


class Publisher:
    """Fill the outbox; every method returns at once."""

    def __init__(self, topics: MqttTopics, outbox: Outbox, run: str, unix_s: Callable[[], float]) -> None:
        """Begin a flight.

        Args:
            topics: Topics to publish on.
            outbox: Outbox for the messages.
            run: Name of the flight.
            unix_s: Unix time.
        """
        self._topics = topics
        self._outbox = outbox
        self._run = run
        self._unix_s = unix_s
        self._numbers: dict[str, int] = {}
        self._states: dict[str, tuple[object, float]] = {}
        self._records: Mapping[str, IntentRecord] = {}
        self._faults: set[tuple[str, float]] = set()
        self._plan_parts = 1
        self._assets: Sequence[AssetView] | None = None
        self._assets_s = (float("-inf"), 0.0)
        """Time of the last check of assets, and how long it remains valid."""

    def build_presence(self, state: Presence) -> MqttMessage:
        """Return the message with our connection state."""
        topic = self._topics.fleet_topic("connection")
        return self._build_message(topic, ConnectionMessage, {"connectionState": state.value}, retain=True)

    def publish_view(self, view: FleetView) -> None:
        """Publish the present: telemetry, and changed states."""
        for vehicle in view.vehicles:
            self._publish_telemetry(vehicle)
            topic = self._topics.vehicle_topic(vehicle.name, "state")
            self._publish_state(topic, VehicleStateMessage, _extract_slow_part(vehicle), {"vehicle": vehicle})
        fleet: dict[str, object] = {name: getattr(view, name) for name in _FLEET}
        fleet["vehicles"] = tuple(one.name for one in view.vehicles)
        fleet["dropped"] = dict(self._outbox.dropped)
        slow = [value for name, value in fleet.items() if name not in {"flight_s", "min_separation_m", "radios"}]
        slow.append([(radio.state, radio.positions_hz) for radio in view.radios])
        self._publish_state(self._topics.fleet_topic("state"), FleetStateMessage, slow, fleet)

    def publish_assets(self, views: Callable[[], Sequence[AssetView]], *, last: bool = False) -> None:
        """Publish the assets' states if changed; at a limited rate, except for the last time."""
        (at_s, will_do_s), now_s = self._assets_s, self._unix_s()
        if not last and 0.0 <= now_s - at_s < will_do_s:
            return
        found, self._assets_s = views(), (now_s, ASSETS_EVERY_S)
        if found == self._assets:
            return
        self._assets = found
        told = tuple(one for one in found if one.state is not AssetState.OPEN or one.pictures)
        content = {"assets_total": len(found), "assets": told}
        letter = self._build_message(self._topics.fleet_topic("assets"), AssetsMessage, content, retain=True)
        self._assets_s = (now_s, max(ASSETS_EVERY_S, ASSETS_S_PER_BYTE * len(letter.payload)))
        self._outbox.put_latest(letter)

    def publish_event(self, event: Event, state: FleetState) -> None:
        """Publish the faults that an event led to, and the outcome of intents."""
        if isinstance(event, Tick):
            self._publish_new_faults(state)
        answered = set()
        if state.crew.intents is not self._records:
            for name, record in state.crew.intents.items():
                if self._records.get(name) != record:
                    self._acknowledge_intent(record)
                    answered.add(name)
            self._records = state.crew.intents
        # A repeated intent changes nothing, and is answered again.
        if isinstance(event, IntentReceived) and event.intent.id not in answered:
            known = state.crew.intents.get(event.intent.id)
            if known is not None:
                self._acknowledge_intent(known)

    def publish_line(self, line: Say, at_s: float, flight_s: float | None = None) -> None:
        """Publish a line for the operator, with the flight's time."""
        content = {"at_s": at_s, "flight_s": flight_s, "level": line.level.value, "text": line.text}
        self._outbox.enqueue(self._build_message(self._topics.fleet_topic("event"), EventMessage, content))

    def publish_plan(self, revision: int, document: Mapping[str, object]) -> None:
        """Publish the current plan, a large one in parts."""
        plan, *more = split_plan(document)
        parts, topic = 1 + len(more), self._topics.fleet_topic("plan")
        content = {"revision": revision, "parts": parts, "plan": plan}
        self._outbox.put_latest(self._build_message(topic, PlanMessage, content, retain=True))
        for part, rest in enumerate(more, start=2):
            content = {"revision": revision, "part": part, "parts": parts, **rest}
            topic = self._topics.plan_part_topic(part)
            self._outbox.put_latest(self._build_message(topic, PlanPartMessage, content, retain=True))
        for part in range(parts + 1, self._plan_parts + 1):  # of the previous plan
            self._outbox.put_latest(MqttMessage(self._topics.plan_part_topic(part), b"", retain=True))
        self._plan_parts = parts

    def publish_refusal(self, refusal: RefusedMessage) -> None:
        """Publish that a message is not executed."""
        self._acknowledge({"id": refusal.id, "outcome": "refused", "code": refusal.code, "text": refusal.reason})

    def _acknowledge_intent(self, record: IntentRecord) -> None:
        asked = {"id": record.intent.id, "action": record.intent.action.value, "vehicle": record.intent.vehicle}
        told = {"code": record.code, "text": record.text, "question": record.question}
        self._acknowledge({**asked, "outcome": record.outcome.value, **told})

    def _acknowledge(self, content: Content) -> None:
        self._outbox.enqueue(self._build_message(self._topics.acknowledgement_topic, AcknowledgementMessage, content))

    def _publish_new_faults(self, state: FleetState) -> None:
        for name, vehicle in state.vehicles.items():
            fault = vehicle.fault
            if fault is None or (name, fault.detected_s) in self._faults:
                continue
            self._faults.add((name, fault.detected_s))
            found = {"kind": fault.kind.value, "code": fault.code, "reason": fault.reason}
            what = {"vehicle": name, **found, "detected_s": fault.detected_s}
            self._outbox.enqueue(self._build_message(self._topics.fleet_topic("fault"), FaultMessage, what))

    def _publish_telemetry(self, vehicle: VehicleView) -> None:
        topic, progress = self._topics.vehicle_topic(vehicle.name, "telemetry"), vehicle.progress
        same = {name: getattr(vehicle, name) for name in ("name", "state", "position", "link_age_s", "link_loss")}
        way = {name: getattr(progress, name) for name in ("segment", "segment_name", "segment_share")}
        content = {**same, "battery_pct": vehicle.battery.measured_pct, **way}
        self._outbox.put_latest(self._build_message(topic, TelemetryMessage, content))

    def _publish_state(self, topic: str, kind: type[MqttPayload], slow: object, content: Content) -> None:
        """Publish a state if its slow part has changed, or if it is due."""
        before, at_s = self._states.get(topic, (None, float("-inf")))
        now_s = self._unix_s()
        # Compare with care: this clock may be set back.
        if slow == before and 0.0 <= now_s - at_s < AT_LEAST_EVERY_S:
            return
        self._states[topic] = (slow, now_s)
        self._outbox.put_latest(self._build_message(topic, kind, content, retain=True))

    def _build_message(
        self, topic: str, kind: type[MqttPayload], content: Content, *, retain: bool = False
    ) -> MqttMessage:
        number = self._numbers.get(topic, 0)
        self._numbers[topic] = (number + 1) % 2**32
        stamp = datetime.fromtimestamp(self._unix_s(), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        message = kind.model_validate({"headerId": number, "timestamp": stamp, "run": self._run, **content})
        return MqttMessage(topic, message.model_dump_json().encode(), retain)


def split_plan(document: Mapping[str, Any], most_bytes: int = MOST_PLAN_BYTES) -> Iterator[dict[str, Any]]:
    """Yield a plan with as many segments as a message holds, then the other segments and their tracks in parts."""

    def size(value: object) -> int:
        return len(json.dumps(value, separators=(",", ":")))

    segments, model = document["segments"], document.get("model")
    tracks = [] if model is None else model["tracks_m"]

    def with_rows(begin: int, end: int) -> dict[str, Any]:
        few = {} if model is None else {"model": {**model, "tracks_m": tracks[begin:end]}}
        return {**document, **few, "segments": segments[begin:end]}

    cuts, room = [0], most_bytes - size(with_rows(0, 0))
    for number, row in enumerate(zip_longest(segments, tracks)):
        cost = size(row)
        if cost > room:
            cuts.append(number)
            room = most_bytes
        room -= cost
    first, *others = pairwise([*cuts, len(segments)])
    yield with_rows(*first)
    yield from ({"segments": segments[begin:end], "tracks_m": tracks[begin:end]} for begin, end in others)


def _extract_slow_part(vehicle: VehicleView) -> object:
    """Return the part of a vehicle's state that is published on change; the rest is in the telemetry."""
    progress, measured_pct, taken = vehicle.progress, vehicle.battery.measured_pct, vehicle.taken
    return (
        (vehicle.state, vehicle.mode, vehicle.armed, vehicle.stale, vehicle.excluded, vehicle.fault),
        (progress.done, progress.total, progress.inspected, progress.segment, progress.phase),
        (vehicle.offered, vehicle.gps_fix, None if taken is None else (taken.returned, taken.kept_s > 0.0)),
        None if measured_pct is None else round(measured_pct),
        None if vehicle.loss is None else vehicle.loss.uncovered,
        [one.connection for one in vehicle.links if one.used],
    )
