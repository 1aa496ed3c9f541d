"""Edit a site file as text: unedited parts keep their wording, comments, order and blank lines.

A file is cut into blocks, each a table's header with the comments above it and the lines after it. Tables are added and
removed as blocks; keys within one are edited by tomlkit, on that block alone: on a whole file it would merge separated
tables of one array, and move their comments. Every edit is applied to the values as well, and the new text is checked
against them.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import tomlkit
from pydantic import ConfigDict, Field
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item

from executor.errors import SiteError
from executor.site.site_file import parse_toml

Path: TypeAlias = tuple[str | int, ...]
"""Keys and list indices, from the top of the file down."""
Key = Annotated[str, Field(max_length=200)] | Annotated[int, Field(ge=0, le=1_000_000)]
DEEPEST = 12
"""Most keys in a path."""


class EditRefused(SiteError):
    """Edit that cannot be done."""

    def __init__(self, path: Path, reason: str) -> None:
        """Set the path and the reason."""
        super().__init__(f"{format_path(path)}: {reason}")
        self.path = path


@dataclass(frozen=True, slots=True)
class Edit:
    """One change of a site file."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    op: Literal["set", "unset", "add", "remove"]
    """`add` inserts into a list or an array of tables; `remove` deletes one element."""
    path: Annotated[tuple[Key, ...], Field(min_length=1, max_length=DEEPEST)]
    """Keys and list indices, from the top of the file down."""
    value: Any = None
    """JSON value for `set` and `add`."""
    at: Annotated[int, Field(ge=0)] | None = None
    """Index to insert before, for `add`; the end by default."""


@dataclass(frozen=True, slots=True)
class _Block:
    """Table header, the comments right above it, and all lines up to the next block."""

    path: Path
    """Path of the table, with the index of an array element."""
    head: str
    """Comments above the table, and its header."""
    body: str


def format_path(path: Sequence[str | int]) -> str:
    """Return a path in the command line's notation.

    >>> format_path(("vehicle", 0, "budget_pct"))
    'vehicle[0].budget_pct'
    """
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".") or "content"


def apply_edits(text: str, edits: Iterable[Edit]) -> str:
    """Return a site file after edits.

    Raises:
        SiteError: it is not TOML.
        EditRefused: an edit cannot be done; then none is applied.
    """
    values = parse_toml(text)
    for edit in edits:
        _check_edit(edit)
        wanted = copy.deepcopy(values)
        _edit_values(wanted, edit.path, edit)
        if edit.op == "unset" and wanted == values:
            continue
        try:
            text = _edit_text(text, edit)
            values = parse_toml(text)
        except (TOMLKitError, SiteError, ValueError, TypeError, KeyError, IndexError, RecursionError) as error:
            raise EditRefused(edit.path, f"cannot be written to this file: {error}") from error
        if values != wanted and (edit.op in {"set", "add"} or _prune(values) != _prune(wanted)):
            raise EditRefused(edit.path, "cannot be written to this file without a change of something else in it")
    return text


def _edit_values(
    values: dict[str, Any], path: Path, edit: Edit, make: Callable[[Any], Any] = lambda value: value
) -> None:
    """Apply an edit at a path: to plain values, or to tomlkit's, for which `make` converts inserted values."""
    *way, last = path
    at: Any = values
    for number, part in enumerate(way):
        if isinstance(at, dict) and isinstance(part, str) and part not in at and edit.op in {"set", "add"}:
            at[part] = make({})
        at = _step_down(at, part, path[: number + 1])
    if edit.op in {"set", "unset"}:
        _set_value(at, last, edit, make)
    elif edit.op == "add":
        if isinstance(at, dict) and isinstance(last, str) and last not in at:
            at[last] = make([])
        values_there = _step_down(at, last, path)
        if not isinstance(values_there, list):
            raise EditRefused(path, "expected a list")
        _check_kind(values_there, edit)
        values_there.insert(len(values_there) if edit.at is None else edit.at, make(edit.value))
    elif not isinstance(at, list):
        raise EditRefused(path, "expected the number of a value in a list")
    else:
        _step_down(at, last, path)
        del at[int(last)]
        if not at:  # TOML has no empty array of tables, and a missing key means its default
            _drop(values, tuple(way))


def _check_edit(edit: Edit) -> None:
    if not 0 < len(edit.path) <= DEEPEST:
        raise EditRefused(edit.path[:DEEPEST], f"expected a path of 1 to {DEEPEST} keys")
    for one in (*_list_plain(edit.value), *edit.path) if edit.op in {"set", "add"} else ():
        if one is None or (isinstance(one, int) and abs(one) >= 2**63):
            raise EditRefused(edit.path, f"expected a value that TOML has, got {one}")
        if isinstance(one, str) and any("\ud800" <= letter <= "\udfff" for letter in one):
            raise EditRefused(edit.path, "expected a text of whole letters")


def _list_plain(value: object) -> Iterator[object]:
    if isinstance(value, Mapping):
        yield from value
        for one in value.values():
            yield from _list_plain(one)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _list_plain(one)
    else:
        yield value


