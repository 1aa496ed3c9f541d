"""The JSON schemas of all payloads: `python -m executor.adapters.mqtt.schemas DIR` writes a file for each."""

from __future__ import annotations

import ast
import inspect
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from executor.adapters.mqtt.intake import IntentMessage
from executor.adapters.mqtt.payloads import (
    VERSION,
    AcknowledgementMessage,
    ConnectionMessage,
    EventMessage,
    FaultMessage,
    FleetStateMessage,
    PlanMessage,
    TelemetryMessage,
    VehicleStateMessage,
)
from executor.core import state, view

MESSAGES: dict[str, type[BaseModel]] = {
    "acknowledgement": AcknowledgementMessage,
    "connection": ConnectionMessage,
    "event": EventMessage,
    "fault": FaultMessage,
    "fleet-state": FleetStateMessage,
    "intent": IntentMessage,
    "plan": PlanMessage,
    "telemetry": TelemetryMessage,
    "vehicle-state": VehicleStateMessage,
}


def schemas() -> dict[str, str]:
    """Return every schema as text, by the name of its file."""
    words = dict(_field_words())
    return {f"{name}.schema.json": _text(name, model, words) for name, model in MESSAGES.items()}


def write_schemas(folder: Path) -> None:
    """Write every schema into a folder."""
    for name, text in schemas().items():
        (folder / name).write_text(text, encoding="utf-8")


def _text(name: str, model: type[BaseModel], words: Mapping[tuple[str, str], str]) -> str:
    asked = model is IntentMessage
    content: dict[str, Any] = model.model_json_schema(mode="validation" if asked else "serialization")
    parts = content.get("$defs", {})
    for kind, part in parts.items():
        for key, known in part.get("properties", {}).items():  # an enum has none
            if (kind, key) in words:
                known.setdefault("description", words[kind, key])
    for part in (content, *parts.values()):
        if not asked:
            # A later minor version may say more; in what comes in, an unknown key is a mistake.
            part.pop("additionalProperties", None)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"faultline/{VERSION}/{name}"}
    return json.dumps(head | content, indent=1) + "\n"


def _field_words() -> Iterator[tuple[tuple[str, str], str]]:
    """Yield (class, field) and what stands below the field: the core's dataclasses know nothing of pydantic."""
    for node in (*ast.parse(inspect.getsource(view)).body, *ast.parse(inspect.getsource(state)).body):
        if not isinstance(node, ast.ClassDef):
            continue
        for field, below in zip(node.body, node.body[1:], strict=False):
            if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
                continue
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                yield (node.name, field.target.id), " ".join(str(below.value.value).split())


if __name__ == "__main__":
    write_schemas(Path(sys.argv[1]))
