"""List the problems of a site, each at its key, in the wording of the command line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, TypedDict, cast

from pydantic import ValidationError

from executor.errors import ExecutorError, SiteError
from executor.plan_page.site_document import format_path
from executor.site.site_file import PAGE, Site, parse_toml
from executor.site.site_schema import build_site_schema
from missions import NESTED, MissionsError
from missions.errors import AreaError, BackgroundError, ElevationError, NetworkError
from missions.validation import format_error


class SiteProblem(TypedDict):
    """One problem."""

    path: list[str | int] | None
    """Key of the site file, if known."""
    message: str


_PLACE = re.compile(r"((?:[a-z_0-9]+(?:\[\d+\])*)(?:\.[a-z_0-9]+(?:\[\d+\])*)*): ?(.*)", re.DOTALL)
_ABOUT: Mapping[type[Exception], list[str | int]] = {
    ElevationError: ["terrain", "files"], BackgroundError: ["map", "background"], NetworkError: ["network", "file"]
}  # fmt: skip


def check_text(text: str) -> tuple[dict[str, Any], Site | None, list[SiteProblem]]:
    """Return the values of a site file, the site if it can be used, and its problems."""
    try:
        values = parse_toml(text)
        return values, Site.model_validate(values), []
    except SiteError as error:
        return {}, None, [SiteProblem(path=None, message=str(error))]
    except ValidationError as error:
        return values, None, list(_list_problems(error, values))
    except RecursionError:
        return values, None, [SiteProblem(path=None, message=NESTED)]


def _list_problems(error: ValidationError, values: Mapping[str, Any]) -> Iterator[SiteProblem]:
    found = error.errors(include_url=False)
    for one in found:
        inside = any(other["loc"][: len(one["loc"])] == one["loc"] != other["loc"] for other in found)
        if one["type"] == "too_short" and inside:
            continue  # none of the given ones can be used, which each one's own problem reports
        place, message = split_place(format_error(one, page=PAGE))
        known = list(one["loc"]) if place is None else place
        yield SiteProblem(path=_cut_to_values(known, values), message=message)


def _cut_to_values(path: Sequence[str | int], values: Mapping[str, Any]) -> list[str | int]:
    """Return a path as far as the file has it, plus one key: the rest are alternative types of a value."""
    at: Any = values
    for number, part in enumerate(path):
        is_there = part in at if isinstance(at, dict) else isinstance(at, list) and part in range(len(at))
        if is_there:
            at = cast("Any", at)[part]
        else:
            return list(path[: number + (isinstance(at, dict) and isinstance(part, str))])
    return list(path)


def split_place(words: str) -> tuple[list[str | int] | None, str]:
    """Return the key at the start of a line, and the rest; None and the line if there is none.

    >>> split_place("inspection.speed_m_s: expected at most 15")
    (['inspection', 'speed_m_s'], 'expected at most 15')
    >>> split_place("network.kml: line 1: expected XML")
    (None, 'network.kml: line 1: expected XML')
    """
    found = _PLACE.fullmatch(words)
    if found is None:
        return None, words
    parts = re.findall(r"[a-z_0-9]+", found[1])
    path: list[str | int] = [int(part) if part.isdigit() else part for part in parts]
    return (path, found[2]) if _is_known(path) else (None, words)


def _is_known(path: Sequence[str | int]) -> bool:
    """Return whether the site file may have a key."""
    tables = _list_keys()
    named = [part for part in path if isinstance(part, str)]
    return bool(named) and named[0] in tables and (len(named) == 1 or named[1] in tables[named[0]])


@cache
def _list_keys() -> Mapping[str, frozenset[str]]:
    schema = build_site_schema()
    definitions = schema["$defs"]

    def keys_of(known: Mapping[str, Any]) -> frozenset[str]:
        names = re.findall(r"#/\$defs/(\w+)", str(known))
        return frozenset(key for name in names for key in definitions[name].get("properties", ()))

    return {name: keys_of(known) for name, known in schema["properties"].items()}


def describe_error(error: MissionsError | ExecutorError, values: Mapping[str, Any]) -> SiteProblem:
    """Return an error in reading or planning a site as a problem, at its key if known."""
    path, message = split_place(str(error))
    if path is None:
        path = _find_file_key(error, message, values)
    return SiteProblem(path=path, message=message)


def _find_file_key(error: Exception, message: str, values: Mapping[str, Any]) -> list[str | int] | None:
    """Return the key that names a file which cannot be used."""
    if isinstance(error, NetworkError) and ": depot: " in message:
        return ["depot"]
    if not isinstance(error, AreaError):
        return next((list(known) for kind, known in _ABOUT.items() if isinstance(error, kind)), None)
    if stands := re.match(r"area\[(\d+)\]", message):
        return ["area", int(stands[1])]
    files = [one.get("file") for one in values.get("area", ()) if isinstance(one, dict)]
    named = next((at for at, file in enumerate(files) if file and str(file) in message), None)
    return ["area"] if named is None else ["area", named, "file"]


def describe_problem(problem: SiteProblem) -> str:
    """Return a problem in one line."""
    path = problem["path"]
    return problem["message"] if path is None else f"{format_path(path)}: {problem['message']}"
