"""What a story is: a fleet, and moments in which something happens to it or somebody wants something."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from executor.core.interface.intents import Action, IntentRecord
from executor.core.state.fleet_state import FleetState
from simulator.fleet import SimulatedVehicle

MISSION = {
    "ardupilot": {"hold": "LOITER", "soft": "ALT_HOLD", "pause": "BRAKE", "mission": "AUTO"},
    "px4": {"hold": "POSCTL", "soft": "ALTCTL", "pause": "HOLD", "mission": "MISSION"},
}
"""What a person chooses, by the words of a story, in each dialect's words."""


class World(ABC):
    """What a moment may look at, and do."""

    @property
    @abstractmethod
    def now_s(self) -> float:
        """The flight's clock."""

    @property
    @abstractmethod
    def state(self) -> FleetState:
        """The flight as it is known on the ground."""

    @abstractmethod
    def vehicle(self, name: str) -> SimulatedVehicle:
        """A vehicle as it is."""

    @abstractmethod
    def since(self, vehicle: str, what: str) -> float | None:
        """How long ago a vehicle's truth said something first."""

    @abstractmethod
    def befall(self, spec: str) -> None:
        """Let a fault happen."""

    @abstractmethod
    def ask(
        self, action: Action, vehicle: str | None, *, sure: bool = True, assets: tuple[int | str, ...] = ()
    ) -> IntentRecord:
        """Ask as a crew does."""


When = Callable[[World], bool]
Do = Callable[[World], object]


@dataclass(frozen=True, slots=True)
class Moment:
    """Something happens once, as soon as its time has come."""

    when: When
    do: Do


class Answers(Enum):
    """What a crew says to the offer that a vehicle could fly again."""

    YES = "yes"
    NOTHING = "nothing"


Routes = Mapping[str, tuple[int, ...]]
THREE: Routes = {"uav1": (0, 2), "uav2": (4, 6), "uav3": (8, 10)}
"""Two segments of 100 m each, all flown eastward."""
PAIR: Routes = {"uav1": (0, 2), "uav2": (4, 6)}
LONG: Routes = {"uav1": (0,), "uav2": (2, 4, 6), "uav3": (8, 10)}
"""uav1 is home long before the others."""


@dataclass(frozen=True, slots=True)
class Story:
    """One flight and what becomes of it."""

    name: str
    moments: tuple[Moment, ...]
    completes: bool = True
    """Whether everything is inspected in the end."""
    offers: Answers = Answers.NOTHING
    fleet: Routes = field(default_factory=lambda: THREE)
    tables: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    """Of the site file."""
    solve_s: float = 1.0
    charge_pct: float = 100.0
    limit_s: float = 900.0
    """After the launch it must be over."""
    says: tuple[str, ...] = ()
    """Patterns: of each there must be a line."""
    never_says: tuple[str, ...] = ()

    @property
    def pylons(self) -> int:
        return 2 + max(visit >> 1 for visits in self.fleet.values() for visit in visits)


# When.


def at(seconds: float) -> When:
    """So many seconds after the launch."""
    return lambda world: (
        world.state.progress.launched_s is not None and world.now_s - world.state.progress.launched_s >= seconds
    )


def share(vehicle: str, part: float) -> When:
    """When a vehicle has flown this part of its first mission's length."""

    def due(world: World) -> bool:
        flown = world.vehicle(vehicle).autopilot.flown_share
        return flown is not None and flown >= part

    return due


def high(vehicle: str, up_m: float) -> When:
    """When a vehicle is so high over its pad."""
    return lambda world: world.vehicle(vehicle).autopilot.frame.body.up_m >= up_m


def low(vehicle: str, up_m: float) -> When:
    """When a vehicle that was higher is down to so much over its pad in its landing."""

    def due(world: World) -> bool:
        frame = world.vehicle(vehicle).autopilot.frame
        return frame.highest_m > up_m + 2 and frame.body.up_m <= up_m and world.since(vehicle, "descends") is not None

    return due


def on_segment(vehicle: str, number: int = 1) -> When:
    """When a vehicle has 30 m of its n-th inspection behind it, as the ground sees it."""
    begun: dict[World, set[int | None]] = {}

    def due(world: World) -> bool:
        known = world.state.vehicles[vehicle]
        if known.assignment.run is None or known.assignment.run.furthest_m < 30.0:
            return False
        seen = begun.setdefault(world, set())
        seen.add(known.assignment.run_visit)
        return len(seen) >= number

    return due


def after(vehicle: str, what: str, seconds: float = 0.0) -> When:
    """So long after a vehicle's truth said something for the first time."""

    def due(world: World) -> bool:
        since_s = world.since(vehicle, what)
        return since_s is not None and since_s >= seconds

    return due


def solving(world: World) -> bool:
    """While the solver works on a re-plan."""
    return world.state.replanning.replan is not None and world.state.replanning.replan.solve_s is None


def uploading(vehicle: str) -> When:
    """While a re-plan's mission goes on board a vehicle."""

    def due(world: World) -> bool:
        known = world.state.vehicles[vehicle]
        store = world.vehicle(vehicle).autopilot.store
        return known.assignment.pending is not None and getattr(store, "is_busy", True)

    return due


def first(*conditions: When) -> When:
    """As soon as all of these hold."""
    return lambda world: all(condition(world) for condition in conditions)


# What.


def befalls(spec: str) -> Do:
    """A fault, by the simulator's grammar without its WHEN; ``{hold}`` and such stand for the dialect's words."""
    return lambda world: world.befall(spec)


def asks(action: Action, vehicle: str | None = None, *, sure: bool = True, assets: tuple[int | str, ...] = ()) -> Do:
    """The crew wants something."""
    return lambda world: world.ask(action, vehicle, sure=sure, assets=assets)


def told(when: When, spec: str) -> Moment:
    """Return a moment in which something befalls somebody."""
    return Moment(when, befalls(spec))


def wants(when: When, action: Action, vehicle: str | None = None, *, sure: bool = True) -> Moment:
    """Return a moment in which the crew asks for something."""
    return Moment(when, asks(action, vehicle, sure=sure))
