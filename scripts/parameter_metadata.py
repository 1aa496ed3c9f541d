"""Parameters that the program reads or sets, held against the metadata of a release of their autopilot.

`python -m scripts.parameter_metadata px4 parameters.json` takes what PX4's build leaves beside its binary,
`... ardupilot apm.pdef.json` what ArduPilot publishes with each release, or its `param_parse.py` writes. It names what
is not there any more, what the tables in `missions/autopilots` do not know and values that are set outside the
release's range, and exits with 1 if there is any of these. The parameters that the containers set are held too. With
`--before OLD.json` it also says what the same parameters meant in an older release.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from executor.core.telemetry.mode_evidence import MODE_CHANNEL_SETTINGS, THROTTLE_LOST_SETTING
from missions.autopilots.dialect import AUTOPILOTS, Dialect, dialect_for

ROOT = Path(__file__).parents[1]
CONTAINER_SETTINGS = {
    "ardupilot": ("docker/copter.parm", r"^([A-Z][A-Z0-9_]+) "),
    "px4": ("docker-compose.yml", r"\bPX4_PARAM_([A-Z0-9_]+):"),
}
"""The file in which the containers set an autopilot's parameters, and the pattern of a name in it."""


class MetadataError(ValueError):
    """A file is no autopilot metadata."""


@dataclass(slots=True)
class Use:
    """The program's assumptions about one parameter."""

    values: set[int] = field(default_factory=set)
    """Values with words here."""
    masks: set[int] = field(default_factory=set)
    """Bits in use."""
    default: float | None = None
    most: float | None = None
    sets: set[float] = field(default_factory=set)
    """Values that faultline sets."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """A release's description of one parameter."""

    values: Mapping[int, str]
    bits: Mapping[int, str]
    default: float | None
    least: float | None
    most: float | None
    units: str


def list_uses(dialect: Dialect) -> dict[str, Use]:
    """Return every parameter of an autopilot that is read or set, by its name here."""
    uses: defaultdict[str, Use] = defaultdict(Use)
    link, battery, fence, back = (
        dialect.ground_station_failsafe, dialect.battery_failsafe, dialect.geofence, dialect.return_parameters,
    )  # fmt: skip
    plain = (
        back.height, back.cone, back.descend_height, back.descend_wait, link.station_sysid, battery.capacity,
        fence.height, fence.radius, fence.enable, fence.rally_limit, dialect.shutter.parameter, *fence.enabled_by,
        *dialect.pack_parameters, *(one for level in battery.levels for one in (level.threshold, level.voltage)),
    )  # fmt: skip
    for name in plain:
        if name is not None:
            uses[name].values |= set()
    for level in battery.levels:
        uses[level.action].values |= {0, *dict(level.actions)}
    for early in battery.early:
        uses[early.action].values |= {*early.nothing, *dict(early.actions)}
    uses[fence.action].values |= {0, *dict(fence.actions), *dict(fence.named).values()}
    uses[link.action].values |= {0, link.action_return, *dict(link.actions)}
    uses[link.timeout].default, uses[link.timeout].most = link.timeout_s, link.timeout_most_s
    if link.pause is not None:
        uses[link.pause].default, uses[link.pause].most = link.pause_s, link.pause_most_s
    uses[link.exception[0]].masks.add(link.exception[1])
    if fence.kinds is not None:
        uses[fence.kinds[0]].masks |= {*fence.kinds[1:], fence.polygons}
    for rule in dialect.terrain:
        uses[rule.parameter].values |= {0, *rule.on}
    for tuning in dialect.tunings:
        uses[tuning.parameter].default = tuning.default
    uses[back.cone].sets.add(back.cone_off)
    uses[fence.action].sets |= {float(value) for value in dict(fence.named).values()}
    if fence.enable is not None:
        uses[fence.enable].sets.add(1.0)
    return dict(uses)


