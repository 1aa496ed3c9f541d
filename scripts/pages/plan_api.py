"""The page about the API of the plan page, made from its OpenAPI document: each path, and each transferred object."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from executor.plan_page.api import build_api
from executor.plan_page.workspace import Workspace

PAGE = "reference/plan-page-api.md"
KINDS = {
    "string": "text", "number": "number", "integer": "whole number", "boolean": "`true`, `false`", "null": "`null`",
    "object": "object",
}  # fmt: skip
Schema = Mapping[str, Any]


def plan_api_page(made: str) -> str:
    """Return the page; `made` is its first line."""
    document = build_api(Workspace(Path())).openapi()
    lines = [
        made,
        "",
        "# The plan page's API",
        "",
        "What the page of `faultline open` asks of its server, for programs that plan or fly without it; an example",
        "is in [Plan on the map](../how-to/plan-page.md). The running server has the same as OpenAPI at",
        "`/api/openapi.json`.",
        "",
        "Bodies and answers are JSON, but for the uploaded file. Places are `[latitude, longitude]` in degrees. What",
        "is not done is answered with `error`, one line, and `path`, the key of the site file that it is about: 422",
        "for what cannot be done, 409 where the site is another one than the `revision` says. Requests of other pages",
        "are refused; where the server asks for a token, `Authorization: Bearer TOKEN` shows it.",
        "",
        "`GET /api/events` is a stream of server-sent events: `revision`, `checked`, `job`, `chosen`, `plans`, `warm`,",
        "`saved` and `tabs`, whenever one of them changes.",
    ]
    for path, methods in document["paths"].items():
        for method, said in methods.items():
            lines += ["", f"## {method.upper()} {path}", "", said["description"], "", *_describe_call(said, document)]
    lines += ["", "## Objects"]
    for name, schema in sorted(document["components"]["schemas"].items()):
        if not name.endswith("Body") and "ValidationError" not in name:
            lines += ["", f"### {name}", "", schema.get("description", ""), "", *_list_keys(schema)]
    return "\n".join(lines) + "\n"


def _describe_call(said: Schema, document: Schema) -> Iterator[str]:
    asked = [
        f"| `{one['name']}` | {_name_kind(one['schema'])} | {'' if one['required'] else 'in the address'} |"
        for one in said.get("parameters", ()) if one["in"] == "query"
    ]  # fmt: skip
    if asked:
        yield from ("In the address:", "", "| key | values | |", "| --- | --- | --- |", *asked, "")
    body = said.get("requestBody")
    if body is not None:
        name = body["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
        yield from _list_keys(document["components"]["schemas"][name])
        yield ""
    answer = said["responses"]["200"].get("content", {}).get("application/json", {}).get("schema", {})
    yield f"Answer: {_name_kind(answer)}." if "$ref" in answer else "Answer: as it says."


def _list_keys(schema: Schema) -> Iterator[str]:
    yield from ("| key | values | default | meaning |", "| --- | --- | --- | --- |")
    needed = schema.get("required", ())
    for key, one in schema.get("properties", {}).items():
        default = "**required**" if key in needed else f"`{one['default']}`" if one.get("default") is not None else "-"
        meaning = " ".join(one.get("description", "").split())
        yield f"| `{key}` | {_name_kind(one)} | {default} | {meaning} |"


def _name_kind(schema: Schema) -> str:
    """Return a value's type in words."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"`{name}`" if name.endswith("Body") else f"[{name}](#{name.lower()})"
    if "enum" in schema:
        return ", ".join(f"`{one}`" for one in schema["enum"])
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(map(_name_kind, schema["anyOf"])))
    if "prefixItems" in schema:
        return f"[{', '.join(map(_name_kind, schema['prefixItems']))}]"
    if schema.get("type") == "array":
        return f"list of {_name_kind(schema.get('items', {}))}"
    return KINDS.get(str(schema.get("type")), "any value")
