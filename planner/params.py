"""What the searches are tuned by: checked when it is made, and passed to the searches.

The defaults are what every figure of this project was found with. A TOML file may set any of them, each part in a table
of its own:

    [annealing]
    hot = 8.0

    [window]
    ways = [[0.0, 1.0], [0.8, 0.1]]

None of them changes what a plan is held against: budgets, the cost functions and the re-plan window of a plan have no
knobs. The baseline (grasp.py) has none either: it is the paper's, with the paper's numbers.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

from planner.errors import ParamsError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST_SAID = 60
"""Characters of a wrong value that are said again."""


class _Rule(NamedTuple):
    """What a field takes."""

    expected: str
    """In words."""
    taken: Callable[[object], object]
    """The value as the search uses it; None for one that does not fit."""


def _declare_whole(default: int, least: int = 1, most: int = 2**40) -> int:
    """Declare a field of whole numbers."""
    bounds = f"{least} or more" if most == 2**40 else f"from {least} to {most}"

    def taken(value: object) -> int | None:
        return value if isinstance(value, int) and not isinstance(value, bool) and least <= value <= most else None

    return field(default=default, metadata={"rule": _Rule(f"a whole number, {bounds}", taken)})


def _read_number(value: object, least: float, most: float) -> float | None:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    return float(value) if least <= value <= most else None


def _declare_real(default: float, *, most: float = 1e9, above_zero: bool = True) -> float:
    """Declare a field of numbers."""
    least = 1e-9 if above_zero else 0.0
    bounds = ("above 0" if above_zero else "0 or more") + (f", {most:g} at most" if most < 1e9 else "")
    return field(
        default=default, metadata={"rule": _Rule(f"a number {bounds}", lambda value: _read_number(value, least, most))}
    )


def _read_powers(value: object) -> tuple[float, ...] | None:
    if not isinstance(value, list | tuple) or not value:
        return None
    numbers = tuple(number for one in value if (number := _read_number(one, 1.0, 1e3)) is not None)
    return numbers if len(numbers) == len(value) else None


def _read_ways(value: object) -> tuple[tuple[float, float], ...] | None:
    if not isinstance(value, list | tuple) or not value:
        return None
    ways: list[tuple[float, float]] = []
    for way in value:
        shares = [_read_number(share, 0.0, 1.0) for share in way] if isinstance(way, list | tuple) else []
        if len(shares) != 2 or shares[0] is None or shares[1] is None:
            return None
        ways.append((shares[0], shares[1]))
    return tuple(ways)


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of the parameters, checked when it is made."""

    ASCENDING: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Fields of which the first must not be more than the second."""

    def __post_init__(self) -> None:
        """Take each field as its rule says.

        Raises:
            ParamsError: one line that names the field and what was expected.
        """
        for one in fields(self):
            rule: _Rule = one.metadata["rule"]
            value = getattr(self, one.name)
            taken = rule.taken(value)
            if taken is None:
                raise ParamsError(f"{one.name}: expected {rule.expected}, got {_format_value(value)}")
            object.__setattr__(self, one.name, taken)  # frozen, and not yet anybody's
        for lower, upper in self.ASCENDING:
            low, high = getattr(self, lower), getattr(self, upper)
            if low > high:
                raise ParamsError(f"{lower}: expected at most {upper}, {high}, got {low}")


def _format_value(value: object) -> str:
    said = repr(value)
    return said if len(said) <= LONGEST_SAID else f"{said[:LONGEST_SAID]}..."


@dataclass(frozen=True, slots=True)
class AnnealingParams(_Part):
    """The search of up to ``LargeParams.above`` segments, and of each region of larger instances."""

    batch: int = _declare_whole(500)
    """Iterations of a start between two questions to the stop rule, 500 take some milliseconds. Fewer answer a stop
    rule sooner; results are the same."""
    first_cycle: int = _declare_whole(4_000)
    """Iterations of the first cycle from hot to cold; each further cycle is twice as long. A longer one finds better
    plans where there is time for it, and nothing good before it ends."""
    first_cycle_leaving_out: int = _declare_whole(500)
    """The same, in iterations, where the first plan leaves something out, as after a loss.

    To find room for the rest is a question of luck as much as of length: several short cycles have the slowest
    hundredth of all re-plans in half the time that it takes with one long first cycle."""
    hot: float = _declare_real(6.0)
    """Temperature at the begin of a cycle, in mean transits of the plan. A hotter one forgets more of the plan."""
    cold: float = _declare_real(0.01)
    """Temperature at the end of a cycle, in mean transits. A colder one takes no worse plan at the end."""
    prize_weight: float = _declare_real(2.0)
    """What leaving a segment out costs the search, in routes of this segment alone."""
    slack: float = _declare_real(0.1, most=1.0, above_zero=False)
    """How far beyond budgets a soft annealing may go on its way, as a share of them; no result does."""
    excess_weight: float = _declare_real(1.0, above_zero=False)
    """What a percent beyond a budget costs a soft annealing besides itself, in percent."""
    powers: tuple[float, ...] = field(
        default=(8.0, 16.0, 32.0), metadata={"rule": _Rule("a list of numbers from 1 to 1000", _read_powers)}
    )
    """The p of the p-norm that stands for MinMax, one for each stage of an annealing: a low p sees the second largest
    route too, a high one hardly anything but the largest."""

    ASCENDING = (("cold", "hot"),)


@dataclass(frozen=True, slots=True)
class LargeParams(_Part):
    """The search of larger instances, region by region."""

    above: int = _declare_whole(500, least=0)
    """Segments up to which all routes are searched at once; above that no table of all moves is made. More need memory
    as their square."""
    region: int = _declare_whole(300)
    """Segments of a region, about; two routes at least. Larger ones find better plans, later."""
    region_routes: int = _declare_whole(24, least=2)
    """Routes of a region at most."""
    spell: int = _declare_whole(4_000)
    """Iterations that a region gets at a time: one annealing."""
    hot: float = _declare_real(0.5)
    """Temperature at the begin of a spell, in mean transits. A low one keeps most of the plan."""


@dataclass(frozen=True, slots=True)
class ExactParams(_Part):
    """The proof of the best plan."""

    search_iterations: int = _declare_whole(3_000, least=0)
    """Iterations of the search for the plan that bounds the cost from above. A better plan leaves fewer columns."""


@dataclass(frozen=True, slots=True)
class WindowSearchParams(_Part):
    """The search for the largest re-plan window: plans to begin with, then walks on the window itself."""

    minmax_searches: int = _declare_whole(2, most=1_000)
    """Searches for the MinMax plan, whose longest route is the measure."""
    minmax_iterations: int = _declare_whole(20_000, least=0)
    """Iterations of each of them."""
    other_searches: int = _declare_whole(8, least=0, most=1_000)
    """Searches for the other costs before the first walk; another follows whenever a walk has long found nothing."""
    other_iterations: int = _declare_whole(10_000, least=0)
    """Iterations of each of them."""
    full_effort_from: int = _declare_whole(40)
    """Segments below which searches for plans to begin with are shorter, in proportion."""
    most_flipped: int = _declare_whole(6, least=0, most=16)
    """Vehicles up to which all orientations of the routes are tried: 2 to the power of their number."""
    probes: int = _declare_whole(8, least=2, most=256)
    """Times at which losses are looked at in a walk: the aim, and those at which windows broke although the aim held.
    More cost time in each iteration and are wrong less often."""
    look: int = _declare_whole(1_000)
    """Iterations of ruin and recreate for a loss when a plan's whole window is looked at."""
    follow: int = _declare_whole(20)
    """The same in a walk, where the repair follows another."""
    whole_look: int = _declare_whole(25)
    """Iterations that a look at a whole window counts as, so that the stop rule is asked often enough."""
    batch: int = _declare_whole(250)
    """Iterations of each walk between two questions to the stop rule, when walks share what they found."""
    cycle: int = _declare_whole(4_000)
    """Iterations of a walk from hot to cold at least: every second round of steps in vain is followed by one of cycles
    four times as long, every fourth by one of cycles sixteen times as long, and so on. Small fleets need many
    beginnings, large ones long walks (after Luby, Sinclair, Zuckerman 1993)."""
    longest_cycle: int = _declare_whole(256_000)
    """The same at most."""
    ways: tuple[tuple[float, float], ...] = field(
        default=((0.0, 1.0), (0.8, 0.1)), metadata={"rule": _Rule("a list of pairs of shares from 0 to 1", _read_ways)}
    )
    """How cycles go in turn: (how often a change is made early in the plan, how often a repair is worked on whose loss
    the change does not touch), as shares. The first brings repairs to their best where they are long, the second tries
    more plans."""
    hot: float = _declare_real(2.0)
    """Temperature at the begin of the shortest cycle, in mean transits of its plan; longer ones begin hotter."""
    cold: float = _declare_real(0.05)
    """Temperature at the end of a cycle, in mean transits."""
    nearly: float = _declare_real(3.0, above_zero=False)
    """Mean transits that repairs may lack at the end of a cycle to be looked at once more, with more effort."""
    first_step: float = _declare_real(0.06, most=1.0)
    """How far below the earliest time so far a walk aims at first, as a share of the longest route."""
    last_step: float = _declare_real(0.01, most=1.0)
    """The same in the end: a step is halved while it is longer."""
    rise: float = _declare_real(0.03, above_zero=False)
    """How much more energy a plan may use than the one before it, as a share of the first plan's."""
    elite: int = _declare_whole(4)
    """The best plans so far, from which walks begin in turn."""
    finalists: int = _declare_whole(4)
    """The best plans, whose windows are computed in full in the end."""
    front_round: int = _declare_whole(150_000)
    """Iterations for each stretch in the first round of ``front``; each further round has half as many again."""

    ASCENDING = (("cold", "hot"), ("cycle", "longest_cycle"), ("last_step", "first_step"))


