"""Flights whose ground station dies at a random instant and comes back, in virtual time, with a judge of its own.

The vehicles fly on what they have in their memories; what was half uploaded is half there. The judge looks at where
they really were, and knows nothing of what the program believes.
"""

from __future__ import annotations

import asyncio
import itertools
import math
import random
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.events import Event, Reopened, SolveEnded
from executor.core.state.inspection_proof import InspectionRun, PositionSample, Track, advance_run
from executor.runtime.flight_loop import Flight, Observer
from tests.executor.builders import THREE, Fleet, fleet_of
from tests.executor.runtime.test_flight_loop import Sky
from tests.fakes.flyer import STEP_S, Flyer
from tests.fakes.link import CLEAN, Air
from tests.fakes.solver import FakeSolver

SLOW = Air(delay_s=(0.02, 0.12))
"""An upload takes some seconds then, in which one can die."""
FLYING_M = 2.0
PATIENCE_S = 1500.0


@dataclass(slots=True)
class Judge:
    """Where everybody really was."""

    context: Context
    flyers: Mapping[str, Flyer]
    tracks: tuple[Track, ...]
    passed: Counter[tuple[str, int]] = field(default_factory=Counter)
    """How often a vehicle flew along a segment from end to end, slowly enough."""
    nearest_m: float = math.inf
    runs: dict[tuple[str, Track], InspectionRun | None] = field(default_factory=dict)

    async def watch(self) -> None:
        while True:
            now_s = asyncio.get_running_loop().time()
            for name, flyer in self.flyers.items():
                sample = PositionSample(now_s, flyer.place_m)
                for track in self.tracks if flyer.armed else ():
                    step = advance_run(
                        self.runs.get((name, track)), track, sample,
                        corridor_m=self.context.corridor_m, speed_m_s=self.context.inspection_speed_m_s,
                    )  # fmt: skip
                    self.runs[name, track] = step.run
                    self.passed[name, track.segment] += step.flown is not None
            up = [flyer for flyer in self.flyers.values() if flyer.armed and flyer.up_m > FLYING_M]
            for one, other in itertools.combinations(up, 2):
                apart = math.dist((*one.place_m, one.up_m), (*other.place_m, other.up_m))
                self.nearest_m = min(self.nearest_m, apart)
            await asyncio.sleep(STEP_S)


