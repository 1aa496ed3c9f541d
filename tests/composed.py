"""docker-compose.yml as data, with the variables that a shell would fill in."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docker-compose.yml"
_VARIABLE = re.compile(r"\$(?:(\$)|\{([A-Z0-9_]+)(?::-([^}]*))?\}|(\w+))")


class UnsetVariable(Exception):
    """A variable has neither a value nor a default."""


def composed(environment: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the file as the engine sees it in an environment."""
    content = YAML(typ="safe").load(FILE.read_text(encoding="utf-8"))
    resolved: dict[str, Any] = _resolved(content, environment or {})
    return resolved


def _resolved(value: Any, environment: Mapping[str, str]) -> Any:
    match value:
        case str():
            return _VARIABLE.sub(lambda found: _value(found, environment), value)
        case dict():
            return {key: _resolved(item, environment) for key, item in value.items()}
        case list():
            return [_resolved(item, environment) for item in value]
        case _:
            return value


def _value(found: re.Match[str], environment: Mapping[str, str]) -> str:
    escaped, name, default, bare = found.groups()
    if escaped:
        return "$"
    value = environment.get(name or bare) or default
    if value is None:
        raise UnsetVariable(name or bare)
    return value


def services(profile: str, environment: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the services of a profile."""
    every = composed(environment)["services"]
    return {name: service for name, service in every.items() if profile in service.get("profiles", [profile])}


def words(service: Mapping[str, Any]) -> Iterator[str]:
    """Yield everything that a service says to its process."""
    yield from service.get("entrypoint", [])
    yield from service.get("command", [])
    yield from map(str, service.get("environment", {}).values())
    yield from service.get("healthcheck", {}).get("test", [])
