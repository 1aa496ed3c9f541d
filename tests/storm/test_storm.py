"""A storm is the same again with its seed, finds what must not be, and shrinks it; a small one is clean.

`./scripts/storm` flies thousands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say
from tests.stories.judge import Finding
from tests.storm.__main__ import digest
from tests.storm.compose import KINDS, composed
from tests.storm.judge import findings
from tests.storm.plot import GROUND, Happening, Plot, from_json
from tests.storm.shrink import shrunk, sign
from tests.storm.sky import Stormed, fly
from tests.storm.table import Table

CALM = Plot(1, "px4", "line", {"uav1": (0, 2), "uav2": (4,)})
CRASH = Happening("crash", "uav2", 17.3)


def rules(stormed: Stormed) -> set[str]:
    return {finding.rule for finding in findings(stormed)}


def lied(
    stormed: Stormed, *, inspected: Mapping[int, str] | None = None, said: str = "", at_s: float = 40.0
) -> Stormed:
    """Return a flight whose ground station believed, or said, something else."""
    flown = stormed.flown
    lines = (*flown.said, (at_s, Say(Level.INFO, said))) if said else flown.said
    return replace(stormed, flown=replace(flown, inspected=inspected or flown.inspected, said=lines))


def test_a_seed_is_the_same_story_and_the_same_flight_again() -> None:
    plot = next(plot for plot in map(composed, range(50, 150)) if len(plot.happenings) == 3 and len(plot.routes) == 2)
    assert composed(plot.seed) == plot
    assert from_json(plot.to_json()) == plot
    assert digest(fly(plot)) == digest(fly(from_json(plot.to_json())))


def test_everything_that_may_happen_is_drawn() -> None:
    assert {one.kind for seed in range(2000) for one in composed(seed).happenings} == set(KINDS)


def test_a_calm_flight_is_clean_and_what_is_not_so_is_seen() -> None:
    calm = fly(CALM)
    assert findings(calm) == []
    assert set(calm.flown.inspected) == {0, 1, 2}
    # uav2 flew the third segment, and nobody flew that for uav1.
    assert rules(lied(calm, inspected={**calm.flown.inspected, 2: "uav1"})) == {"inspected"}
    assert rules(lied(calm, said="uav1: landed with 90 %")) == {"line"}
    assert rules(lied(calm, said="uav2: with its pilot, mode HOLD")) == {"line"}
    assert rules(lied(calm, said="internal error at Tick: KeyError: 'uav9'")) == {"mistake"}
    assert rules(replace(calm, mistakes=("the task died",))) == {"traceback"}
    assert rules(replace(calm, shown={"uav1": "landed", "uav2": "flying"})) == {"unknown"}
    assert rules(replace(calm, flown=replace(calm.flown, ended_s=None))) == {"ends"}


def test_a_flight_that_ends_with_a_vehicle_in_the_air_is_detected() -> None:
    left = fly(replace(CALM, happenings=(Happening("ctrl-c", GROUND, 30.0, word="once"),)))
    assert left.left
    assert findings(left) == []  # it was told to
    assert rules(replace(left, left=False)) == {"left"}


def test_a_breach_is_shrunk_to_what_brings_it_about() -> None:
    """The flight is as it was; its judge is told that a segment counts that a crash kept from being flown."""
    long = replace(
        CALM, routes={**CALM.routes, "uav3": (6,)}, fly_again="auto",
        happenings=(Happening("reboot", "uav3", 150.2), CRASH, Happening("no battery", "uav1", 50.4, 17.7)),
    )  # fmt: skip

    def fails(plot: Plot) -> tuple[Finding, ...]:
        stormed = fly(plot)
        crashed = any(truth.what == "crash" for truth in stormed.flown.truths)
        unflown = {plot.routes["uav2"][-1] >> 1: "uav2"}
        return tuple(findings(lied(stormed, inspected=unflown) if crashed else stormed))

    [first] = fails(long)
    short = shrunk(long, first, fails, most=20)
    assert first.rule == short.finding.rule == "inspected"
    assert [one.kind for one in short.plot.happenings] == ["crash"]
    assert len(short.plot.routes) == 1
    assert fails(from_json(short.plot.to_json())) == (short.finding,)


def test_shrinking_keeps_the_rule_and_its_words_and_rounds_the_times() -> None:
    def fails(plot: Plot) -> tuple[Finding, ...]:
        """Complain of every crash, and once more of something else where there is nothing."""
        crashes = [one for one in plot.happenings if one.kind == "crash"]
        return tuple(Finding("line", one.at_s, f"{one.vehicle}: fell {one.at_s:g} s") for one in crashes) or (
            Finding("ends", 1.0, "another"),
        )

    noise = tuple(Happening("silent", "uav1", 3.7 * number, 11.3) for number in range(1, 5))
    plot = replace(CALM, happenings=(*noise, CRASH), answers=True)
    short = shrunk(plot, fails(plot)[0], fails)
    assert short.plot.happenings == (replace(CRASH, at_s=20.0),)
    assert sign(short.finding) == "[line] uav: fell # s"
    assert not short.plot.answers


def test_the_table_counts_kinds_pairs_and_failures_of_a_new_sort() -> None:
    table = Table()
    both = replace(CALM, happenings=(CRASH, Happening("silent", "uav1", 1.0)))
    assert table.add(both, (Finding("line", 1.0, "uav1: fell 3 m"),), 1.0) != []
    assert table.add(replace(both, seed=2), (Finding("line", 2.0, "uav2: fell 5 m"),), 1.0) == []
    assert table.add(CALM, (), 1.0) == []
    told = "\n".join(table.lines(6.0))
    assert "crash + silent: 2" in told
    assert "2 [line] uav: fell # m" in told
    assert "3 stories in 6 s (0.50/s" in told
    assert "2 failed" in told


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(5000, 5040))
def test_a_small_storm(seed: int) -> None:
    plot = composed(seed)
    found = findings(fly(plot))
    assert not found, "\n".join([*map(str, found), str(plot), plot.to_json()])
