"""Payloads; docs/mqtt.md says the same in words.

The habits are those of VDA 5050 where they fit: a header with `headerId`, `timestamp` and `version`, a major version in
the topic, the states of a connection. What a flight looks like is in the core's own words, as the page shows it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from executor.adapters.mqtt.reasons import IntakeReason
from executor.core.fleet_view import OfferView, PositionView, ReplanView, VehicleView
from executor.core.imaging.asset_status import AssetView
from executor.core.interface.codes import Ending
from executor.core.interface.intents import IntentReason
from executor.core.state.fleet_state import CheckLine, Question
from executor.core.state.vehicle_state import FaultCode
from missions.plan_json import PlanDocument
from missions.validation import document_of

VERSION = "1.6.0"


class MqttPayload(BaseModel):
    """What every message begins with."""

    model_config = ConfigDict(frozen=True, extra="forbid", serialize_by_alias=True, use_attribute_docstrings=True)

    headerId: Annotated[int, Field(ge=0, le=2**32 - 1)]  # noqa: N815 - VDA 5050's name
    """Counted for each topic from 0; the same number twice is the same message twice, a gap is what was dropped."""
    timestamp: str
    """When it was written: ISO 8601, UTC, by the ground station's clock."""
    version: str = VERSION
    """Of these topics and payloads."""
    run: str
    """The flight: the name of its run directory."""


class ConnectionMessage(MqttPayload):
    """Whether a flight is published here; retained, and the last will."""

    connectionState: Literal["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]  # noqa: N815 - VDA 5050's name
    """OFFLINE: supervision has ended. CONNECTIONBROKEN: the broker says that the ground station is gone."""


class VehicleStateMessage(MqttPayload):
    """Everything about one vehicle; retained, on every change of what it does and at least every ten seconds."""

    vehicle: VehicleView


class TelemetryMessage(MqttPayload):
    """Where one vehicle is, at the site's rate."""

    name: str
    state: str
    position: PositionView | None
    battery_pct: float | None
    """As the vehicle measures it."""
    link_age_s: float | None
    """Since it was heard."""
    link_loss: float | None
    """Share of frames lost in the last seconds."""
    segment: int | None
    """The segment that it inspects or flies to."""
    segment_name: str | None
    """The same by the name of the asset."""
    segment_share: float | None
    """How much of it is behind the vehicle, from 0 to 1."""


class FleetStateMessage(MqttPayload):
    """The flight as a whole; retained, on every change and at least every ten seconds."""

    flight_s: float | None
    """Since the launch."""
    revision: int
    """Of the plan."""
    vehicles: tuple[str, ...]
    segments_total: int
    inspected: tuple[int, ...]
    uncovered: tuple[int, ...]
    """Given up: segments that nobody can inspect."""
    missed: tuple[int, ...]
    """Segments that were flown but not seen: pictures of them are missing."""
    replan: ReplanView | None
    """The re-plan under way."""
    all_silent: bool
    """Whether nobody at all is heard."""
    recalled: bool
    """Whether the flight was aborted."""
    finished: bool
    min_separation_m: float | None
    """The nearest that two flying vehicles came to each other."""
    checks: tuple[CheckLine, ...]
    """The checklist before the flight."""
    question: Question | None
    """What the crew is asked now, before the flight: an intent with its `id` as the action answers it."""
    offer: OfferView | None
    """Vehicles on the ground that could take over work: `include` starts one, when its pad is clear."""
    dropped: dict[str, int]
    """Messages of a topic that were given up, as too many waited for the broker."""


class AssetsMessage(MqttPayload):
    """What became of each asset that asks for pictures; retained."""

    assets_total: int
    """How many there are."""
    assets: tuple[AssetView, ...]
    """All but those that are open and have no picture yet."""


class EventMessage(MqttPayload):
    """One line for the operator: a decision with its reason."""

    at_s: float
    """By the flight's clock."""
    flight_s: float | None
    """Since the launch, as the page and the terminal show it; none before it."""
    level: Literal["info", "warning", "fault"]
    text: str


class FaultMessage(MqttPayload):
    """The judgement that a vehicle will not finish its route."""

    vehicle: str
    code: FaultCode
    """What was found."""
    kind: str
    """link, battery, interruption, fence, operator, or another of the core's words."""
    reason: str
    detected_s: float
    """By the flight's clock."""


class PlanMessage(MqttPayload):
    """The plan in force; retained."""

    revision: int
    plan: Annotated[dict[str, Any], document_of(PlanDocument)]
    """As a plan file has it (faultline-plan/2)."""


class AcknowledgementMessage(MqttPayload):
    """What became of an intent; once when it is taken or refused, and again when it comes to its end."""

    id: str | None
    """The intent's; none where it could not be read."""
    action: str | None = None
    vehicle: str | None = None
    outcome: Literal["accepted", "done", "refused", "failed"]
    """accepted: under way."""
    code: IntentReason | Ending | IntakeReason | None = None
    """Why it is refused, or failed: a word for programs; none where it was not."""
    text: str
    """Why, in words."""
    question: str = ""
    """What has to be confirmed first, where that is why it is refused: another intent with `confirmed` answers it."""
