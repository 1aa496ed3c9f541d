"""What a storm's story is: a small fleet over a small network, and what happens to it; as data, text and JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass

from missions import Network
from tests.missions.builders import network_of

GROUND = "ground"
"""As a happening's vehicle: the ground station."""
ALL = "all"
BEARS_S = 15.0
"""How long a reboot keeps a vehicle from talking, with what it takes to be heard again."""


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that happens to somebody."""

    kind: str
    vehicle: str
    """A name, ``all`` or ``ground``."""
    at_s: float
    """After the launch."""
    for_s: float = 0.0
    """How long; 0 where it has no end of its own."""
    value: float = 0.0
    word: str = ""

    @property
    def ends_s(self) -> float:
        """When it is over."""
        return self.at_s + self.for_s

    def befalls(self, name: str) -> bool:
        """Return whether a vehicle is concerned."""
        return self.vehicle in {name, ALL, GROUND}

    def __str__(self) -> str:
        parts = [f"{self.at_s:6.1f} s  {self.vehicle:6} {self.kind}"]
        parts += [self.word] if self.word else []
        parts += [f"{self.value:g}"] if self.value else []
        parts += [f"for {self.for_s:g} s"] if self.for_s else []
        return " ".join(parts)


@dataclass(frozen=True, slots=True)
class Plot:
    """One story of a storm."""

    seed: int
    """Of the chance in it; what it is made of is written here."""
    autopilot: str
    network: str
    routes: Mapping[str, tuple[int, ...]]
    happenings: tuple[Happening, ...] = ()
    fly_again: str = "ask"
    pilot_return: str = "ask"
    answers: bool = False
    """Whether the crew says yes to offers."""
    charge_pct: float = 100.0
    solve_s: float = 1.0

    @property
    def kinds(self) -> tuple[str, ...]:
        """What happens, each kind once, by the alphabet."""
        return tuple(sorted({one.kind for one in self.happenings}))

    def to_json(self) -> str:
        """Return one line that `from_json` reads."""
        return json.dumps(dataclasses.asdict(self), separators=(",", ":"))

    def __str__(self) -> str:
        flies = ", ".join(f"{name} {list(visits)}" for name, visits in self.routes.items())
        settings = f"fly_again {self.fly_again}, pilot_return {self.pilot_return}, charge {self.charge_pct:g} %"
        crew = "the crew sends again" if self.answers else "nobody answers offers"
        return "\n".join([
            f"seed {self.seed}: {self.autopilot}, network {self.network!r}: {flies}",
            f"  {settings}, {crew}, the solver takes {self.solve_s:g} s",
            *(f"  {one}" for one in self.happenings),
        ])  # fmt: skip


def from_json(line: str) -> Plot:
    """Return the story of a line."""
    fields = json.loads(line)
    fields["routes"] = {name: tuple(visits) for name, visits in fields["routes"].items()}
    fields["happenings"] = tuple(Happening(**one) for one in fields["happenings"])
    return Plot(**fields)


SITES: Mapping[str, tuple[tuple[tuple[float, float], ...], tuple[tuple[int, int], ...]]] = {
    "line": (tuple((40.0 * number, 0.0) for number in range(1, 6)), tuple((n, n + 1) for n in range(4))),
    "fork": (((40.0, 0.0), (80.0, 0.0), (120.0, 0.0), (105.0, 35.0), (105.0, -35.0)), ((0, 1), (1, 2), (1, 3), (1, 4))),
    "comb": (
        ((40.0, 10.0), (80.0, 10.0), (120.0, 10.0), (40.0, 50.0), (80.0, 50.0), (120.0, 50.0)),
        ((0, 1), (1, 2), (0, 3), (1, 4), (2, 5)),
    ),
    "apart": (
        ((40.0, 25.0), (80.0, 25.0), (120.0, 25.0), (40.0, -35.0), (80.0, -35.0), (120.0, -35.0)),
        ((0, 1), (1, 2), (3, 4), (4, 5)),
    ),
}
"""Pylons east and north of the depot in metres, and the spans between them."""


def network_named(name: str) -> Network:
    """Return a small network."""
    return network_of(*SITES[name])
