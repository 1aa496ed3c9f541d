"""A random hostile story for a seed."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from executor.core.interface.intents import Action
from tests.stories.story import MISSION
from tests.storm.plot import ALL, GROUND, SITES, Happening, Plot

AGO_S = 80.0
"""Most begins within this, while somebody is still in the air."""


@dataclass(slots=True)
class Chance:
    """What a happening is drawn with."""

    rng: random.Random
    names: tuple[str, ...]
    autopilot: str

    @property
    def when_s(self) -> float:
        return round(self.rng.uniform(0.0, AGO_S), 1)

    def lasting_s(self, least: float, most: float) -> float:
        return round(self.rng.uniform(least, most), 1)

    @property
    def victim(self) -> str:
        return self.rng.choice(self.names)

    @property
    def most(self) -> str:
        """One, or now and then everybody."""
        return ALL if self.rng.random() < 0.2 else self.victim

    def pick(self, *of: str) -> str:
        return self.rng.choice(of)


Draw = Callable[[Chance], Happening]


def _once(kind: str, *words: str) -> Draw:
    return lambda c: Happening(kind, c.victim, c.when_s, word=c.pick(*words) if words else "")


def _while(kind: str, least_s: float, most_s: float) -> Draw:
    return lambda c: Happening(kind, c.most, c.when_s, c.lasting_s(least_s, most_s))


def _ground(kind: str, least_s: float, most_s: float, *words: str) -> Draw:
    return lambda c: Happening(
        kind, GROUND, c.when_s, c.lasting_s(least_s, most_s), word=c.pick(*words) if words else ""
    )


def _silent(c: Chance) -> Happening:
    for_s = 0.0 if c.rng.random() < 0.25 else c.lasting_s(2.0, 60.0)
    return Happening("silent", c.victim, c.when_s, for_s)


def _all_silent(c: Chance) -> Happening:
    return Happening("all silent", ALL, c.when_s, c.lasting_s(20.0, 200.0))


def _lossy(c: Chance) -> Happening:
    word = c.pick("loss", "loss", "delay", "duplicate", "reorder")
    value = round(c.rng.uniform(0.2, 3.0) if word == "delay" else c.rng.uniform(0.1, 0.8), 1)
    return Happening("bad link", c.most, c.when_s, c.lasting_s(10.0, 90.0), value, word)


def _battery(c: Chance) -> Happening:
    return Happening("battery step", c.victim, c.when_s, value=float(c.rng.randrange(5, 95)))


def _drain(c: Chance) -> Happening:
    return Happening("drain", c.victim, c.when_s, value=round(c.rng.uniform(2.0, 30.0), 1))


def _pilot(kind: str) -> Draw:
    """Return a person who takes it, and what becomes of it ``for_s`` later."""

    def draw(c: Chance) -> Happening:
        words = MISSION[c.autopilot]
        mode = c.pick(words["hold"], words["soft"], words["pause"], "RTL", "LAND")
        then = c.pick(words["mission"], words["mission"], "RTL", "LAND")
        return Happening(kind, c.victim, c.when_s, c.lasting_s(1.0, 60.0), word=f"{mode} {then}")

    return draw


def _sticks(c: Chance) -> Happening:
    then = c.pick(MISSION[c.autopilot]["mission"], "RTL", "LAND")
    return Happening("sticks", c.victim, c.when_s, c.lasting_s(2.0, 40.0), word=then)


def _gps(c: Chance) -> Happening:
    return Happening("gps jump", c.victim, c.when_s, c.lasting_s(0.4, 30.0), float(c.rng.choice([8, 30, 200, 5000])))


def _wish(c: Chance) -> Happening:
    action = c.rng.choice([
        Action.HOLD, Action.HOLD, Action.RESUME, Action.RETURN, Action.LAND, Action.EXCLUDE, Action.INCLUDE,
        Action.REPLAN, Action.ABORT, Action.DISARM,
    ])  # fmt: skip
    for_all = action in {Action.REPLAN, Action.ABORT}
    sure = 1.0 if c.rng.random() < 0.7 else 0.0
    return Happening("wish", GROUND if for_all else c.victim, c.when_s, 0.0, sure, action.value)


def _killed(c: Chance) -> Happening:
    """Draw how long it is away, and by how much the clock of the computer was set meanwhile."""
    set_s = c.rng.choice([0.0, 0.0, 0.0, -3600.0, 3600.0])
    return Happening("ground killed", GROUND, c.when_s, c.lasting_s(1.0, 60.0), set_s)


KINDS: Mapping[str, Draw] = {
    "silent": _silent,
    "all silent": _all_silent,
    "uplink lost": _while("uplink lost", 3.0, 90.0),
    "downlink lost": _while("downlink lost", 3.0, 60.0),
    "held up": _while("held up", 1.0, 40.0),
    "bursts": _while("bursts", 10.0, 90.0),
    "bad link": _lossy,
    "frozen": _while("frozen", 2.0, 60.0),
    "ground sleeps": _ground("ground sleeps", 1.0, 60.0),
    "ground killed": _killed,
    "battery step": _battery,
    "drain": _drain,
    "crash": _once("crash"),
    "disarm": _once("disarm"),
    "kill": _once("kill"),
    "wreck": _once("wreck"),
    "fence": _once("fence"),
    "emergency": _once("emergency", "LAND", "RTL"),
    "ekf": _once("ekf"),
    "reboot": _once("reboot", "", "pad"),
    "refuse-upload": _once("refuse-upload"),
    "half-upload": _once("half-upload"),
    "pilot": _pilot("pilot"),
    "station": _pilot("station"),
    "sticks": _sticks,
    "gps jump": _gps,
    "no position": _while("no position", 2.0, 60.0),
    "no heartbeat": _while("no heartbeat", 2.0, 60.0),
    "no battery": _while("no battery", 5.0, 90.0),
    "forged disarmed": _once("forged disarmed", "1", "190"),
    "forged position": _once("forged position"),
    "forged text": _once("forged text", "Battery Failsafe", "Failsafe activated: low battery", "GCS Failsafe"),
    "forged radio": _once("forged radio"),
    "garbage": _while("garbage", 1.0, 20.0),
    "foreign mission": _once("foreign mission"),
    "solver": _ground("solver", 20.0, 100.0, "hangs", "fails", "late"),
    "wish": _wish,
    "disk": _ground("disk", 5.0, 60.0, "full", "hangs"),
    "ctrl-c": _ground("ctrl-c", 0.0, 0.0, "once", "twice", "twice"),
}
"""Everything that may happen."""
BY_HAND = ("pilot", "pilot", "pilot", "station", "sticks", "wish", "wish", "wish")
"""Drawn more often where a story is of one vehicle: the commonest question is who has it."""
LIKELY = ("crash", "silent", "wish", "wish", "pilot")
"""Drawn more often: they make re-plans, which the others meet then."""


def composed(seed: int) -> Plot:
    """Return the story of a seed."""
    rng = random.Random(f"storm {seed}")
    autopilot = rng.choice(sorted(MISSION))
    network = rng.choice(sorted(SITES))
    names = tuple(f"uav{number}" for number in range(1, rng.choice([2, 2, 2, 3, 3, 3, 4, 5]) + 1))
    chance = Chance(rng, names, autopilot)
    kinds = [rng.choice([*KINDS, *LIKELY]) for _ in range(rng.choice([0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4]))]
    happenings = sorted((KINDS[kind](chance) for kind in kinds), key=lambda one: (one.at_s, one.kind))
    return Plot(
        seed, autopilot, network, _dealt(rng, names, len(SITES[network][1])), tuple(happenings),
        fly_again=rng.choice(["ask", "ask", "auto", "never"]), pilot_return=rng.choice(["ask", "ask", "auto"]),
        answers=rng.random() < 0.5, charge_pct=rng.choice([100.0, 100.0, 70.0, 35.0]),
        solve_s=rng.choice([0.3, 1.0, 4.0]),
    )  # fmt: skip


CLOSE_S = 30.0
"""What happens in a story of one vehicle happens within this of each other."""


def close(seed: int) -> Plot:
    """Return a story of one vehicle with one segment, to which things happen close together: where rules meet.

    It takes a sixth of the processor that a fleet's story takes, and what fails is short as it is.
    """
    rng = random.Random(f"close {seed}")
    autopilot, network = rng.choice(sorted(MISSION)), rng.choice(sorted(SITES))
    name, segment = "uav1", rng.randrange(len(SITES[network][1]))
    chance = Chance(rng, (name,), autopilot)
    first_s = rng.uniform(0.0, AGO_S)
    kinds = [rng.choice([*KINDS, *BY_HAND]) for _ in range(rng.choice([2, 2, 3, 3, 4]))]
    drawn = [replace(KINDS[kind](chance), at_s=round(first_s + rng.uniform(0.0, CLOSE_S), 1)) for kind in kinds]
    return Plot(
        seed, autopilot, network, {name: (2 * segment + rng.randrange(2),)},
        tuple(sorted(drawn, key=lambda one: (one.at_s, one.kind))),
        fly_again=rng.choice(["ask", "auto", "never"]), pilot_return=rng.choice(["ask", "auto"]),
        answers=rng.random() < 0.5, charge_pct=rng.choice([100.0, 100.0, 35.0]), solve_s=1.0,
    )  # fmt: skip


def _dealt(rng: random.Random, names: tuple[str, ...], segments: int) -> Mapping[str, tuple[int, ...]]:
    """Deal the segments out in runs; somebody may have none."""
    cuts = sorted(rng.randrange(segments + 1) for _ in names[1:])
    bounds = [0, *cuts, segments]
    routes = {}
    for name, low, high in zip(names, bounds, bounds[1:], strict=False):
        back = rng.random() < 0.5
        run = range(high - 1, low - 1, -1) if back else range(low, high)
        routes[name] = tuple(2 * segment + back for segment in run)
    return routes