def _step_down(at: Any, part: str | int, path: Path) -> Any:  # noqa: ANN401 - any value of a file
    if isinstance(at, list) and isinstance(part, int) and 0 <= part < len(at):
        return at[part]
    if isinstance(at, dict) and isinstance(part, str) and part in at:
        return at[part]
    raise EditRefused(path, "there is no such key or value in the file")


def _set_value(at: Any, last: str | int, edit: Edit, make: Callable[[Any], Any]) -> None:  # noqa: ANN401 - as above
    if isinstance(at, dict) and isinstance(last, str):
        if edit.op == "unset":
            at.pop(last, None)
            return
    elif edit.op == "set" and isinstance(last, int):
        _step_down(at, last, edit.path)
        _check_kind(at, edit)
    else:
        raise EditRefused(edit.path, "expected a key of a table")
    before = at.get(last) if isinstance(at, dict) else None
    at[last] = make(edit.value)
    now = at[last]
    if isinstance(before, Item) and isinstance(now, Item) and before.trivia.comment:
        # The trailing comment keeps its column, if there is room.
        longer = len(now.as_string()) - len(before.as_string())
        space = before.trivia.comment_ws
        now.trivia.comment_ws = " " * max(1, len(space) - longer) if set(space) == {" "} else space
        now.trivia.comment = before.trivia.comment


def _prune(value: Any) -> Any:  # noqa: ANN401 - any value of a file
    """Return values without empty tables: a table implied by its subtables' headers is removed with the last one."""
    if not isinstance(value, dict):
        return value
    kept = {key: _prune(one) for key, one in value.items()}
    return {key: one for key, one in kept.items() if one != {}}


def _check_kind(values_there: Sequence[object], edit: Edit) -> None:
    if _is_table(values_there) and not isinstance(edit.value, Mapping):
        raise EditRefused(edit.path, "expected a table, as the others of this list are")


def _drop(values: MutableMapping[str, Any], path: Path) -> None:
    *way, last = path
    at: Any = values
    for part in way:
        at = at[part]
    if isinstance(last, str):
        del at[last]


def _edit_text(text: str, edit: Edit) -> str:
    blocks = _cut_blocks(text)
    newline = "\r\n" if "\r\n" in text else "\n"
    own = [number for number, block in enumerate(blocks) if number and block.path[: len(edit.path)] == edit.path]
    match edit.op:
        case "unset" | "remove" if own:
            blocks = _remove_blocks(blocks, own)
        case "unset" | "remove":
            blocks = _edit_block(blocks, edit, newline)
        case "set" if own and not _is_table(edit.value):
            # A table, or a list of tables, becomes another kind of value: its blocks are removed first.
            blocks = _edit_block(_remove_blocks(blocks, own), edit, newline)
        case "set" if _is_table(edit.value) and (own or not _is_in_block(blocks, edit.path)):
            place = own[0] if own else _find_end(blocks, edit.path[:-1])
            blocks = _insert_blocks(_remove_blocks(blocks, own), place, _make_blocks(edit.path, edit.value), newline)
        case "add" if isinstance(edit.value, Mapping) and (own or not _is_in_block(blocks, edit.path)):
            place = _find_element(blocks, edit)
            made = _make_blocks((*edit.path, 0), edit.value)
            blocks = _insert_blocks(blocks, place, made, newline)
        case _:
            blocks = _edit_block(blocks, edit, newline)
    return "".join(block.head + block.body for block in blocks)


_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*|[\[\]{}]|\n|[^"\'#\[\]{}\n]+',
    re.DOTALL,
)
_HEADER = re.compile(r"[ \t]*\[")


def _cut_blocks(text: str) -> list[_Block]:
    """Return the blocks of a TOML text; the first one has no header."""
    starts, depth, fresh = list[int](), 0, True
    for token in _TOKEN.finditer(text):
        if fresh and _HEADER.match(text, token.start()):
            starts.append(token.start())
        word = token.group()
        depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(word, 0)
        fresh = word == "\n" and depth == 0
    cuts = [_find_comments(text, start) for start in starts]
    ends = [*cuts[1:], len(text)] if cuts else []
    blocks, counts = [_Block((), "", text[: cuts[0]] if cuts else text)], dict[Path, int]()
    for cut, start, end in zip(cuts, starts, ends, strict=True):
        body = text.find("\n", start) + 1 or len(text)
        path = _place_header(text[start:body], counts)
        blocks.append(_Block(path, text[cut:body], text[body:end]))
    return blocks


def _find_comments(text: str, start: int) -> int:
    """Return the start of the comments right above a header; comments at the top of the file belong to the file."""
    at = start
    while at > 0:
        line = text.rfind("\n", 0, at - 1) + 1
        if not text[line:at].lstrip().startswith("#"):
            return at
        at = line
    return start if at == 0 and start > 0 else at


