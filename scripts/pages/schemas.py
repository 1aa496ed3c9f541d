"""JSON schemas of the documents, generated from the models: files that people and programs keep, and MQTT payloads."""

from __future__ import annotations

import json
from collections.abc import Mapping

from pydantic import TypeAdapter

from executor.adapters.mqtt import intent_intake, publisher
from executor.analysis import documents
from executor.core import fleet_view
from executor.core.imaging import asset_status
from executor.core.state import fleet_state
from executor.site import learned_files, site_file
from executor.site.site_schema import SITE, add_descriptions, read_docstrings
from missions import (
    flight_model,
    geo,
    inspection_defaults,
    no_fly_areas,
    plan_file,
    plan_parts,
    pricing,
    terrain,
)
from missions import shortest_ways as ways
from planner import moves
from planner.sorties import sortie_losses

FILES: dict[str, type[object]] = {
    "dayplan": plan_file.DayPlanFile,
    "learned": learned_files.LearnedDocument,
    "plan": plan_file.PlanFile,
    "report": documents.FlightReport,
    "site": site_file.Site,
    "vehicles": documents.AskedVehicles,
}
MESSAGES: dict[str, type[object]] = {
    "acknowledgement": publisher.AcknowledgementMessage,
    "assets": publisher.AssetsMessage,
    "connection": publisher.ConnectionMessage,
    "event": publisher.EventMessage,
    "fault": publisher.FaultMessage,
    "fleet-state": publisher.FleetStateMessage,
    "intent": intent_intake.IntentMessage,
    "plan": publisher.PlanMessage,
    "plan-part": publisher.PlanPartMessage,
    "telemetry": publisher.TelemetryMessage,
    "vehicle-state": publisher.VehicleStateMessage,
}
PLAN = (
    no_fly_areas,
    flight_model,
    geo,
    inspection_defaults,
    moves,
    plan_file,
    plan_parts,
    pricing,
    sortie_losses,
    terrain,
    ways,
)
"""Modules with the plan file's keys."""
Words = Mapping[tuple[str, str], str]


def schemas() -> dict[str, str]:
    """Return every schema as text, by its path below `docs`."""
    modules = (
        fleet_view,
        fleet_state,
        asset_status,
        *PLAN,
        documents,
        learned_files,
        *SITE,
    )
    words = {(kind, key): text for module in modules for kind, key, text in read_docstrings(module)}
    files = {f"schemas/{name}": _text(f"faultline/{name}", one, words) for name, one in FILES.items()}
    sent = {
        f"mqtt/{name}": _text(f"faultline/{publisher.VERSION}/{name}", one, words) for name, one in MESSAGES.items()
    }
    return {f"{place}.schema.json": text for place, text in (files | sent).items()}


def _text(name: str, model: type[object], words: Words) -> str:
    sent = issubclass(model, publisher.MqttPayload)
    content = TypeAdapter(model).json_schema(mode="serialization" if sent else "validation")
    add_descriptions(content, words)
    for part in (content, *content.get("$defs", {}).values()) if sent else ():
        # A later minor version may add keys; in input, an unknown key is an error.
        part.pop("additionalProperties", None)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": name}
    return json.dumps(head | content, indent=1) + "\n"