def list_other_settings(dialect: Dialect) -> set[str]:
    """Return the parameters that the containers set, and those that are understood when another station reads them."""
    path, pattern = CONTAINER_SETTINGS[dialect.name]
    found = set(re.findall(pattern, (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE))
    return found | ({THROTTLE_LOST_SETTING} if dialect.name == "ardupilot" else set())


def read_metadata(path: Path) -> dict[str, Meaning]:
    """Return a release's parameters, by name.

    Raises:
        MetadataError: the file cannot be read, or has another format.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise MetadataError(f"{path}: expected the metadata of parameters, in JSON: {error}") from None
    rows = document.get("parameters") if isinstance(document, dict) else None
    if isinstance(rows, list):
        return {row["name"]: _read_px4(row) for row in rows}
    groups = [group for group in document.values() if isinstance(group, dict)] if isinstance(document, dict) else []
    found = {name: _read_ardupilot(row) for group in groups for name, row in group.items() if isinstance(row, dict)}
    if not any("_" in name for name in found):
        raise MetadataError(f"{path}: expected PX4's parameters.json or ArduPilot's apm.pdef.json")
    return found


def _read_px4(row: Mapping[str, Any]) -> Meaning:
    values = {int(one["value"]): str(one["description"]) for one in row.get("values", ())}
    bits = {int(one["index"]): str(one["description"]) for one in row.get("bitmask", ())}
    default, least, most = (None if row.get(key) is None else float(row[key]) for key in ("default", "min", "max"))
    return Meaning(values, bits, default, least, most, str(row.get("units", "")))


def _read_ardupilot(row: Mapping[str, Any]) -> Meaning:
    values, bits = (
        {int(key): str(word) for key, word in _numbered(row.get(name, {}))} for name in ("Values", "Bitmask")
    )
    least, most = (None if key not in row.get("Range", {}) else float(row["Range"][key]) for key in ("low", "high"))
    return Meaning(values, bits, None, least, most, str(row.get("Units", "")))


def _numbered(words: Mapping[str, str]) -> Iterator[tuple[float, str]]:
    for key, word in words.items():
        try:
            yield float(key), word
        except ValueError:
            continue  # a heading among the values


def find_differences(dialect: Dialect, release: Mapping[str, Meaning]) -> list[str]:
    """Return mismatches between an autopilot's tables and a release, one line each."""
    uses = list_uses(dialect)
    found = [line for name, use in uses.items() for line in _hold(dialect, name, use, release)]
    found += [f"{name}: is not there" for name in sorted(list_other_settings(dialect) - uses.keys() - release.keys())]
    if not MODE_CHANNEL_SETTINGS & release.keys():
        found.append(f"{' or '.join(sorted(MODE_CHANNEL_SETTINGS))}: is not there")
    return found


def _hold(dialect: Dialect, name: str, use: Use, release: Mapping[str, Meaning]) -> Iterator[str]:
    other = dialect.other_names.get(name)
    names = (name,) if other is None else (name, other.name)
    on_board = next((one for one in names if one in release), None)
    # A parameter of older firmware, replaced by another here, need not be there.
    if on_board is None and name in {early.without for early in dialect.battery_failsafe.early}:
        return
    if on_board is None:
        yield f"{' or '.join(names)}: is not there"
        return
    meaning, unit = release[on_board], 1.0 if other is None or on_board == name else other.unit
    for value in sorted(meaning.values.keys() - use.values) if use.values else ():
        yield f"{on_board} {value}: {meaning.values[value]!r} is not known here"
    for mask in sorted(use.masks):
        if mask and mask.bit_length() - 1 not in meaning.bits:
            yield f"{on_board}: has no bit {mask.bit_length() - 1}"
    for what, ours, theirs in (("default", use.default, meaning.default), ("maximum", use.most, meaning.most)):
        if ours is not None and theirs is not None and abs(ours * unit - theirs) > 1e-6:
            yield f"{on_board}: its {what} is {theirs:g}, here {ours * unit:g}"
    least = -math.inf if meaning.least is None else meaning.least
    most = math.inf if meaning.most is None else meaning.most
    for set_to in sorted(one * unit for one in use.sets):
        if set_to not in meaning.values and not least <= set_to <= most:
            yield f"{on_board}: faultline sets it to {set_to:g}, outside {least:g} to {most:g}"


def find_changes(dialect: Dialect, before: Mapping[str, Meaning], after: Mapping[str, Meaning]) -> list[str]:
    """Return differences between two releases in the parameters that are read or set, one line each."""
    found = []
    for name in list_uses(dialect):
        other = dialect.other_names.get(name)
        for one in (name,) if other is None else (name, other.name):
            was, is_ = before.get(one), after.get(one)
            if was != is_:
                found.append(f"{one}: {_describe(was)} -> {_describe(is_)}")
    return found


def _describe(meaning: Meaning | None) -> str:
    if meaning is None:
        return "nothing"
    words = ", ".join(f"{key} {word}" for key, word in (meaning.values or meaning.bits).items())
    bounds = (("default", meaning.default), ("at least", meaning.least), ("at most", meaning.most))
    figures = ", ".join(f"{what} {one:g}" for what, one in bounds if one is not None)
    return "; ".join(part for part in (words, figures, meaning.units) if part) or "a number"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print differences; returns 1 if there are any, 2 if a file is no metadata."""
    parser = argparse.ArgumentParser(prog="python -m scripts.parameter_metadata", description=__doc__)
    parser.add_argument("autopilot", choices=[dialect.name for dialect in AUTOPILOTS])
    parser.add_argument("metadata", type=Path, help="PX4's parameters.json or ArduPilot's apm.pdef.json")
    parser.add_argument("--before", type=Path, help="the same of an older release")
    asked = parser.parse_args(arguments)
    dialect = dialect_for(asked.autopilot)
    try:
        release = read_metadata(asked.metadata)
        changes = [] if asked.before is None else find_changes(dialect, read_metadata(asked.before), release)
    except MetadataError as error:
        print(error, file=sys.stderr)
        return 2
    found = find_differences(dialect, release)
    if asked.before is not None:
        _say(f"since {asked.before}, changes", changes)
    _say(f"{len(list_uses(dialect))} parameters held against {asked.metadata}, differences", found)
    return 1 if found else 0


def _say(heading: str, lines: Sequence[str]) -> None:
    print(f"{heading}: {len(lines)}", *lines, sep="\n  ")


if __name__ == "__main__":
    sys.exit(main())
