"""Pages and schemas generated from the program, and the types of the documents its page gets.

`python -m scripts.pages.reference docs` writes them.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from annotated_types import BaseMetadata, Ge, Gt, Le
from pydantic import BaseModel, WithJsonSchema
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from typer.core import TyperCommand, TyperGroup

from executor.adapters.mqtt.intent_intake import IntakeReason
from executor.cli import commandline
from executor.cli.commandline import load_command
from executor.core.interface.codes import ChannelCode, CheckCode, Ending, ReasonCode
from executor.core.interface.intents import IntentReason
from executor.core.state.vehicle_state import FaultCode
from executor.site import site_file
from executor.site.site_schema import SITE, find_unit, read_docstrings
from scripts.pages.asyncapi import PLACE as ASYNCAPI
from scripts.pages.asyncapi import asyncapi_document
from scripts.pages.library import PAGE as LIBRARY
from scripts.pages.library import TESTING_PAGE, library_page, testing_page
from scripts.pages.page_types import TYPES, page_types
from scripts.pages.plan_api import PAGE as PLAN_API
from scripts.pages.plan_api import plan_api_page
from scripts.pages.schemas import schemas
from scripts.pages.states import PAGE, PICTURE, states_page, states_picture

COMMANDS = "reference/command-line.md"
SITE_FILE = "reference/site-file.md"
REASONS = "reference/reason-codes.md"
DOMAINS: tuple[tuple[str, type[ReasonCode]], ...] = (
    ("Faults", FaultCode),
    ("Intents", IntentReason),
    ("Answers of a vehicle", Ending),
    ("Messages from the broker", IntakeReason),
    ("The checklist", CheckCode),
    ("Telemetry radios", ChannelCode),
)
"""Domains of codes, by heading."""
MADE = "<!-- Made by ./scripts/reference: change the program's {what} instead. -->"


def pages() -> dict[str, str]:
    """Return each page and schema, by its path from `docs`."""
    states = states_page(MADE.format(what="tables (executor/core/state/vehicle_state.py, flags.py and fleet.py)"))
    return {
        COMMANDS: commands_page(),
        SITE_FILE: site_page(),
        REASONS: reasons_page(),
        PAGE: states,
        PLAN_API: plan_api_page(MADE.format(what="models (executor/plan_page/api.py and api_answers.py)")),
        PICTURE: states_picture(),
        TESTING_PAGE: testing_page(MADE.format(what="docstrings (simulator/testing.py)")),
        LIBRARY: library_page(MADE.format(what="docstrings (faultline/__init__.py)")),
        TYPES: page_types(),
        ASYNCAPI: asyncapi_document(),
        **schemas(),
    }


def write_pages(folder: Path) -> None:
    """Write every page and schema to its path in a folder."""
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")


def commands_page() -> str:
    """Return the page of the command line: each command with its arguments and options, as in `--help`."""
    lines = [
        MADE.format(what="help texts (executor/cli)"),
        "",
        "# Command line",
        "",
        "Every command with its options, as `--help` shows them. Which command is for what: [the commands at a",
        "glance](commands.md). What the exit codes mean: [exit codes](exit-codes.md).",
    ]
    for name, command in commands():
        lines += ["", f"## {name}", "", *_command(name, command)]
    return "\n".join(lines) + "\n"


def commands() -> Iterator[tuple[str, TyperCommand]]:
    """Yield every command by its full name, for example `faultline bench fleet`."""
    for name, command in ((name, load_command(name)) for name in commandline.COMMANDS):
        for whole, one in ((name, command), *((f"{name} {below}", one) for below, one in _children(command))):
            if isinstance(one, TyperCommand):
                yield f"faultline {whole}", one


def _children(group: object) -> Iterator[tuple[str, object]]:
    if isinstance(group, TyperGroup):
        yield from group.commands.items()


def _command(name: str, command: TyperCommand) -> Iterator[str]:
    context = command.make_context(name, [], resilient_parsing=True)
    yield from inspect.cleandoc(command.help or "").splitlines()
    yield from ("", "```text", *_usage(name, command, context), "```", "")
    yield from ("| argument, option | meaning |", "| --- | --- |")
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and "--help" not in parameter.opts:
            shown, meaning = record
            yield f"| `{_cell(_kind(shown))}` | {_cell(_ranged(meaning))} |"


def _usage(name: str, command: TyperCommand, context: Any) -> Iterator[str]:  # noqa: ANN401 - typer's own, not public
    yield " ".join((name, *command.collect_usage_pieces(context)))


def _kind(shown: str) -> str:
    """Return an option with its argument in one word, where typer names a Python type.

    >>> _kind("--vehicles <int range>"), _kind("SITE <path>"), _kind("--cost <minmax|minsum>")
    ('--vehicles NUMBER', 'SITE', '--cost <minmax|minsum>')
    """
    text = re.sub(r"<(?:int|float|list\[(?:int|float)\])(?: range)?>", "NUMBER", shown)
    return re.sub(r"^([A-Z.]+) <\w+(?:\[\w+\])?>$", r"\1", text)


def _ranged(meaning: str) -> str:
    """Return a help with typer's range in plain words: `0<=x<=100` as `0 to 100`.

    >>> _ranged("Percent.  [default: 10.0; 0<=x<=1000]")
    'Percent. (default: 10.0; 0 to 1000)'
    """
    text = re.sub(r"([\d.]+)<=x<=([\d.]+)", r"\1 to \2", meaning)
    text = re.sub(r"x>=([\d.]+)", r"\1 or more", text)
    return re.sub(r"  \[(.*)\]$", r" (\1)", text)


def site_page() -> str:
    """Return the page of the site file: each table, and each key with its unit, default, values and meaning."""
    words = {(name, key): text for module in SITE for name, key, text in read_docstrings(module)}
    shown: set[type[BaseModel]] = set()
    lines = [
        MADE.format(
            what="site models (executor/site/site_file.py, site_keys.py, flight_keys.py and mqtt_and_web_keys.py)"
        ),
        "",
        "# Site file",
        "",
        "One TOML file describes a site: depot, power line, vehicles, and how they fly. `faultline init` writes one to",
        "start from. Paths are relative to the site file. An unknown key, or a value out of range, is refused with one",
        "line that names the file, the key and what was expected. As a schema, for editors that check TOML:",
        "[site.schema.json](../schemas/site.schema.json).",
        "",
        "A table may be left out unless one of its keys is required. A default of - means that the key is unset.",
    ]
    for heading, model in _tables(site_file.Site, ""):
        if model in shown:
            continue  # has the same keys as another
        shown.add(model)
        lines += ["", f"## {heading}", "", inspect.cleandoc(model.__doc__ or ""), ""]
        lines += ["| key | unit | default | values | meaning |", "| --- | --- | --- | --- | --- |"]
        for name, field in _plain(model):
            if (model.__name__, name) not in words:
                raise LookupError(f"{model.__name__}.{name}: expected a docstring below it, for {SITE_FILE}")
            lines.append(_key(name, field, words[model.__name__, name]))
    return "\n".join(lines) + "\n"


def reasons_page() -> str:
    """Return the page of the reason codes: each domain, and each code with its meaning."""
    lines = [
        MADE.format(what="enums of reasons"),
        "",
        "# Reason codes",
        "",
        "Beside a sentence for people stands a `code` for programs: in MQTT messages, in the answer to",
        "`POST /intents`, on the page's stream and in `report.json`. Sentences may be worded anew at any time, codes",
        "keep their meaning.",
    ]
    for heading, kind in DOMAINS:
        lines += [
            "",
            f"## {heading}",
            "",
            inspect.cleandoc(kind.__doc__ or ""),
            "",
            "| code | meaning |",
            "| --- | --- |",
        ]
        lines += [f"| `{one.value}` | {_cell(one.meaning)} |" for one in kind]
    return "\n".join(lines) + "\n"


def keys() -> list[str]:
    """Return every key of a site file by its full name, for example `mqtt.port`."""
    found: list[str] = []
    for heading, model in _tables(site_file.Site, ""):
        found += [f"{heading.strip('`[]')}.{name}" for name, _ in _plain(model)]
    return found


def _tables(model: type[BaseModel], above: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield the tables below a model, with their TOML headings."""
    for name, field in model.model_fields.items():
        below = _model_of(field.annotation)
        if below is None:
            continue
        whole = f"{above}{name}"
        several = tuple in _kinds(field.annotation)
        yield (f"`[[{whole}]]`" if several else f"`[{whole}]`"), below
        yield from _tables(below, f"{whole}.")


