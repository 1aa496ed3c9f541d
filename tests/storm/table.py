"""What a storm has flown so far, and what failed."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from tests.stories.judge import Finding
from tests.storm.compose import KINDS
from tests.storm.plot import Plot
from tests.storm.shrink import sign

PAIRS = 12
"""Pairs of kinds that are named."""


@dataclass(slots=True)
class Table:
    """What was flown so far, and what failed."""

    flown: int = 0
    failed: int = 0
    busy_s: float = 0.0
    kinds: Counter[str] = field(default_factory=Counter)
    failing: Counter[str] = field(default_factory=Counter)
    pairs: Counter[tuple[str, str]] = field(default_factory=Counter)
    rules: Counter[str] = field(default_factory=Counter)
    signs: dict[str, list[int]] = field(default_factory=dict)

    def add(self, plot: Plot, found: tuple[Finding, ...], busy_s: float) -> list[Finding]:
        """Count a story; returns the failures of sorts that were not seen before."""
        self.flown += 1
        self.failed += bool(found)
        self.busy_s += busy_s
        self.kinds.update(plot.kinds)
        self.failing.update(plot.kinds if found else ())
        self.pairs.update(itertools.combinations(plot.kinds, 2))
        self.rules.update({one.rule for one in found})
        new = []
        for one in found:
            seeds = self.signs.setdefault(sign(one), [])
            new += [] if seeds else [one]
            seeds.append(plot.seed)
        return new

    def lines(self, took_s: float) -> Iterator[str]:
        """Yield the table."""
        if not self.flown:
            yield "no story was flown"
            return
        yield ""
        yield f"{'kind':18} {'stories':>8} {'failed':>8}"
        for kind in KINDS:
            yield f"{kind:18} {self.kinds[kind]:8} {self.failing[kind]:8}"
        most = len(KINDS) * (len(KINDS) - 1) // 2
        yield f"\npairs of kinds: {len(self.pairs)} of {most} flown; most often:"
        for (one, two), count in self.pairs.most_common(PAIRS):
            yield f"  {one} + {two}: {count}"
        yield "\nfailed by rule: " + (
            ", ".join(f"{rule} {count}" for rule, count in self.rules.most_common()) or "none"
        )
        for what, seeds in sorted(self.signs.items(), key=lambda item: -len(item[1])):
            yield f"  {len(set(seeds)):5} {what[:150]}  e.g. seeds {', '.join(map(str, dict.fromkeys(seeds[:4])))}"
        rate = f"{self.flown / took_s:.2f}/s, {self.busy_s / self.flown:.2f} s of a processor each"
        yield f"\n{self.flown} stories in {took_s:.0f} s ({rate}), {self.failed} failed"
