"""Reference definitions of a plan's figures, the cost functions, and the results of the solvers.

Slow and simple: the kernels must match them. The cost functions are those of the paper.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import accumulate
from types import MappingProxyType

from planner.errors import PlanError
from planner.model import Instance, Plan, Route, segment_of


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The figures of one plan."""

    value: float
    """Value of the cost function, in percent of a full battery."""
    durations_s: tuple[float, ...]
    energies_pct: tuple[float, ...]
    longest_route_s: float
    violations: tuple[str, ...]
    """Violations in words; empty if every segment is inspected or listed as uncovered, within all budgets."""


def compute_legs_s(instance: Instance, route: Route) -> list[float]:
    """Return the seconds to the end of each visit, then of the return leg; for a route without a visit, the idle time.

    Raises:
        PlanError: the vehicle or a visit is not in the instance.
    """
    number, visits = _check_known(instance, route)
    if not visits:
        return [float(instance.idle_s[number])]
    moves_s = instance.moves.seconds(instance.profile[number], visits[:-1], visits[1:]).tolist()
    return [float(instance.start_s[number, visits[0]]), *moves_s, float(instance.home_s[number, visits[-1]])]


def compute_legs_pct(instance: Instance, route: Route) -> list[float]:
    """Return the energy of the same legs, in percent of a full battery.

    Raises:
        PlanError: the vehicle or a visit is not in the instance.
    """
    number, visits = _check_known(instance, route)
    if not visits:
        return [float(instance.idle_pct[number])]
    moves_pct = instance.moves.pct(instance.profile[number], visits[:-1], visits[1:])
    between_pct = (instance.vehicles[number].consumption * moves_pct).tolist()
    return [float(instance.start_pct[number, visits[0]]), *between_pct, float(instance.home_pct[number, visits[-1]])]


def _check_known(instance: Instance, route: Route) -> tuple[int, list[int]]:
    """Return a route's vehicle and visits; check that the instance has them."""
    if not 0 <= route.vehicle < len(instance.vehicles):
        raise PlanError(f"route of vehicle {route.vehicle}, the instance has {len(instance.vehicles)}")
    for visit in route.visits:
        if not 0 <= visit < 2 * instance.segments:
            raise PlanError(f"visit {visit} is not in the instance of {instance.segments} segments")
    return route.vehicle, list(route.visits)


def route_duration_s(instance: Instance, route: Route) -> float:
    """Return the duration of a route up to the landing; for a route without a visit, the vehicle's idle time."""
    return sum(compute_legs_s(instance, route))


def route_energy_pct(instance: Instance, route: Route) -> float:
    """Return the energy of a route, c(T), in percent of a full battery."""
    return sum(compute_legs_pct(instance, route))


def completion_times_s(instance: Instance, route: Route) -> tuple[float, ...]:
    """Return the end time of each visit, in seconds from the route's start."""
    return tuple(accumulate(compute_legs_s(instance, route)[:-1]))


def cost_of(instance: Instance, energies_pct: Sequence[float], cost: Cost) -> float:
    """Return the paper's cost of routes with these energies, one for each vehicle."""
    return cost.function.value(energies_pct, [vehicle.budget_pct for vehicle in instance.vehicles])


def evaluate(instance: Instance, plan: Plan, cost: Cost) -> Evaluation:
    """Return all figures of a plan.

    Visits that the instance does not have are violations and are otherwise ignored.

    Raises:
        PlanError: the plan does not have one route for each vehicle.
    """
    if [route.vehicle for route in plan.routes] != list(range(len(instance.vehicles))):
        raise PlanError(f"the plan has {len(plan.routes)} routes, the instance {len(instance.vehicles)} vehicles")
    known = Plan(tuple(
        Route(route.vehicle, tuple(visit for visit in route.visits if 0 <= segment_of(visit) < instance.segments))
        for route in plan.routes
    ))  # fmt: skip
    durations = tuple(route_duration_s(instance, route) for route in known.routes)
    energies = tuple(route_energy_pct(instance, route) for route in known.routes)
    return Evaluation(
        value=cost_of(instance, energies, cost),
        durations_s=durations,
        energies_pct=energies,
        longest_route_s=max(durations),
        violations=tuple(_find_violations(instance, plan, energies)),
    )


def _find_violations(instance: Instance, plan: Plan, energies_pct: tuple[float, ...]) -> Iterator[str]:
    for vehicle, energy in zip(instance.vehicles, energies_pct, strict=True):
        if budget_excess_pct(energy, vehicle.budget_pct) > 0:
            yield f"{vehicle.name} spends {energy:.3f} % of its budget of {vehicle.budget_pct:.3f} %"
    accounted = {segment_of(visit) for route in plan.routes for visit in route.visits} | set(plan.uncovered)
    for segment in sorted(accounted - set(range(instance.segments))):
        yield f"segment {segment} is not in the instance"
    for segment in sorted(set(range(instance.segments)) - accounted):
        yield f"segment {segment} is neither visited nor named as uncovered"


K_C = 1000.0
"""k_c of the paper: the weight of a tour's energy beyond its budget."""
BUDGET_TOLERANCE_PCT = 1e-6
"""A route exceeds its budget only by more than this: sums depend on the order of addition."""

RANK_DIGITS = 6
"""Decimals of the seconds by which windows are compared: sums depend on the order of addition."""


def budget_excess_pct(energy_pct: float, budget_pct: float) -> float:
    """Return the energy of a route beyond its budget."""
    over = energy_pct - budget_pct
    return over if over > BUDGET_TOLERANCE_PCT else 0.0