@dataclass(frozen=True, slots=True)
class SearchParams:
    """All that the searches are tuned by."""

    annealing: AnnealingParams = AnnealingParams()
    large: LargeParams = LargeParams()
    exact: ExactParams = ExactParams()
    window: WindowSearchParams = WindowSearchParams()

    def __post_init__(self) -> None:
        """Check what concerns two parts.

        Raises:
            ParamsError: the spells of a region would heat instead of cool.
        """
        if self.large.hot < self.annealing.cold:
            raise ParamsError(
                f"large.hot: expected at least annealing.cold, {self.annealing.cold}, got {self.large.hot}"
            )

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any]) -> SearchParams:
        """Return what a mapping of mappings sets, the rest as it is by default.

        Raises:
            ParamsError: one line that names the key and what was expected.
        """
        _check_known_keys(content, cls, "")
        return cls(
            annealing=_read_part(AnnealingParams, content, "annealing"),
            large=_read_part(LargeParams, content, "large"),
            exact=_read_part(ExactParams, content, "exact"),
            window=_read_part(WindowSearchParams, content, "window"),
        )

    @classmethod
    def load(cls, path: Path) -> SearchParams:
        """Return what a TOML file sets, the rest as it is by default.

        Raises:
            ParamsError: one line that names the file, the key and what was expected.
        """
        try:
            content = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
        except FileNotFoundError:
            raise ParamsError(f"{path}: no such file; expected search parameters (TOML)") from None
        except OSError as error:
            raise ParamsError(f"{path}: cannot be read: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise ParamsError(f"{path}: not TOML: {error}") from error
        try:
            return cls.from_mapping(content)
        except ParamsError as error:
            raise ParamsError(f"{path}: {error}") from error


DEFAULT_PARAMS = SearchParams()
"""What every search uses that is not told otherwise."""


_PartT = TypeVar("_PartT", bound=_Part)


def _read_part(kind: type[_PartT], content: Mapping[str, Any], name: str) -> _PartT:
    table = content.get(name, {})
    if not isinstance(table, Mapping):
        raise ParamsError(f"{name}: expected a table, got {_format_value(table)}")
    _check_known_keys(table, kind, f"{name}.")
    try:
        return kind(**table)
    except ParamsError as error:
        raise ParamsError(f"{name}.{error}") from error


def _check_known_keys(content: Mapping[str, Any], kind: type[DataclassInstance], place: str) -> None:
    names = [one.name for one in fields(kind)]
    for key in content:
        if key not in names:
            raise ParamsError(f"{place}{key}: not known; expected one of {', '.join(names)}")
