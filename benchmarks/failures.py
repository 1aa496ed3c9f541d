"""`faultline bench failures`: public scenarios of successive vehicle losses, against the published figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.errors import BenchError
from benchmarks.least import SAME, least_value
from benchmarks.machine import cores
from benchmarks.scenario import Scenario, day_of, initial_timelines, read_scenario, solution_of, wrong_with
from benchmarks.scenarios import open_tasks, replan_losses
from benchmarks.store import Json
from benchmarks.warm_sorties import warm_up_sorties
from planner import NoImprovement, Plan, Route, Seconds, StopRule, combine_stop_rules
from planner.sorties import SortieInstance, solve_sorties

FOLDER = "failures"
LONG_ENOUGH = 100_000
"""Iterations without a better plan after which a re-plan's search ends."""


@dataclass(frozen=True, slots=True)
class SolvedScenario:
    """One scenario's answer."""

    scenario: Scenario
    value_s: float
    """End of the last trip that counts."""
    replan_s: tuple[float, ...]
    """Time from each loss to the plan after it."""
    left: int
    """Required edges on no trip that counts."""
    least_s: float | None
    """Lower bound of any answer's value, if requested."""
    wrong: tuple[str, ...]
    solution: Json

    @property
    def row(self) -> Json:
        """Its figures."""
        return {
            "name": self.scenario.name,
            "value": self.value_s,
            "published": self.scenario.published.after,
            "replan_s": [round(seconds, 4) for seconds in self.replan_s],
            "published_s": self.scenario.published.seconds,
            "losses": len(self.replan_s),
            "left": self.left,
            "least": self.least_s,
            "wrong": list(self.wrong),
        }


def stop_after(seconds: float) -> StopRule:
    """Return when a re-plan's search ends."""
    return combine_stop_rules(Seconds(seconds), NoImprovement(LONG_ENOUGH))


def solve_scenario(scenario: Scenario, stop: StopRule, seed: int, prove_s: float | None = None) -> SolvedScenario:
    """Evaluate a scenario's day: at each loss a new plan, from the information at that time.

    Args:
        scenario: the day and its losses.
        stop: when the search of a re-plan ends.
        seed: of the searches.
        prove_s: seconds for proving a lower bound afterwards; None for no proof.
    """
    starts = cores()
    warm_up_sorties(starts)
    day = day_of(scenario)
    first = initial_timelines(scenario, day)
    took: list[float] = []

    def solve(instance: SortieInstance, tails: Sequence[Route]) -> Plan:
        return solve_sorties(instance, stop=stop, seed=seed, starts=starts, initial=tails).plan

    history = replan_losses(day, first, [(one.vehicle - 1, one.at) for one in scenario.losses], solve, took.append)
    entries = (first, *history)
    return SolvedScenario(
        scenario=scenario,
        value_s=max((trip.end_s for own in entries[-1] for trip in own), default=0.0),
        replan_s=tuple(took),
        left=len(open_tasks(day, entries[-1])),
        least_s=None if prove_s is None else least_value(scenario, prove_s),
        wrong=tuple(wrong_with(scenario, day, entries)),
        solution=solution_of(scenario, entries),
    )


def scenario_files(data: Path, family: str = "*") -> list[Path]:
    """Return the scenarios in a directory of the data, of one family or all, by family and number.

    Raises:
        BenchError: there is none.
    """
    files = sorted((data / FOLDER).glob(f"{family}.*json"), key=_order)
    if not files:
        raise BenchError(f"{data / FOLDER}: expected failure scenarios ({family}.*json)")
    return files


def _order(path: Path) -> tuple[str, int, str]:
    family, _, number = path.stem.partition(".")
    return family, int(number) if number.isdigit() else 0, path.stem


def solve_all(
    files: list[Path], seconds: float, seed: int, told: Callable[[int, int], None], prove_s: float | None = None
) -> list[Json]:
    """Return the figures of each scenario."""
    rows: list[Json] = []
    for done, path in enumerate(files):
        told(done, len(files))
        rows.append(solve_scenario(read_scenario(path), stop_after(seconds), seed, prove_s).row)
    told(len(files), len(files))
    return rows


def families(rows: list[Json]) -> list[Json]:
    """Return the figures of each family: the part of a name before the point."""
    names = dict.fromkeys(row["name"].partition(".")[0] for row in rows)
    return [_family(name, [row for row in rows if row["name"].partition(".")[0] == name]) for name in names]


def _family(name: str, rows: list[Json]) -> Json:
    known = [row for row in rows if row["published"] is not None]
    took = [seconds for row in rows for seconds in row["replan_s"]]
    proven = [row for row in rows if row["least"] is not None]
    published_s = [row["published_s"] for row in rows if row["published_s"] is not None]
    return {
        "family": name,
        "scenarios": len(rows),
        "valid": sum(not row["wrong"] and not row["left"] for row in rows),
        "compared": len(known),
        "not_longer": sum(row["value"] <= row["published"] + 1e-9 for row in known),
        "sum": sum(row["value"] for row in known),
        "published_sum": sum(row["published"] for row in known),
        "proven": len(proven),
        "least_possible": sum(row["value"] <= row["least"] + SAME for row in proven),
        "least_sum": sum(row["least"] for row in proven if row["published"] is not None),
        "replan_median_s": median(took) if took else None,
        "replan_max_s": max(took, default=None),
        "published_median_s": median(published_s) if published_s else None,
        "published_max_s": max(published_s, default=None),
    }