@dataclass(frozen=True, slots=True)
class CostFunction:
    """total * sum(c(T) + excess * max(0, c(T) - budget)) + peak * max c(T).

    c(T) is a route's energy in percent of a full battery. All searches read the weights from here, so a new cost is a
    new row below.
    """

    total: float
    """Weight of the total energy of all routes; 0 if only the longest counts."""
    peak: float
    """Weight of the longest route."""
    shared_peak: bool
    """Whether to divide that weight by the number of vehicles."""
    excess: float
    """Additional weight of a route's energy beyond its budget."""

    @property
    def is_longest_only(self) -> bool:
        """Return whether only the longest route counts."""
        return self.total == 0

    def peak_weight(self, vehicles: int) -> float:
        """Return the weight of the longest route for a fleet."""
        return self.peak / vehicles if self.shared_peak else self.peak

    def value(self, energies_pct: Sequence[float], budgets_pct: Sequence[float]) -> float:
        """Return the cost of routes, one energy and one budget for each vehicle."""
        longest = max(energies_pct)
        peak = self.peak * longest / (len(energies_pct) if self.shared_peak else 1)
        if self.is_longest_only:
            return peak
        routes = zip(energies_pct, budgets_pct, strict=True)
        soft_sum = sum(energy + self.excess * budget_excess_pct(energy, budget) for energy, budget in routes)
        return self.total * soft_sum + peak


class Cost(Enum):
    """The cost function of a plan, by its name in plan files."""

    MINMAX = "minmax"
    MINSUM = "minsum"
    MINCOMB = "mincomb"

    @property
    def function(self) -> CostFunction:
        """Return the cost function."""
        return FUNCTIONS[self]


FUNCTIONS: Mapping[Cost, CostFunction] = MappingProxyType({
    Cost.MINMAX: CostFunction(total=0.0, peak=1.0, shared_peak=False, excess=0.0),
    # c-MinSum of the paper
    Cost.MINSUM: CostFunction(total=1.0, peak=0.0, shared_peak=False, excess=K_C),
    # c-MinSum + MinMax / number of vehicles
    Cost.MINCOMB: CostFunction(total=1.0, peak=1.0, shared_peak=True, excess=K_C),
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Result:
    """The best plan found, with its reference figures, and details of the search."""

    plan: Plan
    evaluation: Evaluation
    feasible: bool
    """Whether every segment is inspected and no budget exceeded."""
    iterations: int
    seconds: float
    stopped_by: str
    """Reason given by the stop rule."""
    impossible: str | None = None
    """Proven reason why no plan can cover everything; None if not proven."""
    bound: float | None = None
    """Proven lower bound on the cost of plans with the same covered value and number of flying vehicles, if any."""


@dataclass(frozen=True, slots=True)
class CriticalLoss:
    """A loss: one vehicle, at any time of one interval between completions."""

    vehicle: int
    from_s: float
    """Start of the interval, included."""
    to_s: float
    """End of the interval, excluded."""


@dataclass(frozen=True, slots=True)
class ReplanWindow:
    """The time from which the fleet can absorb any one loss, or any two."""

    earliest_s: float
    """t*: from here on every loss has a re-plan; 0 for a full window."""
    certified_earliest_s: float
    """Lower bound on t* for this plan: the end of the latest interval with a loss that is proven irreparable."""
    longest_route_s: float
    breaking: CriticalLoss | None
    """The loss just before ``earliest_s`` that has no re-plan; None for a full window."""
    losses: int = 1
    """Number of vehicles that may be lost: 1, or 2 one after the other or at once."""
    then: CriticalLoss | None = None
    """The second loss that has no re-plan after ``breaking``; None if ``breaking`` alone has none."""

    @property
    def window_pct(self) -> float:
        """The window as a share of the longest route's duration."""
        return self._share_pct(self.earliest_s)

    @property
    def certified_window_pct(self) -> float:
        """Upper bound on the window of this plan."""
        return self._share_pct(self.certified_earliest_s)

    def _share_pct(self, earliest_s: float) -> float:
        if self.longest_route_s <= 0:
            return 100.0
        return 100.0 * ((self.longest_route_s - earliest_s) / self.longest_route_s)


def rank_window(earliest_s: float, longest_route_s: float) -> tuple[float, float]:
    """Return what windows are compared by, the best first: t*, and of equal t* the shorter longest route.

    Among plans within a limit on the longest route, the first in rank is never worse than one whose longest route is no
    longer: its t* is not later, so neither is its window the smaller share of its longest route. A plan with a longer
    route and a later t* may still have the larger percentage, and is beaten in both figures that a crew plans with.
    """
    return round(earliest_s, RANK_DIGITS), round(longest_route_s, RANK_DIGITS)


@dataclass(frozen=True, slots=True)
class WindowResult(Result):
    """The plan with the largest window found; its value is MinMax, feasible means no route is longer than allowed."""

    window: ReplanWindow = field(kw_only=True)
    """The window as ``replan_window`` computes it."""


class RepairStatus(Enum):
    """Result of the search for a re-plan of a loss."""

    FEASIBLE = "feasible"
    """A re-plan was found and checked."""
    IMPOSSIBLE = "impossible"
    """It is certain that there is none."""
    NOT_FOUND = "not found"
    """None was found, but one may exist."""


@dataclass(frozen=True, slots=True)
class LossRow(CriticalLoss):
    """A loss and the result of its re-plan search."""

    verdict: RepairStatus
    plan: Plan | None
    """The re-plan, for ``remaining(instance, plan, vehicle, from_s).instance``; None if none was found."""
