"""Tuning parameters of the searches, checked on creation.

All results of this project were computed with the defaults. A TOML file may override any of them, each part in its own
table:

    [annealing]
    hot = 8.0

    [window]
    ways = [[0.0, 1.0], [0.8, 0.1]]

No parameter changes the rules for a plan: budgets, the cost functions and a plan's re-plan window have no parameters.
The baseline (grasp.py) has none either: it is the paper's, with the paper's numbers.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass

Count = Annotated[int, Field(strict=True, ge=1, le=2**40)]
CountFrom0 = Annotated[int, Field(strict=True, ge=0, le=2**40)]
FewFrom0 = Annotated[CountFrom0, Field(le=1_000)]
From0 = Annotated[float, Field(strict=True, ge=0.0, le=1e9, allow_inf_nan=False)]
Above0 = Annotated[From0, Field(ge=1e-9)]
Share = Annotated[From0, Field(le=1.0)]
ShareAbove0 = Annotated[Above0, Field(le=1.0)]
Power = Annotated[From0, Field(ge=1.0, le=1e3)]
CHECKED = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True, config=CHECKED)
class _Part:
    """A part of the parameters, checked on creation."""

    ASCENDING: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Pairs of fields of which the first must not exceed the second."""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for lower, upper in self.ASCENDING:
            low, high = getattr(self, lower), getattr(self, upper)
            if low > high:
                raise ValueError(f"{lower}: expected at most {upper}, {high}, got {low}")
        return self


@dataclass(frozen=True, slots=True, config=CHECKED)
class AnnealingParams(_Part):
    """The search of up to ``LargeParams.above`` segments, and of each region of larger instances."""

    batch: Count = 500
    """Iterations of a start between two checks of the stop rule; 500 take some milliseconds. Fewer react sooner to a
    stop rule; results are the same."""
    first_cycle: Count = 4_000
    """Iterations of the first cycle from hot to cold; each further cycle is twice as long. A longer one finds better
    plans if there is enough time, but nothing good before it ends."""
    first_cycle_leaving_out: Count = 500
    """The same, in iterations, if the first plan leaves something out, as after a loss.

    Finding room for the rest depends on luck as much as on length: with several short cycles the slowest hundredth of
    all re-plans takes half the time that it takes with one long first cycle.
    """
    hot: Above0 = 6.0
    """Start temperature of a cycle, in mean transits of the plan. A hotter one forgets more of the plan."""
    cold: Above0 = 0.01
    """End temperature of a cycle, in mean transits. A colder one accepts no worse plan at the end."""
    prize_weight: Above0 = 2.0
    """Cost of leaving a segment out in the search, in energies of a route through this segment only."""
    slack: Share = 0.1
    """Amount by which a soft annealing may temporarily exceed budgets, as a share of them; no result does."""
    excess_weight: From0 = 1.0
    """Additional cost of a percent beyond a budget in a soft annealing, in percent."""
    powers: Annotated[tuple[Power, ...], Field(min_length=1)] = (8.0, 16.0, 32.0)
    """Exponents p of the p-norm that approximates MinMax, one for each stage of an annealing: a low p includes the
    second largest route, a high one hardly anything but the largest."""

    ASCENDING = (("cold", "hot"),)


@dataclass(frozen=True, slots=True, config=CHECKED)
class LargeParams(_Part):
    """The search of larger instances, region by region."""

    above: CountFrom0 = 500
    """Maximum number of segments for a search over all routes at once; above that no table of all moves is made. More
    need memory as their square."""
    region: Count = 300
    """Approximate number of segments in a region of at least two routes. Larger ones find better plans, later."""
    region_routes: Annotated[Count, Field(ge=2)] = 24
    """Maximum number of routes in a region."""
    spell: Count = 4_000
    """Iterations of a region at a time: one annealing."""
    hot: Above0 = 0.5
    """Start temperature of a spell, in mean transits. A low one keeps most of the plan."""


@dataclass(frozen=True, slots=True, config=CHECKED)
class ExactParams(_Part):
    """The proof of the best plan."""

    search_iterations: CountFrom0 = 3_000
    """Iterations of the search for the plan that bounds the cost from above. A better plan leaves fewer columns."""


