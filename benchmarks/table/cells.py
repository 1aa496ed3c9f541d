"""Cells of a table, and figures derived from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from statistics import fmean

from benchmarks.store import Json
from planner import Cost
from planner.evaluate import rank_window

NEAR_S = 1e-6
"""Times that differ by less are equal."""
LEAVES = 0.15
"""Share by which t* could be lowered for a bound to leave a possible gain."""


@dataclass(frozen=True, slots=True)
class PlanFigures:
    """The figures of one plan."""

    window_pct: float
    earliest_s: float
    """t*."""
    certified_earliest_s: float
    """Lower bound of the begin of this plan's window."""
    longest_s: float
    longest_pct: float
    feasible: bool
    """Whether everything is inspected within the budgets; any other plan's window is empty."""

    @property
    def rank(self) -> tuple[float, float]:
        """What plans within a limit on the longest route are chosen by, the best first."""
        return rank_window(self.earliest_s, self.longest_s)

    def dominates(self, other: PlanFigures) -> bool:
        """Return whether this plan has no later t* and no longer longest route than another, and is better in one."""
        no_worse = self.earliest_s <= other.earliest_s + NEAR_S and self.longest_s <= other.longest_s + NEAR_S
        return no_worse and self.rank != other.rank

    @classmethod
    def from_content(cls, content: Json) -> PlanFigures:
        """Read the figures of a result."""
        return cls(**{field.name: content[field.name] for field in fields(cls)})


@dataclass(frozen=True, slots=True)
class Series:
    """Plans of one solver with one cost function, one per seed."""

    solver: str
    cost: str
    plans: tuple[PlanFigures, ...]

    @property
    def best(self) -> PlanFigures:
        """Plan with the largest window; the earliest one of equals."""
        return max(self.plans, key=lambda plan: (plan.window_pct, -plan.earliest_s))

    @property
    def best_earliest_s(self) -> float:
        """Least t* of all plans."""
        return min(plan.earliest_s for plan in self.plans)

    @property
    def mean_window_pct(self) -> float:
        """Mean over all seeds."""
        return fmean(plan.window_pct for plan in self.plans)

    @property
    def mean_earliest_s(self) -> float:
        """Mean over all seeds."""
        return fmean(plan.earliest_s for plan in self.plans)


@dataclass(frozen=True, slots=True)
class Stretched:
    """A plan chosen for its window."""

    stretch: float
    """Longest route's length relative to that of the best MinMax plan, minus 1."""
    plan: PlanFigures


@dataclass(frozen=True, slots=True)
class Against:
    """The best MinComb plan of a solver, and a plan chosen for its window that takes no longer."""

    solver: str
    mincomb: PlanFigures
    """Best by its window, over all seeds."""
    chosen: Stretched
    """At the MinComb plan's stretch."""
    least_earliest_s: float
    """Lower bound of the begin of any plan's window."""

    @property
    def earlier(self) -> bool:
        """Whether the plan chosen for its window tolerates an earlier loss than the MinComb plan."""
        return self.chosen.plan.earliest_s < self.mincomb.earliest_s - NEAR_S

    @property
    def window_pct(self) -> float:
        """Its window as a share of the MinComb plan's longest route, so that percent and seconds agree."""
        longest_s = self.mincomb.longest_s
        return 100.0 * (longest_s - self.chosen.plan.earliest_s) / longest_s

    @property
    def dominating(self) -> str:
        """Which plan dominates the other: `window`, `MinComb`, or `-` for neither."""
        chosen, mincomb = self.chosen.plan, self.mincomb
        return "window" if chosen.dominates(mincomb) else "MinComb" if mincomb.dominates(chosen) else "-"

    @property
    def reduction(self) -> float:
        """Reduction of t*, as a share of the MinComb plan's."""
        theirs = self.mincomb.earliest_s
        return 0.0 if theirs <= NEAR_S else 1.0 - self.chosen.plan.earliest_s / theirs

    @property
    def most_reduction(self) -> float:
        """Maximum reduction that the bound permits."""
        theirs = self.mincomb.earliest_s
        return 0.0 if theirs <= NEAR_S else max(0.0, 1.0 - self.least_earliest_s / theirs)

    @property
    def settled(self) -> bool:
        """Whether the MinComb plan reaches the bound: no gain is possible."""
        return self.mincomb.earliest_s <= self.least_earliest_s + NEAR_S


@dataclass(frozen=True, slots=True)
class Cell:
    """One radius with one budget."""

    radius_m: float
    segments: int
    tightness: float
    c_max_pct: float
    minmax_s: float
    """The longest route of the best MinMax plan."""
    series: tuple[Series, ...]
    windows: tuple[Stretched, ...]
    """At the fixed stretches."""
    against: tuple[Against, ...]
    """For each solver, its best MinComb plan against one chosen for its window."""
    least_earliest_s: float
    """Lower bound of the begin of any plan's window."""

    def versus(self, solver: str) -> Against:
        """Return the comparison with a solver's MinComb plans."""
        return next(one for one in self.against if one.solver == solver)


@dataclass(frozen=True, slots=True)
class Summary:
    """Summary of the comparisons with one solver's MinComb plans."""

    solver: str
    cells: int
    earlier: int
    """Cells where the plan chosen for its window has an earlier t* than the best MinComb plan at the same stretch."""
    dominates: int
    """Cells where it dominates the MinComb plan: in none of t* and longest route worse, in one better."""
    dominated: int
    """Cells where the MinComb plan dominates it."""
    settled: int
    """Cells where no gain is possible."""
    open: int
    """Cells where the bound leaves at least LEAVES."""
    mean_reduction: float | None
    """Mean reduction of t* over those; None if there are none."""


def summary_of(cells: Sequence[Cell], solver: str) -> Summary:
    """Return the figures of a table against a solver's MinComb plans."""
    against = [cell.versus(solver) for cell in cells]
    still_open = [one for one in against if one.most_reduction >= LEAVES]
    return Summary(
        solver=solver,
        cells=len(against),
        earlier=sum(one.earlier for one in against),
        dominates=sum(one.dominating == "window" for one in against),
        dominated=sum(one.dominating == "MinComb" for one in against),
        settled=sum(one.settled for one in against),
        open=len(still_open),
        mean_reduction=fmean(one.reduction for one in still_open) if still_open else None,
    )


def best_mincomb(series: Sequence[Series], solver: str) -> PlanFigures:
    """Return a solver's best MinComb plan by its window."""
    return next(one.best for one in series if (one.cost, one.solver) == (Cost.MINCOMB.value, solver))
