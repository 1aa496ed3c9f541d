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
    """A part of the parameters, checked when it is made."""

    ASCENDING: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Fields of which the first must not be more than the second."""

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
    """Iterations of a start between two questions to the stop rule, 500 take some milliseconds. Fewer answer a stop
    rule sooner; results are the same."""
    first_cycle: Count = 4_000
    """Iterations of the first cycle from hot to cold; each further cycle is twice as long. A longer one finds better
    plans where there is time for it, and nothing good before it ends."""
    first_cycle_leaving_out: Count = 500
    """The same, in iterations, where the first plan leaves something out, as after a loss.

    To find room for the rest is a question of luck as much as of length: several short cycles have the slowest
    hundredth of all re-plans in half the time that it takes with one long first cycle."""
    hot: Above0 = 6.0
    """Temperature at the begin of a cycle, in mean transits of the plan. A hotter one forgets more of the plan."""
    cold: Above0 = 0.01
    """Temperature at the end of a cycle, in mean transits. A colder one takes no worse plan at the end."""
    prize_weight: Above0 = 2.0
    """What leaving a segment out costs the search, in routes of this segment alone."""
    slack: Share = 0.1
    """How far beyond budgets a soft annealing may go on its way, as a share of them; no result does."""
    excess_weight: From0 = 1.0
    """What a percent beyond a budget costs a soft annealing besides itself, in percent."""
    powers: Annotated[tuple[Power, ...], Field(min_length=1)] = (8.0, 16.0, 32.0)
    """The p of the p-norm that stands for MinMax, one for each stage of an annealing: a low p sees the second largest
    route too, a high one hardly anything but the largest."""

    ASCENDING = (("cold", "hot"),)


@dataclass(frozen=True, slots=True, config=CHECKED)
class LargeParams(_Part):
    """The search of larger instances, region by region."""

    above: CountFrom0 = 500
    """Segments up to which all routes are searched at once; above that no table of all moves is made. More need memory
    as their square."""
    region: Count = 300
    """Segments of a region, about; two routes at least. Larger ones find better plans, later."""
    region_routes: Annotated[Count, Field(ge=2)] = 24
    """Routes of a region at most."""
    spell: Count = 4_000
    """Iterations that a region gets at a time: one annealing."""
    hot: Above0 = 0.5
    """Temperature at the begin of a spell, in mean transits. A low one keeps most of the plan."""


@dataclass(frozen=True, slots=True, config=CHECKED)
class ExactParams(_Part):
    """The proof of the best plan."""

    search_iterations: CountFrom0 = 3_000
    """Iterations of the search for the plan that bounds the cost from above. A better plan leaves fewer columns."""


@dataclass(frozen=True, slots=True, config=CHECKED)
class WindowSearchParams(_Part):
    """The search for the largest re-plan window: plans to begin with, then walks on the window itself."""

    minmax_searches: Annotated[Count, Field(le=1_000)] = 2
    """Searches for the MinMax plan, whose longest route is the measure."""
    minmax_iterations: CountFrom0 = 20_000
    """Iterations of each of them."""
    other_searches: FewFrom0 = 8
    """Searches for the other costs before the first walk; another follows whenever a walk has long found nothing."""
    other_iterations: CountFrom0 = 10_000
    """Iterations of each of them."""
    full_effort_from: Count = 40
    """Segments below which searches for plans to begin with are shorter, in proportion."""
    most_flipped: Annotated[CountFrom0, Field(le=16)] = 6
    """Vehicles up to which all orientations of the routes are tried: 2 to the power of their number."""
    probes: Annotated[Count, Field(ge=2, le=256)] = 8
    """Times at which losses are looked at in a walk: the aim, and those at which windows broke although the aim held.
    More cost time in each iteration and are wrong less often."""
    look: Count = 1_000
    """Iterations of ruin and recreate for a loss when a plan's whole window is looked at."""
    follow: Count = 20
    """The same in a walk, where the repair follows another."""
    whole_look: Count = 25
    """Iterations that a look at a whole window counts as, so that the stop rule is asked often enough."""
    batch: Count = 250
    """Iterations of each walk between two questions to the stop rule, when walks share what they found."""
    cycle: Count = 4_000
    """Iterations of a walk from hot to cold at least: every second round of steps in vain is followed by one of cycles
    four times as long, every fourth by one of cycles sixteen times as long, and so on. Small fleets need many
    beginnings, large ones long walks (after Luby, Sinclair, Zuckerman 1993)."""
    longest_cycle: Count = 256_000
    """The same at most."""
    ways: Annotated[tuple[tuple[Share, Share], ...], Field(min_length=1)] = ((0.0, 1.0), (0.8, 0.1))
    """How cycles go in turn: (how often a change is made early in the plan, how often a repair is worked on whose loss
    the change does not touch), as shares. The first brings repairs to their best where they are long, the second tries
    more plans."""
    hot: Above0 = 2.0
    """Temperature at the begin of the shortest cycle, in mean transits of its plan; longer ones begin hotter."""
    cold: Above0 = 0.05
    """Temperature at the end of a cycle, in mean transits."""
    nearly: From0 = 3.0
    """Mean transits that repairs may lack at the end of a cycle to be looked at once more, with more effort."""
    first_step: ShareAbove0 = 0.06
    """How far below the earliest time so far a walk aims at first, as a share of the longest route."""
    last_step: ShareAbove0 = 0.01
    """The same in the end: a step is halved while it is longer."""
    rise: From0 = 0.03
    """How much more energy a plan may use than the one before it, as a share of the first plan's."""
    elite: Count = 4
    """The best plans so far, from which walks begin in turn."""
    finalists: Count = 4
    """The best plans, whose windows are computed in full in the end."""
    front_round: Count = 150_000
    """Iterations for each stretch in the first round of ``front``; each further round has half as many again."""

    ASCENDING = (("cold", "hot"), ("cycle", "longest_cycle"), ("last_step", "first_step"))


@dataclass(frozen=True, slots=True, config=CHECKED)
class SearchParams:
    """All that the searches are tuned by."""

    annealing: AnnealingParams = AnnealingParams()
    large: LargeParams = LargeParams()
    exact: ExactParams = ExactParams()
    window: WindowSearchParams = WindowSearchParams()

    @model_validator(mode="after")
    def _check_spells(self) -> Self:
        """Refuse spells of a region that would heat instead of cool."""
        if self.large.hot < self.annealing.cold:
            raise ValueError(
                f"large.hot: expected at least annealing.cold, {self.annealing.cold}, got {self.large.hot}"
            )
        return self


DEFAULT_PARAMS = SearchParams()
"""What every search uses that is not told otherwise."""
