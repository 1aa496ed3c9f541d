"""The table of windows against two losses: what is chosen, what it costs, and the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.machine import machine
from benchmarks.table.cells import PlanFigures
from benchmarks.table.pairs import ChosenPlan, PairCell, make_pairs, report_pairs
from benchmarks.table.settings import TableSettings


def found(earliest_s: float, longest_s: float) -> PlanFigures:
    return PlanFigures(100 * (longest_s - earliest_s) / longest_s, earliest_s, 0.0, longest_s, 80.0, feasible=True)


def chosen(stretch: float, losses: int, longest_s: float, one_s: float, two_s: float) -> ChosenPlan:
    return ChosenPlan(stretch, losses, 2.0, found(one_s, longest_s), found(two_s, longest_s))


CELL = PairCell(
    500.0, 18, 0.6, 90.0, 1000.0,
    (
        chosen(0.0, 1, 1000.0, 300.0, 800.0), chosen(0.05, 1, 1040.0, 200.0, 700.0),
        chosen(0.0, 2, 1000.0, 350.0, 600.0), chosen(0.2, 2, 1150.0, 250.0, 200.0),
    ),
)  # fmt: skip


def test_a_plan_counts_wherever_its_longest_route_is_short_enough() -> None:
    assert CELL.choose_plan(0.0, 1).one.earliest_s == 300
    assert CELL.choose_plan(0.05, 1).one.earliest_s == 200
    assert CELL.choose_plan(0.05, 2).two.earliest_s == 600
    assert CELL.choose_plan(0.2, 2).two.earliest_s == 200


def test_the_price_is_the_shortest_route_with_which_two_are_absorbed_as_early_as_one() -> None:
    assert CELL.price_s == 1150
    assert replace(CELL, plans=CELL.plans[:3]).price_s is None


def test_the_page_shows_both_plans_and_the_price() -> None:
    text = report_pairs([CELL], TableSettings(None, window_seconds=2.0), machine())
    assert "| 18 | 0.60 | 1000 | 200 | 1040 | 1150 | 10.6 |" in text
    assert "| 5 | 1040 | 200 | 700 | 1000 | 350 | 600 | 0 | 40.0 |" in text


def test_a_small_table_is_measured(tmp_path: Path) -> None:
    settings = TableSettings(None, radii_m=(400.0,), tightness=(0.6,), seeds=1, iterations=200)
    (cell,) = make_pairs(settings, tmp_path, jobs=1, fresh=False)
    for plan in cell.plans:
        assert plan.one.earliest_s <= plan.two.earliest_s + 1e-6
        assert plan.one.longest_s == plan.two.longest_s <= (1 + plan.stretch) * cell.minmax_s + 1e-6
        assert plan.two.certified_earliest_s <= plan.two.earliest_s + 1e-6
    for stretch in (0.0, 0.2):
        assert cell.choose_plan(stretch, 2).two.earliest_s <= cell.choose_plan(stretch, 1).two.earliest_s + 1e-6
    assert "## The price of a second loss" in (tmp_path / "pairs.md").read_text(encoding="utf-8")
