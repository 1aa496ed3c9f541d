"""What of a file is wanted: layers, and lines by their attributes."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from missions.errors import NetworkError
from missions.readers.attributes import plain_name
from missions.readers.drawing import Attributes
from missions.readers.values import figure_of

OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "=": operator.eq, "<": operator.lt, ">": operator.gt,
}  # fmt: skip
NAMED = 12
"""How many attributes or layers an error names."""
_TERM = re.compile(
    r"""\s*(?:"(?P<quoted>[^"]+)"|(?P<name>[^\s<>=!'"]+))\s*(?P<op><=|>=|!=|==|=|<|>)\s*"""
    r"""(?:'(?P<text>[^']*)'|"(?P<text2>[^"]*)"|(?P<bare>[^\s<>=!'"]+))\s*"""
)
_AND = re.compile(r"and\b\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Term:
    """One comparison."""

    attribute: str
    op: str
    value: str

    def holds(self, value: object) -> bool:
        """Return whether it holds of a value; of a list such as OpenStreetMap's ``110000;22000``, of any part.

        As numbers where both are; by order only numbers are compared. What is not there fulfils nothing.
        """
        parts = [] if value is None else str(value).split(";") if isinstance(value, str) else [str(value)]
        compare = any if self.op != "!=" else all
        return bool(parts) and compare(self._holds(part.strip()) for part in parts)

    def _holds(self, part: str) -> bool:
        mine, theirs = figure_of(self.value), figure_of(part)
        if mine is not None and theirs is not None:
            return OPERATORS[self.op](theirs, mine)
        return self.op in {"=", "!="} and (part == self.value) is (self.op == "=")


def parse_where(text: str) -> tuple[Term, ...]:
    """Return the comparisons of a filter such as ``voltage >= 110000 and operator = 'CEPS'``.

    Raises:
        ValueError: it is none.
    """
    terms, at = [], 0
    while match := _TERM.match(text, at):
        op = "=" if match["op"] == "==" else match["op"]
        value = next(found for found in (match["text"], match["text2"], match["bare"]) if found is not None)
        terms.append(Term(match["quoted"] or match["name"], op, value))
        at = match.end()
        if at == len(text):
            return tuple(terms)
        following = _AND.match(text, at)
        if following is None:
            break
        at = following.end()
    raise ValueError("expected comparisons such as \"voltage >= 110000 and operator = 'CEPS'\", with = != < <= > >=")


@dataclass(slots=True)
class Choice:
    """What a caller wants of a file, and what was seen while it was looked for."""

    layers: tuple[str, ...] = ()
    """By their names; all that fit if empty."""
    where: tuple[Term, ...] = ()
    crs: str | None = None
    """Of files that do not say theirs."""
    seen: set[str] = field(default_factory=set)
    passed: int = 0
    looked: int = 0

    def takes(self, attributes: Attributes) -> bool:
        """Return whether a feature is wanted."""
        self.looked += 1
        lowered = {key.lower(): value for key, value in attributes.items()}
        if self.where:
            self.seen.update(attributes)
        if not all(term.holds(lowered.get(term.attribute.lower())) for term in self.where):
            return False
        self.passed += 1
        return True

    def asks_for(self, attribute: str) -> bool:
        """Return whether a comparison is of an attribute, given by its plain name."""
        return any(plain_name(term.attribute) == attribute for term in self.where)

    def check_where(self, source: str) -> None:
        """Refuse a filter that nothing of the file answers to.

        Raises:
            NetworkError: an attribute that no line has, or nothing fulfils it all.
        """
        if not self.where or not self.looked:
            return
        known = {key.lower() for key in self.seen}
        for term in self.where:
            if term.attribute.lower() not in known:
                raise NetworkError(
                    f"{source}: where: expected an attribute of the lines, {quoted_names(sorted(self.seen))}, "
                    f"got {term.attribute!r}"
                )
        if not self.passed:
            words = " and ".join(f"{term.attribute} {term.op} {term.value}" for term in self.where)
            raise NetworkError(f"{source}: where: expected lines of which {words} holds, found none of {self.looked}")

    def chosen_layers(self, source: str, known: Sequence[str], kind: str = "layer") -> tuple[str, ...]:
        """Return the layers that are asked for, of those that there are; all if none is asked for.

        Raises:
            NetworkError: one is not there.
        """
        for layer in self.layers:
            if layer not in known:
                raise NetworkError(
                    f"{source}: layer: expected a {kind} of the file, {quoted_names(known)}, got {layer!r}"
                )
        return self.layers or tuple(known)

    def no_layers(self, source: str, what: str) -> None:
        """Refuse layers for a format without them.

        Raises:
            NetworkError: one is asked for.
        """
        if self.layers:
            raise NetworkError(
                f"{source}: layer: expected none for {what}, which has no layers; got {self.layers[0]!r}"
            )

    def no_crs(self, source: str, what: str) -> None:
        """Refuse another grid for a format that is WGS 84 always.

        Raises:
            NetworkError: one is asked for.
        """
        if self.crs is not None:
            raise NetworkError(f"{source}: crs: expected none for {what}, which is always WGS 84; got {self.crs!r}")


def quoted_names(names: Iterable[str]) -> str:
    """Return names for a message: the first few in quotes."""
    every = list(names)
    return ", ".join(repr(name) for name in every[:NAMED]) + (", ..." if len(every) > NAMED else "") or "which has none"