class MortalSky(Sky):
    """A fleet in the air whose supervision can die."""

    def __init__(self, ready: Fleet, air: Air) -> None:
        super().__init__(ready, air)
        self.log: list[tuple[float, Event]] = []
        self.solved = 0
        """How many re-plans were found."""
        self.doomed: frozenset[str] = frozenset()
        """Vehicles that are or will be silenced."""
        self.silenced: frozenset[str] = frozenset()
        """Vehicles that will not be heard again."""

        self.ends_unmade = asyncio.Event()
        """Set when it died while missions were still to be made; then nothing is written any more."""
        self.dies_unmade = False

    def write(self, event: Event, now_s: float) -> None:
        super().write(event, now_s)
        plan = self.flight.state.replanning.replan
        if self.dies_unmade and plan is not None and plan.unmade:
            self.ends_unmade.set()
            for link in self.links.values():
                link.cut = True
        if self.ends_unmade.is_set():
            return
        self.log.append((now_s, event))
        self.solved += isinstance(event, SolveEnded)

    def raised(self) -> Flight:
        """Return a new flight with the state that the log gives."""
        state = fleet_step.build_initial_state(dict(self.ready.boards))
        for now_s, event in self.log:
            state, _ = fleet_step.step(self.ready.context, state, event, now_s)
        self.solver = FakeSolver()
        return Flight(
            self.ready.context, state, self.links, self.clock, self, self.solver,
            Observer(lambda line, _: self.said.append(line), self._applied),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """A flight that was killed, as it ended."""

    sky: MortalSky
    judge: Judge
    lost: frozenset[str]
    """Vehicles that were made to fall silent."""
    moments: tuple[str, ...]
    """What was going on whenever the ground station died."""

    def wrongs(self) -> list[str]:
        """Return everything that should not be."""
        state, passed = self.sky.state, self.judge.passed
        wrong = [
            f"segment {one} is lost"
            for one in range(self.sky.ready.context.segments)
            if one not in state.coverage.inspected
        ]
        wrong += [
            f"segment {segment} was never flown by {name}"
            for segment, name in state.coverage.inspected.items()
            if not passed[name, segment]
        ]
        if self.judge.nearest_m < self.sky.ready.context.setup.layers.spacing_m - 0.5:
            wrong.append(f"{self.judge.nearest_m:.1f} m between two vehicles")
        for name, flyer in self.sky.flyers.items():
            if name not in self.lost and flyer.armed:
                wrong.append(f"{name} is still in the air")
            if flyer.percent < self.sky.ready.context.vehicles[name].reserve_pct:
                wrong.append(f"{name} has {flyer.percent:.0f} % left")
        faults = {name for name, vehicle in state.vehicles.items() if vehicle.fault is not None}
        wrong += [f"{name} was given up: {state.vehicles[name].fault}" for name in faults - self.lost]
        wrong += [line.text for line in self.sky.said if "internal error" in line.text]
        return wrong

    def twice(self) -> list[int]:
        """Return segments that healthy vehicles flew more than once."""
        counts: Counter[int] = Counter()
        for (name, segment), times in self.judge.passed.items():
            counts[segment] += times * (name not in self.lost)
        return sorted(segment for segment, times in counts.items() if times > 1)

    def explained(self) -> bool:
        """Whether it was said that something nobody saw does not count."""
        return any("does not count" in line.text or "not proven" in line.text for line in self.sky.said)


async def flown(seed: int, *, at_unmade: bool = False) -> Outcome:
    """Fly, with a loss or without, and with one to three deaths of the ground station at random instants.

    Args:
        seed: Of everything that is chosen.
        at_unmade: There is a loss, and the first death comes while missions are still to be made.
    """
    chance = random.Random(seed)
    ready = fleet_of({**THREE, "uav4": ()}, autopilot=chance.choice(["ardupilot", "px4"]))
    sky = MortalSky(ready, chance.choice([CLEAN, SLOW, SLOW]))
    tracks = tuple(track for board in ready.boards.values() if board is not None for track in board.tracks)
    both = (*tracks, *(Track(track.segment, track.end_m, track.begin_m) for track in tracks))
    judge = Judge(ready.context, sky.flyers, both)
    watching = asyncio.create_task(judge.watch())
    await sky.load()
    lost = sky.doomed = frozenset({"uav2"}) if chance.random() < 0.6 or at_unmade else frozenset()
    silence = asyncio.create_task(_silence(sky, lost, chance.uniform(15.0, 80.0)))
    moments: list[str] = []
    task = asyncio.create_task(sky.flight.run())
    try:
        for death in range(chance.choice([1, 1, 1, 2, 3])):
            if at_unmade and death == 0:
                sky.dies_unmade = True
                async with asyncio.timeout(PATIENCE_S):
                    await sky.ends_unmade.wait()
                moments.append("unmade")
                task.cancel()
                await asyncio.wait([task])
                sky.dies_unmade = False
                sky.ends_unmade.clear()
            elif not await _dies(sky, task, chance, moments):
                break
            reopened = await _away(sky, chance)
            task = asyncio.create_task(sky.flight.run(reopened, 15.0))
        async with asyncio.timeout(PATIENCE_S):
            await task
    finally:
        watching.cancel()
        silence.cancel()
        for link in sky.links.values():
            link.close()
    return Outcome(sky, judge, lost, tuple(moments))


async def _silence(sky: MortalSky, lost: frozenset[str], after_s: float) -> None:
    await asyncio.sleep(after_s)
    sky.silenced |= lost
    for name in lost:
        sky.links[name].cut = True


async def _dies(sky: MortalSky, task: asyncio.Task[None], chance: random.Random, moments: list[str]) -> bool:
    """Kill the ground station at a random instant; returns whether the flight was still going on."""
    if chance.random() < 0.4 and not sky.solved and "uav2" in sky.doomed:
        waiting = asyncio.create_task(sky.until(lambda: sky.solved > 0))
        await asyncio.wait([waiting, task], return_when=asyncio.FIRST_COMPLETED)
        waiting.cancel()
        pause_s = chance.uniform(0.0, 5.0)
    else:
        pause_s = chance.uniform(0.0, 150.0)
    done, _ = await asyncio.wait([task], timeout=pause_s)
    if done:
        return False
    plan = sky.state.replanning.replan
    under_way = "" if plan is None else " solving" if plan.solve_s is None else f" uploading to {len(plan.pending)}"
    stages = Counter(vehicle.stage for vehicle in sky.state.vehicles.values())
    moments.append(", ".join(f"{count} {stage.value}" for stage, count in stages.items()) + under_way)
    for link in sky.links.values():
        link.cut = True  # a killed process says nothing to anybody, not even that it gives up
    task.cancel()
    await asyncio.wait([task])
    return True


async def _away(sky: MortalSky, chance: random.Random) -> Reopened:
    """Let the vehicles fly on alone, and read the log."""
    died_s = sky.log[-1][0]
    await asyncio.sleep(chance.choice([0.5, 3.0, 10.0, 30.0, 120.0]) * chance.uniform(0.5, 1.5))
    for name, link in sky.links.items():
        link.cut = name in sky.silenced
    sky.flight = sky.raised()
    return Reopened(1.8e9, sky.clock.now_s() - died_s, ())
