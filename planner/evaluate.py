"""The definition of every figure of a plan, what it is chosen by, and what a solver gives back.

It is slow, obvious, and what the kernels must agree with. The cost functions are those of the paper.
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
    """The cost function's, in percent of a full battery."""
    durations_s: tuple[float, ...]
    energies_pct: tuple[float, ...]
    longest_route_s: float
    violations: tuple[str, ...]
    """In words; empty if every segment is inspected or named as uncovered, within all budgets."""


def compute_legs_s(instance: Instance, route: Route) -> list[float]:
    """Return the seconds to each visit's end, and then home; of a route without a visit its vehicle's way home.

    Raises:
        PlanError: the vehicle or a visit is not in the instance.
    """
    number, visits = _check_known(instance, route)
    if not visits:
        return [float(instance.idle_s[number])]
    moves_s = instance.moves.seconds(instance.profile[number], visits[:-1], visits[1:]).tolist()
    return [float(instance.start_s[number, visits[0]]), *moves_s, float(instance.home_s[number, visits[-1]])]


def compute_legs_pct(instance: Instance, route: Route) -> list[float]:
    """Return the percent of a full battery that the same legs use.

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
    """Return a route's vehicle and visits, if the instance has them."""
    if not 0 <= route.vehicle < len(instance.vehicles):
        raise PlanError(f"route of vehicle {route.vehicle}, the instance has {len(instance.vehicles)}")
    for visit in route.visits:
        if not 0 <= visit < 2 * instance.segments:
            raise PlanError(f"visit {visit} is not in the instance of {instance.segments} segments")
    return route.vehicle, list(route.visits)


def route_duration_s(instance: Instance, route: Route) -> float:
    """Return how long a route takes, landing place reached; of a route without a visit, the vehicle's way home."""
    return sum(compute_legs_s(instance, route))


def route_energy_pct(instance: Instance, route: Route) -> float:
    """Return what a route uses, c(T), in percent of a full battery."""
    return sum(compute_legs_pct(instance, route))


def completion_times_s(instance: Instance, route: Route) -> tuple[float, ...]:
    """Return when each visit ends, in seconds from the route's start."""
    return tuple(accumulate(compute_legs_s(instance, route)[:-1]))


def cost_of(instance: Instance, energies_pct: Sequence[float], cost: Cost) -> float:
    """Return the paper's cost of routes that use ``energies_pct``, one for each vehicle."""
    return cost.function.value(energies_pct, [vehicle.budget_pct for vehicle in instance.vehicles])


def evaluate(instance: Instance, plan: Plan, cost: Cost) -> Evaluation:
    """Return all figures of a plan.

    Visits that the instance does not have are violations and count for nothing else.

    Raises:
        PlanError: the plan has not one route for each vehicle.
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
"""k_c of the paper: the weight of what a tour spends beyond its budget."""
BUDGET_TOLERANCE_PCT = 1e-6
"""A route spends more than its budget when it does so by more than this: sums depend on their order."""


def budget_excess_pct(energy_pct: float, budget_pct: float) -> float:
    """Return what a route uses beyond its budget."""
    over = energy_pct - budget_pct
    return over if over > BUDGET_TOLERANCE_PCT else 0.0


@dataclass(frozen=True, slots=True)
class CostFunction:
    """total * sum(c(T) + excess * max(0, c(T) - budget)) + peak * max c(T).

    c(T) is a route's energy in percent of a full battery. Whatever searches reads its weights from here, so that
    another cost is another row below.
    """

    total: float
    """Weight of what all routes use; 0 if only the longest counts."""
    peak: float
    """Weight of the longest route."""
    shared_peak: bool
    """Whether that weight is divided by the number of vehicles."""
    excess: float
    """Weight of what a route uses beyond its budget, beside what it uses."""

    @property
    def is_longest_only(self) -> bool:
        """Return whether nothing but the longest route counts."""
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
    """What a plan is chosen by, by its name in plan files."""

    MINMAX = "minmax"
    MINSUM = "minsum"
    MINCOMB = "mincomb"

    @property
    def function(self) -> CostFunction:
        """Return what it computes."""
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
    """The best plan found, with its figures from the definition, and how the search went."""

    plan: Plan
    evaluation: Evaluation
    feasible: bool
    """Whether every segment is inspected and no budget exceeded."""
    iterations: int
    seconds: float
    stopped_by: str
    """The stop rule's reason."""
    impossible: str | None = None
    """Why no plan can cover everything, where that is certain; None where it is not."""
    bound: float | None = None
    """What no plan of as much covered value and as many flying vehicles can cost less than, where that was proved."""


@dataclass(frozen=True, slots=True)
class CriticalLoss:
    """A loss: one vehicle, at any time of one interval between completions."""

    vehicle: int
    from_s: float
    """The interval holds this time..."""
    to_s: float
    """...but not this one."""


@dataclass(frozen=True, slots=True)
class ReplanWindow:
    """From when on the fleet can absorb any one loss."""

    earliest_s: float
    """t*: from here to the end of the longest route every loss has a re-plan; 0 for a full window."""
    certified_earliest_s: float
    """No window of this plan begins earlier: the end of the latest interval with a loss that nothing repairs."""
    longest_route_s: float
    breaking: CriticalLoss | None
    """The loss just before ``earliest_s`` that has no re-plan; None for a full window."""

    @property
    def window_pct(self) -> float:
        """The window as a share of the longest route's time."""
        return self._share_pct(self.earliest_s)

    @property
    def certified_window_pct(self) -> float:
        """No window of this plan is larger."""
        return self._share_pct(self.certified_earliest_s)

    def _share_pct(self, earliest_s: float) -> float:
        if self.longest_route_s <= 0:
            return 100.0
        return 100.0 * ((self.longest_route_s - earliest_s) / self.longest_route_s)


@dataclass(frozen=True, slots=True)
class WindowResult(Result):
    """The plan with the largest window found; its value is MinMax, and feasible is no route longer than allowed."""

    window: ReplanWindow = field(kw_only=True)
    """As ``replan_window`` computes it."""


class RepairStatus(Enum):
    """What is known of a loss."""

    FEASIBLE = "feasible"
    """A re-plan was found and checked."""
    IMPOSSIBLE = "impossible"
    """It is certain that there is none."""
    NOT_FOUND = "not found"
    """None was found, and it is not certain that there is none."""


@dataclass(frozen=True, slots=True)
class LossRow(CriticalLoss):
    """What is known of it."""

    verdict: RepairStatus
    plan: Plan | None
    """The re-plan, for ``remaining(instance, plan, vehicle, from_s).instance``; None if there is none."""
