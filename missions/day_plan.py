"""The plan of days of many sorties: what its file holds, and the check of every figure from the file's own content."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from missions.errors import PlanFileError
from missions.flight_model import Base
from missions.geo import MAX_LATITUDE_DEG, FloatArray
from missions.plan_file import PlanContent, describe_area_conflicts, describe_wrong_figures
from missions.pricing import Pricing, build_priced_sorties
from missions.validation import Figure, From0, Id, Text
from planner import InstanceError
from planner.sorties import (
    LossWindow,
    Objective,
    SortieBase,
    SortieEvaluation,
    SortieInstance,
    SortiePlan,
    SortieVehicle,
    count_packs_needed,
    evaluate_sorties,
)

Window = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BasePlace:
    """A place where vehicles take off and land."""

    name: Text
    lat_deg: Annotated[Figure, Field(ge=-MAX_LATITUDE_DEG, le=MAX_LATITUDE_DEG)]
    lon_deg: Figure
    alt_m: Figure
    """Ground above mean sea level."""
    turnaround_s: From0 = 0.0
    """From a landing to the vehicle's next take-off."""
    packs: Id | None = None
    """Charged in the morning; without it there are always enough."""
    recharge_s: From0 | None = None
    """From a landing until the pack is charged; without it overnight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DayPlanFile(PlanContent):
    """What a plan of days says."""

    pricing: Pricing
    """As a single flight has it; its bases are the vehicles' own."""
    bases: tuple[BasePlace, ...]
    vehicles: tuple[SortieVehicle, ...]
    pads: tuple[tuple[Base, ...], ...]
    """For each vehicle its pad at each base."""
    days: tuple[Window, ...]
    transfer_s: FloatArray
    stagger_s: float
    plan: SortiePlan
    """Over positions in ``segments``, in the order of ``vehicles``."""
    evaluation: SortieEvaluation
    objective: Objective
    windows: tuple[LossWindow, ...] = ()
    """Until when each vehicle must not be lost; empty if nobody looked."""

    @property
    def cost_value(self) -> float:
        """What the plan was chosen by comes to: seconds, or a number of sorties."""
        found = self.evaluation
        values = {Objective.FINISH: found.finish_s, Objective.FLIGHT: found.flight_s, Objective.SWAPS: found.count}
        return float(values[self.objective])

    def build_instance(self) -> SortieInstance:
        """Return the planning problem over positions in ``segments``.

        Raises:
            PlanFileError: its content does not make one.
        """
        try:
            bases = [SortieBase(base.name, base.turnaround_s, base.packs, base.recharge_s) for base in self.bases]
            return build_priced_sorties(
                self.pricing, self.vehicles, self.pads, bases, self.days, self.transfer_s,
                stagger_s=self.stagger_s,
            )  # fmt: skip
        except InstanceError as error:
            raise PlanFileError(f"{self.source}: {error}") from error

    @property
    def count_packs(self) -> tuple[int, ...]:
        """Packs that each base needs, as ``count_packs_needed`` has it."""
        return count_packs_needed(self.build_instance(), self.plan, self.evaluation)

    def count_swaps(self, base: int) -> int:
        """Return how many sorties take a pack of a base."""
        return sum(one.base == base for own in self.plan.sorties for one in own)


def check_day_plan(content: DayPlanFile) -> list[str]:
    """Return in words every figure of a day plan that its own content does not bear out; empty if all is well.

    Recomputed are times, energies, packs, hours, take-offs and coverage; windows after losses are not searched anew.

    Raises:
        PlanFileError: its content makes no planning problem at all.
    """
    return list(_check_content(content))


def _check_content(content: DayPlanFile) -> Iterator[str]:
    computed, written = evaluate_sorties(content.build_instance(), content.plan), content.evaluation
    yield from describe_wrong_figures(
        (f"sortie {index} of {own.name}: {key}", *pair)
        for number, own in enumerate(content.vehicles)
        for key, mine, its in (
            ("duration_s", written.lasts_s[number], computed.lasts_s[number]),
            ("energy_pct", written.energies_pct[number], computed.energies_pct[number]),
        )
        for index, pair in enumerate(zip(mine, its, strict=True), 1)
    )
    yield from describe_wrong_figures(
        (key, getattr(written, key), getattr(computed, key)) for key in ("finish_s", "flight_s")
    )
    yield from computed.violations
    visits = (visit for own in content.plan.sorties for one in own for visit in one.visits)
    pads = ((own.name, content.pads[row][base]) for row, own in enumerate(content.vehicles) for base in own.lands)
    yield from describe_area_conflicts(content.pricing, content.segments, visits, pads)
