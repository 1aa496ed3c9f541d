"""Build the JSON schema of the site file with each key's meaning and unit, for pages, editors and the reference."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Mapping
from itertools import pairwise
from types import ModuleType
from typing import Any

from executor.site import flight_keys, mqtt_and_web_keys, site_file, site_keys

SITE = (site_file, site_keys, flight_keys, mqtt_and_web_keys)
"""Modules that define the site file's keys."""
UNITS = (
    ("bytes_s", "B/s"), ("_m_s", "m/s"), ("_deg", "°"), ("_pct", "%"), ("_hz", "1/s"), ("_kg", "kg"), ("_ah", "Ah"),
    ("_m2", "m²"), ("_m", "m"), ("_s", "s"),
)  # fmt: skip
"""Units by suffix of a key's name, longest first."""


def build_site_schema() -> dict[str, Any]:
    """Return the schema of the site file; each key has its `description` and, where it has one, its `unit`."""
    content = site_file.Site.model_json_schema()
    add_descriptions(content, {(kind, key): text for module in SITE for kind, key, text in read_docstrings(module)})
    for part in (content, *content["$defs"].values()):
        for key, known in part.get("properties", {}).items():
            if unit := find_unit(key):
                known["unit"] = unit
    return content


def find_unit(key: str) -> str:
    """Return the unit in a key's name; empty if it has none."""
    return next((unit for end, unit in UNITS if key.endswith(end)), "")


def add_descriptions(schema: Mapping[str, Any], words: Mapping[tuple[str, str], str]) -> None:
    """Add the meanings of keys to a schema, by class title and key name."""
    for part in (schema, *schema.get("$defs", {}).values()):
        for key, known in part.get("properties", {}).items():
            if (part["title"], key) in words:
                known.setdefault("description", words[part["title"], key])


def read_docstrings(module: ModuleType) -> Iterator[tuple[str, str, str]]:
    """Yield class, key and docstring of each key from the source: pydantic itself would read it at every start."""
    classes = {node.name: node for node in ast.parse(inspect.getsource(module)).body if isinstance(node, ast.ClassDef)}
    for name, node in classes.items():
        bases = [classes[base.id] for base in node.bases if isinstance(base, ast.Name) and base.id in classes]
        for body in (*(base.body for base in bases), node.body):
            for field, below in pairwise(body):
                key = field.targets[0] if isinstance(field, ast.Assign) else getattr(field, "target", None)
                if isinstance(key, ast.Name) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                    yield name, _find_alias(field) or key.id, " ".join(str(below.value.value).split())


def _find_alias(field: ast.stmt) -> str | None:
    """Return a field's name in documents, if it has an alias."""
    words = (word for call in ast.walk(field) if isinstance(call, ast.Call) for word in call.keywords)
    return next((str(ast.literal_eval(word.value)) for word in words if word.arg == "alias"), None)