@dataclass(frozen=True, slots=True, config=CHECKED)
class WindowSearchParams(_Part):
    """The search for the largest re-plan window: initial plans, then walks on the window itself."""

    minmax_searches: Annotated[Count, Field(le=1_000)] = 2
    """Searches for the MinMax plan, whose longest route is the reference."""
    minmax_iterations: CountFrom0 = 20_000
    """Iterations of each of these searches."""
    other_searches: FewFrom0 = 8
    """Searches for the other costs before the first walk; another follows whenever a walk has long found nothing."""
    other_iterations: CountFrom0 = 10_000
    """Iterations of each of these searches."""
    full_effort_from: Count = 40
    """Number of segments below which searches for initial plans are shorter, in proportion."""
    most_flipped: Annotated[CountFrom0, Field(le=16)] = 6
    """Maximum number of vehicles for which all orientations of the routes are tried: 2 to the power of their number."""
    probes: Annotated[Count, Field(ge=2, le=256)] = 8
    """Times at which a walk evaluates losses: the aim, and those at which windows broke although the aim held. More
    cost time in each iteration and are wrong less often."""
    look: Count = 1_000
    """Iterations of ruin and recreate per loss when a plan's whole window is evaluated."""
    follow: Count = 20
    """The same in a walk, where the repair follows another one."""
    whole_look: Count = 25
    """Iterations that the evaluation of a whole window counts as, so that the stop rule is checked often enough."""
    batch: Count = 250
    """Iterations of each walk between two checks of the stop rule, when walks share their results."""
    cycle: Count = 4_000
    """Minimum iterations of a walk from hot to cold: every second failed round of steps is followed by one of cycles
    four times as long, every fourth by one of cycles sixteen times as long, and so on. Small fleets need many restarts,
    large ones long walks (after Luby, Sinclair, Zuckerman 1993)."""
    longest_cycle: Count = 256_000
    """Maximum iterations of a walk from hot to cold."""
    ways: Annotated[tuple[tuple[Share, Share], ...], Field(min_length=1)] = ((0.0, 1.0), (0.8, 0.1))
    """Settings that cycles use in turn: (share of changes made early in the plan, share of repairs improved although
    the change does not affect their loss). The first setting optimises repairs if these are long, the second tries more
    plans."""
    hot: Above0 = 2.0
    """Start temperature of the shortest cycle, in mean transits of its plan; longer ones begin hotter."""
    cold: Above0 = 0.05
    """End temperature of a cycle, in mean transits."""
    nearly: From0 = 3.0
    """Mean transits that repairs may lack at the end of a cycle for a second attempt with more effort."""
    first_step: ShareAbove0 = 0.06
    """First step by which a walk aims below the earliest time so far, as a share of the longest route."""
    last_step: ShareAbove0 = 0.01
    """Smallest step, in the same unit: a longer step is halved."""
    rise: From0 = 0.03
    """Maximum energy increase from one plan to the next, as a share of the first plan's energy."""
    elite: Count = 4
    """Number of best plans so far from which walks begin in turn."""
    finalists: Count = 4
    """Number of best plans whose windows are fully computed at the end."""
    front_round: Count = 150_000
    """Iterations for each stretch in the first round of ``front``; each further round has half as many again."""

    ASCENDING = (("cold", "hot"), ("cycle", "longest_cycle"), ("last_step", "first_step"))


@dataclass(frozen=True, slots=True, config=CHECKED)
class CoverageParams(_Part):
    """The search for the largest probability of a complete inspection; what is not here is as for the window."""

    window_iterations: CountFrom0 = 80_000
    """Iterations of the search for the window that gives the first plans, other costs included."""
    other_searches: FewFrom0 = 4
    """Searches for other costs in it."""
    initial: Count = 8
    """Number of its plans from which the walks begin."""
    probes: Annotated[Count, Field(ge=2, le=256)] = 16
    """Times at which a walk evaluates losses. More cost time in each iteration and leave smaller gaps."""
    cycle: Count = 2_000
    """Iterations of a walk from hot to cold."""
    follow: Count = 5
    """Iterations of ruin and recreate of a repair in a walk. Losses without one cost most of the time."""
    ways: Annotated[tuple[tuple[Share, Share], ...], Field(min_length=1)] = ((0.0, 0.1), (0.8, 0.05))
    """As for the window."""
    base: From0 = 3.0
    """What every loss without a re-plan counts in a walk, in mean transits."""
    most: From0 = 20.0
    """Maximum of what a re-plan lacks that counts in addition, in mean transits. A large one improves losses that are
    far from a re-plan, a small one those that are close to it."""
    look: Count = 300
    """Iterations of ruin and recreate per loss when a whole plan is evaluated."""
    finalists: Count = 3
    """Number of plans among which flights choose."""
    flights: Count = 1_000
    """Flights of each of them."""


@dataclass(frozen=True, slots=True, config=CHECKED)
class SearchParams:
    """All tuning parameters of the searches."""

    annealing: AnnealingParams = AnnealingParams()
    large: LargeParams = LargeParams()
    exact: ExactParams = ExactParams()
    window: WindowSearchParams = WindowSearchParams()
    coverage: CoverageParams = CoverageParams()

    @model_validator(mode="after")
    def _check_spells(self) -> Self:
        """Refuse spells of a region that would heat instead of cool."""
        if self.large.hot < self.annealing.cold:
            raise ValueError(
                f"large.hot: expected at least annealing.cold, {self.annealing.cold}, got {self.large.hot}"
            )
        return self


DEFAULT_PARAMS = SearchParams()
"""Default of every search."""