def _place_header(header: str, counts: dict[Path, int]) -> Path:
    """Return the path of a header's table, with indices of array elements."""
    at: Any = tomllib.loads(header)
    keys: list[str] = []
    while at:
        ((key, at),) = at.items()
        keys.append(key)
        at = at[0] if isinstance(at, list) else at
    is_element, path = header.lstrip().startswith("[["), Path()
    for number, key in enumerate(keys, start=1):
        path = (*path, key)
        if number == len(keys) and is_element:
            counts[path] = counts.get(path, 0) + 1
        if path in counts:
            path = (*path, counts[path] - 1)
    return path


def _is_table(value: object) -> bool:
    """Return whether a value is written as separate tables."""
    return isinstance(value, Mapping) or (
        isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)
    )


def _find_owner(blocks: Sequence[_Block], path: Path) -> int:
    """Return the index of the block for a key: the block of its nearest parent table."""
    above = [number for number, block in enumerate(blocks) if block.path == path[: len(block.path)] != path]
    return max(above, key=lambda number: len(blocks[number].path))


def _is_in_block(blocks: Sequence[_Block], path: Path) -> bool:
    """Return whether part of a path is written inside a block, such as in an inline table."""
    owner = blocks[_find_owner(blocks, path)]
    return path[len(owner.path)] in tomllib.loads(owner.body)


def _find_end(blocks: Sequence[_Block], path: Path) -> int:
    """Return the index after the last block of a table."""
    return max((at + 1 for at, block in enumerate(blocks) if block.path[: len(path)] == path), default=len(blocks))


def _find_element(blocks: Sequence[_Block], edit: Edit) -> int:
    """Return the block index at which to insert a new element of an array of tables."""
    depth = len(edit.path)
    elements = [at for at, block in enumerate(blocks) if block.path[:depth] == edit.path and len(block.path) > depth]
    if not elements:
        return _find_end(blocks, edit.path[:-1])
    if edit.at is None:
        return elements[-1] + 1
    return next((at for at in elements if blocks[at].path[depth] == edit.at), elements[-1] + 1)


def _make_blocks(path: Path, value: Any) -> list[_Block]:  # noqa: ANN401 - any value sent
    """Return the blocks of a new table, or of a list of them."""
    if not isinstance(value, Mapping):
        return [block for number, one in enumerate(value) for block in _make_blocks((*path, number), one)]
    keys = ".".join(tomlkit.key(part).as_string() for part in path if isinstance(part, str))
    header = f"[[{keys}]]\n" if isinstance(path[-1], int) else f"[{keys}]\n"
    return [_Block(path, header, "".join(f"{row}\n" for row in _write_rows(value)))]


def _write_rows(value: Mapping[str, object]) -> Iterator[str]:
    return (f"{tomlkit.key(key).as_string()} = {_write_value(one)}" for key, one in value.items())


def _write_value(value: object) -> str:
    """Return a value on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(_write_rows(value)) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_write_value, value))}]"
    return tomlkit.item(value).as_string()


def _insert_blocks(blocks: list[_Block], place: int, made: list[_Block], newline: str) -> list[_Block]:
    """Insert blocks before another one, with a blank line around each."""
    before, after = blocks[:place], blocks[place:]
    if before and (before[-1].head or before[-1].body):
        body = before[-1].body
        stripped = body.rstrip("\r\n \t")
        rest = newline if stripped and not stripped.endswith("\n") else ""
        before[-1] = replace(before[-1], body=stripped + rest + newline)
    made = [replace(one, head=one.head.replace("\n", newline), body=one.body.replace("\n", newline)) for one in made]
    spaced = [replace(one, body=one.body + newline) for one in made[:-1]]
    last = replace(made[-1], body=made[-1].body + (newline if after else ""))
    return [*before, *spaced, last, *after]


def _remove_blocks(blocks: list[_Block], own: Sequence[int]) -> list[_Block]:
    kept = [block for number, block in enumerate(blocks) if number not in own]
    if own and own[-1] == len(blocks) - 1:
        kept[-1] = replace(kept[-1], body=re.sub(r"\n\s+\Z", "\n", kept[-1].body))
    return kept


def _edit_block(blocks: list[_Block], edit: Edit, newline: str) -> list[_Block]:
    """Edit a key within its block; add the table if it is missing."""
    number = _find_owner(blocks, edit.path)
    owner = blocks[number]
    rest = edit.path[len(owner.path) :]
    there = tomllib.loads(owner.body)
    if len(rest) > 1 and rest[0] not in there and edit.op in {"set", "add"}:
        value = edit.value if edit.op == "set" else [edit.value]
        table = next(at for at in range(len(edit.path) - 1, 0, -1) if isinstance(edit.path[at], str))
        made = _make_blocks(edit.path[:table], {edit.path[table]: value})
        return _insert_blocks(blocks, _find_end(blocks, owner.path) if owner.path else len(blocks), made, newline)
    document = tomlkit.parse(owner.body)
    _edit_values(document, rest, edit, _make_item)
    body = tomlkit.dumps(document)
    # The text after a block starts on a new line.
    body += "" if not body or body.endswith("\n") else "\n"
    return [*blocks[:number], replace(owner, body=body), *blocks[number + 1 :]]


def _make_item(value: object) -> Item:
    return tomlkit.value(_write_value(value))
