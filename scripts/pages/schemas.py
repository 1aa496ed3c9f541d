"""The JSON schemas of the documents, made from the models: files that people and programs keep, and MQTT payloads."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterator, Mapping
from itertools import pairwise
from types import ModuleType

from pydantic import TypeAdapter

from executor.adapters.mqtt import intent_intake, publisher
from executor.analysis import documents
from executor.core import fleet_view
from executor.core.imaging import asset_status
from executor.core.state import fleet_state
from executor.site import flight_keys, learned_files, mqtt_and_web_keys, site_file, site_keys
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
SITE = (site_file, site_keys, flight_keys, mqtt_and_web_keys)
"""The modules that the site file's keys are in."""
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
"""Those that the plan file's keys are in."""
Words = Mapping[tuple[str, str], str]


def schemas() -> dict[str, str]:
    """Return every schema as text, by its place below `docs`."""
    modules = (
        fleet_view,
        fleet_state,
        asset_status,
        *PLAN,
        documents,
        learned_files,
        *SITE,
    )
    words = {(kind, key): text for module in modules for kind, key, text in docstrings(module)}
    files = {f"schemas/{name}": _text(f"faultline/{name}", one, words) for name, one in FILES.items()}
    sent = {
        f"mqtt/{name}": _text(f"faultline/{publisher.VERSION}/{name}", one, words) for name, one in MESSAGES.items()
    }
    return {f"{place}.schema.json": text for place, text in (files | sent).items()}


def _text(name: str, model: type[object], words: Words) -> str:
    sent = issubclass(model, publisher.MqttPayload)
    content = TypeAdapter(model).json_schema(mode="serialization" if sent else "validation")
    for part in (content, *content.get("$defs", {}).values()):
        for key, known in part.get("properties", {}).items():
            if (part["title"], key) in words:
                known.setdefault("description", words[part["title"], key])
        if sent:
            # A later minor version may say more; in what comes in, an unknown key is a mistake.
            part.pop("additionalProperties", None)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": name}
    return json.dumps(head | content, indent=1) + "\n"


def docstrings(module: ModuleType) -> Iterator[tuple[str, str, str]]:
    """Yield class, key and what stands below the key in the source: pydantic itself would read it at every start."""
    classes = {node.name: node for node in ast.parse(inspect.getsource(module)).body if isinstance(node, ast.ClassDef)}
    for name, node in classes.items():
        bases = [classes[base.id] for base in node.bases if isinstance(base, ast.Name) and base.id in classes]
        for body in (*(base.body for base in bases), node.body):
            for field, below in pairwise(body):
                key = field.targets[0] if isinstance(field, ast.Assign) else getattr(field, "target", None)
                if isinstance(key, ast.Name) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                    yield name, _find_alias(field) or key.id, " ".join(str(below.value.value).split())


def _find_alias(field: ast.stmt) -> str | None:
    """Return what documents call a field, where that is not its own name."""
    words = (word for call in ast.walk(field) if isinstance(call, ast.Call) for word in call.keywords)
    return next((str(ast.literal_eval(word.value)) for word in words if word.arg == "alias"), None)