def _plain(model: type[BaseModel]) -> Iterator[tuple[str, FieldInfo]]:
    for name, field in model.model_fields.items():
        if model is not site_file.Site:  # whose keys are the tables themselves
            yield field.alias or name, field


def _model_of(kind: object) -> type[BaseModel] | None:
    """Return the table in a field's type, alone, in a tuple or with None."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind
    return next((found for one in get_args(kind) if (found := _model_of(one)) is not None), None)


def _kinds(kind: object) -> set[object]:
    return {get_origin(kind)}.union(*(_kinds(one) for one in get_args(kind)))


def _key(name: str, field: FieldInfo, meaning: str) -> str:
    default = "**required**" if field.default is PydanticUndefined else _value(field.default)
    return f"| `{name}` | {find_unit(name)} | {default} | {_cell(_values(field))} | {_cell(meaning)} |"


def _value(value: object) -> str:
    match value:
        case None | ():
            return "-"
        case bool():
            return f"`{str(value).lower()}`"
        case tuple():
            return f"`[{', '.join(f'{one:g}' if isinstance(one, float) else repr(one) for one in value)}]`"
        case float():
            return f"`{value:g}`"
        case _:
            return f"`{value}`"


def _values(field: FieldInfo) -> str:
    """Return a key's allowed values, in words."""
    listed = [
        one.json_schema.get("enum") for one in field.metadata if isinstance(one, WithJsonSchema) and one.json_schema
    ]
    if words := (*_literals(field.annotation), *(word for enum in listed for word in enum or ())):
        return ", ".join(f"`{word}`" for word in words)
    if _model_of(field.annotation) is not None:
        return "tables, below"
    limits = [*_metadata(field.annotation), *field.metadata]
    low = next((one.ge for one in limits if isinstance(one, Ge)), None)
    above = next((one.gt for one in limits if isinstance(one, Gt)), None)
    high = next((one.le for one in limits if isinstance(one, Le)), None)
    count = "" if ... in get_args(field.annotation) else "2 "
    pair = f"{count}numbers, each " if tuple in _kinds(field.annotation) else ""
    if low is not None and high is not None:
        return f"{pair}{low:.9g} to {high:.9g}"
    if above is not None and high is not None:
        return f"{pair}above {above:.9g}, at most {high:.9g}"
    if bool in _leaves(field.annotation):
        return "`true`, `false`"
    return "texts" if tuple in _kinds(field.annotation) else "text"


def _literals(kind: object) -> tuple[str, ...]:
    if get_origin(kind) is Literal:
        return get_args(kind)
    return tuple(word for one in get_args(kind) for word in _literals(one))


def _metadata(kind: object) -> Iterator[BaseMetadata]:
    """Yield all bounds within a type."""
    for one in (*getattr(kind, "__metadata__", ()), *get_args(kind)):
        if isinstance(one, FieldInfo):
            yield from (bound for bound in one.metadata if isinstance(bound, Ge | Gt | Le))
        elif isinstance(one, Ge | Gt | Le):
            yield one
        else:
            yield from _metadata(one)


def _leaves(kind: object) -> set[object]:
    parts = get_args(kind)
    return {kind} if not parts else set().union(*(_leaves(one) for one in parts))


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
