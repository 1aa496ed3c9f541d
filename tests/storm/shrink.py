"""The shortest story that still fails in the same way."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from tests.stories.judge import Finding
from tests.storm.plot import ALL, Happening, Plot

MOST_FLIGHTS = 50
NUMBER = re.compile(r"-?\d+(\.\d+)?")
NAME = re.compile(r"uav\d+(, uav\d+| and uav\d+)*")

Fails = Callable[[Plot], tuple[Finding, ...]]


def sign(finding: Finding) -> str:
    """Return what failures of one sort have in common: the rule, and its words without numbers and names."""
    return f"[{finding.rule}] " + NUMBER.sub("#", NAME.sub("uav", finding.text))


@dataclass(frozen=True, slots=True)
class Shrunk:
    """What is left of a story that fails."""

    plot: Plot
    finding: Finding
    flights: int


def shrunk(plot: Plot, finding: Finding, fails: Fails, most: int = MOST_FLIGHTS) -> Shrunk:
    """Drop and round as long as the same rule is broken with the same words; `fails` flies and judges a story."""
    wanted, flights = sign(finding), 0
    going_on = True
    while going_on and flights < most:
        going_on = False
        for smaller in _smaller(plot):
            if flights >= most:
                break
            flights += 1
            same = next((one for one in fails(smaller) if sign(one) == wanted), None)
            if same is not None:
                plot, finding, going_on = smaller, same, True
                break
    return Shrunk(plot, finding, flights)


def _smaller(plot: Plot) -> Iterator[Plot]:
    """Yield what is a little less of a story, the greatest steps first."""
    for number in range(len(plot.happenings)):
        yield replace(plot, happenings=plot.happenings[:number] + plot.happenings[number + 1 :])
    if len(plot.routes) > 1:
        for name in plot.routes:
            if not any(one.vehicle == name for one in plot.happenings):
                yield replace(plot, routes={other: visits for other, visits in plot.routes.items() if other != name})
    for name, visits in plot.routes.items():
        if visits and sum(map(bool, plot.routes.values())) > (len(visits) == 1):
            shorter = {**plot.routes, name: visits[:-1]}
            if any(shorter.values()):
                yield replace(plot, routes=shorter)
    plain = Plot(plot.seed, plot.autopilot, plot.network, plot.routes, plot.happenings)
    for field in ("fly_again", "pilot_return", "answers", "charge_pct", "solve_s"):
        if getattr(plot, field) != getattr(plain, field):
            yield replace(plot, **{field: getattr(plain, field)})
    for number, one in enumerate(plot.happenings):
        for simpler in _simpler(one, plot):
            yield replace(plot, happenings=(*plot.happenings[:number], simpler, *plot.happenings[number + 1 :]))


def _simpler(one: Happening, plot: Plot) -> Iterator[Happening]:
    if one.vehicle == ALL:
        for name in plot.routes:
            yield replace(one, vehicle=name)
    for step in (10.0, 1.0):
        for field in ("at_s", "for_s"):
            value = getattr(one, field)
            rounded = round(value / step) * step
            if rounded != value and (rounded > 0 or field == "at_s"):
                yield replace(one, **{field: rounded})
    if one.for_s > 10.0:
        yield replace(one, for_s=round(one.for_s / 2.0))
