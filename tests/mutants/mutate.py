"""The small changes that can be made to a source file, each as an edit of its text.

Not changed: what only words or types are made of (strings and what is inside f-strings, annotations, decorators).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
CHANGERS = {"replace"}
"""Functions whose keywords are each a change of their own."""

Statement = ast.stmt | ast.match_case | ast.ExceptHandler
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Verdict(Enum):
    """What became of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    TIMED_OUT = "timed out"
    EQUIVALENT = "equivalent"


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change."""

    path: str
    within: str
    """The function or class that it is in, with dots; empty at the top of the module."""
    line: int
    lines: tuple[int, int]
    """The first and the last line whose execution the change may show in."""
    bound: str
    """The name whose value it changes when the module is imported; empty for what is executed later."""
    begin: int
    end: int
    new: str
    """What stands instead of the bytes from `begin` to `end`."""

    def apply(self, source: bytes) -> bytes:
        """Return the source with the change."""
        return source[: self.begin] + self.new.encode() + source[self.end :]

    def difference(self, source: bytes) -> tuple[str, str]:
        """Return the lines that change, before and after, without their indent."""
        start = source.rfind(b"\n", 0, self.begin) + 1
        stop = source.find(b"\n", self.end)
        stop = len(source) if stop < 0 else stop
        after = source[start : self.begin] + self.new.encode() + source[self.end : stop]
        return source[start:stop].decode().strip(), after.decode().strip()


@dataclass(frozen=True)
class _Source:
    text: bytes

    @cached_property
    def starts(self) -> list[int]:
        return [0, *(found.end() for found in re.finditer(rb"\n", self.text))]

    def begin(self, node: ast.expr | ast.stmt | ast.keyword) -> int:
        return self.starts[node.lineno - 1] + node.col_offset

    def end(self, node: ast.expr | ast.stmt | ast.keyword) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.starts[node.end_lineno - 1] + node.end_col_offset

    def of(self, node: ast.expr) -> str:
        return self.text[self.begin(node) : self.end(node)].decode()

    def between(self, left: ast.expr, right: ast.expr, old: str) -> tuple[int, int]:
        """Return where an operator stands between its operands."""
        at = self.text.index(old.encode(), self.end(left), self.begin(right))
        return at, at + len(old)


Edit = tuple[int, int, str]


def _number(source: _Source, node: ast.Constant) -> Iterator[Edit]:
    value = node.value
    where = source.begin(node), source.end(node)
    if isinstance(value, bool):
        yield *where, str(not value)
    elif isinstance(value, int | float):
        others = {value + 1: None, value - 1: None, type(value)(0): None}
        yield from ((*where, f"({other!r})" if other < 0 else repr(other)) for other in others if other != value)


def _comparison(source: _Source, node: ast.Compare) -> Iterator[Edit]:
    for left, operator, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
        old, others = COMPARISONS[type(operator)]
        yield from ((*source.between(left, right, old), new) for new in others)


def _boolean(source: _Source, node: ast.BoolOp) -> Iterator[Edit]:
    old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
    for number, (left, right) in enumerate(zip(node.values, node.values[1:], strict=False)):
        if len(node.values) == 2 or number == len(node.values) - 2:
            yield *source.between(left, right, old), new
        # Of a longer chain each part is left out once: one other operator would bind otherwise than it looks.
        if len(node.values) > 2:
            yield source.begin(left), source.begin(right), ""


def _negated(source: _Source, node: ast.expr) -> Edit:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return source.begin(node), source.begin(node.operand), ""
    return source.begin(node), source.end(node), f"(not ({source.of(node)}))"


def _fewer_changes(source: _Source, node: ast.Call) -> Iterator[Edit]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name not in CHANGERS:
        return
    before: list[ast.expr | ast.keyword] = [*node.args, *node.keywords]
    for index, keyword in enumerate(before):
        if index and isinstance(keyword, ast.keyword) and keyword.arg is not None:
            yield source.end(before[index - 1]), source.end(keyword), ""


def _of_expression(source: _Source, node: ast.AST) -> Iterator[Edit]:
    match node:
        case ast.Constant():
            yield from _number(source, node)
        case ast.Compare():
            yield from _comparison(source, node)
        case ast.BoolOp():
            yield from _boolean(source, node)
        case ast.BinOp() if type(node.op) in ARITHMETIC:
            old, new = ARITHMETIC[type(node.op)]
            yield *source.between(node.left, node.right, old), new
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield source.begin(node), source.begin(node.operand), ""
        case ast.IfExp():
            yield _negated(source, node.test)
        case ast.comprehension():
            yield from (_negated(source, test) for test in node.ifs)
        case ast.Call():
            yield from _fewer_changes(source, node)


def _promises(function: Function | None) -> tuple[str, ...]:
    """Return what a function may return instead of what it does, judged by its annotation."""
    said = "" if function is None or function.returns is None else ast.unparse(function.returns)
    if said == "bool":
        return ("True", "False")
    return ("None",) if said.endswith("| None") else ()


def _of_statement(source: _Source, node: ast.AST, function: Function | None) -> Iterator[Edit]:
    match node:
        case ast.If() | ast.While():
            yield _negated(source, node.test)
        case ast.Return(value=ast.expr() as value):
            others = (other for other in _promises(function) if other != source.of(value))
            yield from ((source.begin(value), source.end(value), other) for other in others)
        case ast.Expr(value=ast.Call()):
            yield source.begin(node), source.end(node), "pass"
        case ast.Assign() | ast.AugAssign() if function is not None and not _first_binding(function, node):
            yield source.begin(node), source.end(node), "pass"


def _first_binding(function: Function, node: ast.Assign | ast.AugAssign) -> bool:
    """Tell whether an assignment is the only one of its names, so that without it nothing would work at all."""
    names = {
        part.id
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        for part in ast.walk(target)
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
    }
    given = {arg.arg for arg in ast.walk(function) if isinstance(arg, ast.arg)}
    bound = [part.id for part in ast.walk(function) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)]
    return any(name not in given and bound.count(name) == 1 for name in names)


@dataclass(frozen=True)
class _Place:
    within: tuple[str, ...] = ()
    function: Function | None = None
    lines: tuple[int, int] = (1, 1)
    bound: str = ""


def _last_line(node: ast.stmt | ast.match_case) -> int:
    """Return the last line of a statement without the statements in it."""
    if isinstance(node, ast.match_case):
        return node.body[0].lineno - 1
    body = getattr(node, "body", None) or getattr(node, "cases", None)
    if not body:
        assert node.end_lineno is not None
        return node.end_lineno
    first = body[0].pattern.lineno if isinstance(body[0], ast.match_case) else body[0].lineno
    return max(node.lineno, first - 1)


def _place(node: ast.AST, at: _Place) -> _Place:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            assert node.end_lineno is not None
            return _Place((*at.within, node.name), node, (node.body[0].lineno, node.end_lineno))
        case ast.ClassDef():
            return _Place((*at.within, node.name), None, (node.lineno, node.lineno))
        case ast.match_case():
            return _Place(at.within, at.function, (node.pattern.lineno, _last_line(node)), at.bound)
        case ast.stmt():
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
            bound = names[0] if names and at.function is None else ""
            return _Place(at.within, at.function, (node.lineno, _last_line(node)), bound)
    return at


def _children(node: ast.AST) -> Iterator[ast.AST]:
    left_out: set[int] = set()
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            left_out |= {id(one) for one in node.decorator_list}
            left_out.add(id(getattr(node, "returns", None)))
        case ast.arg() | ast.AnnAssign():
            left_out.add(id(node.annotation))
        case ast.Assign(targets=[ast.Name(id=name)]) if (
            re.fullmatch(r"(?:[A-Z][a-z0-9]*)+", name) and name != name.upper()
        ):
            return  # The name of a type
    yield from (child for child in ast.iter_child_nodes(node) if id(child) not in left_out)


def _walk(source: _Source, node: ast.AST, at: _Place) -> Iterator[tuple[_Place, Edit]]:
    at = _place(node, at)
    if isinstance(node, ast.JoinedStr):
        return
    edits: Iterable[Edit] = (*_of_expression(source, node), *_of_statement(source, node, at.function))
    yield from ((at, edit) for edit in edits)
    for child in _children(node):
        yield from _walk(source, child, at)


def mutants(path: str, text: bytes) -> list[Mutant]:
    """Return every change of a file, in the order of the file; a few do not leave it readable."""
    source, found = _Source(text), set[Mutant]()
    for at, (begin, end, new) in _walk(source, ast.parse(text), _Place()):
        line = text.count(b"\n", 0, begin) + 1
        found.add(Mutant(path, ".".join(at.within), line, at.lines, at.bound, begin, end, new))
    return sorted(found, key=lambda one: (one.begin, one.end, one.new))


def readable(mutant: Mutant, text: bytes) -> bool:
    """Tell whether a change leaves the file readable and another one than before."""
    try:
        return ast.dump(ast.parse(mutant.apply(text))) != ast.dump(ast.parse(text))
    except SyntaxError:
        return False
