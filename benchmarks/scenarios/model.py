"""A day of several trips for each vehicle, as frozen data: depots, tasks between places, what has happened so far.

Places are numbered; what lies between them is only a matrix of times. A *task* leads from one place to another and is
done once, in either direction; *visit* ``2 * task + reversed`` is a task in one direction, as in ``planner.model``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.moves import FloatArray


@dataclass(frozen=True, slots=True)
class DayTask:
    """A way between two places that some trip must lead along."""

    a: int
    b: int
    seconds: float


@dataclass(frozen=True, slots=True)
class DayVehicle:
    """A vehicle, and what it has behind it."""

    place: int
    """Where its next trip begins; need not be a depot."""
    ready_s: float = 0.0
    """No trip of its own begins earlier."""
    ended_s: float = 0.0
    """The end of its trips so far, the one under way included."""


@dataclass(frozen=True, slots=True)
class DayInstance:
    """What is left of a day: ``n`` tasks, ``m`` places, ``k`` vehicles."""

    times_s: FloatArray
    """(m, m) float64: from place to place; infinite where no way leads."""
    tasks: tuple[DayTask, ...]
    depots: tuple[int, ...]
    """Places where a trip may end, and the next one begin."""
    vehicles: tuple[DayVehicle, ...]
    capacity_s: float
    """The longest trip."""
    turnaround_s: float
    """From a trip's end to the vehicle's next one: unloading, recharging."""

    def __post_init__(self) -> None:
        """Check shapes and numbers.

        Raises:
            InstanceError: what does not fit.
        """
        places = len(self.times_s)
        if self.times_s.shape != (places, places) or np.isnan(self.times_s).any() or (self.times_s < 0).any():
            raise InstanceError("times_s: expected a square matrix of seconds, 0 or more")
        if not self.depots:
            raise InstanceError("depots: expected one at least")
        if not self.vehicles:
            raise InstanceError("vehicles: expected one at least")
        named = [
            *self.depots,
            *(own.place for own in self.vehicles),
            *(end for one in self.tasks for end in (one.a, one.b)),
        ]
        unknown = [place for place in named if not 0 <= place < places]
        if unknown:
            raise InstanceError(f"place {unknown[0]}: expected one from 0 to {places - 1}")
        figures = {
            "capacity_s": [self.capacity_s],
            "turnaround_s": [self.turnaround_s],
            "seconds of a task": [one.seconds for one in self.tasks],
            "ready_s of a vehicle": [own.ready_s for own in self.vehicles],
            "ended_s of a vehicle": [own.ended_s for own in self.vehicles],
        }
        for name, values in figures.items():
            if not np.isfinite(values).all() or min(values, default=0.0) < 0:
                raise InstanceError(f"{name}: expected 0 or more")


@dataclass(frozen=True, slots=True)
class Trip:
    """One trip: from a place, through visits, to a depot."""

    begin: int
    visits: tuple[int, ...]
    end: int


@dataclass(frozen=True, slots=True)
class DayPlan:
    """Each vehicle's trips from now on, in the order of the instance's vehicles, and the tasks that nobody does."""

    trips: tuple[tuple[Trip, ...], ...]
    uncovered: tuple[int, ...] = ()


def way_of(instance: DayInstance, visit: int) -> tuple[int, int]:
    """Return where a visit begins and ends."""
    task = instance.tasks[visit >> 1]
    return (task.b, task.a) if visit & 1 else (task.a, task.b)


def day_instance(
    times_s: npt.ArrayLike,
    tasks: Sequence[DayTask],
    depots: Sequence[int],
    vehicles: Sequence[DayVehicle],
    *,
    capacity_s: float,
    turnaround_s: float = 0.0,
) -> DayInstance:
    """Return the instance of a matrix of times; ``RoadGraph`` makes one of a graph.

    Raises:
        InstanceError: what does not fit.
    """
    times = np.array(times_s, dtype=np.float64)
    if times.ndim != 2:
        raise InstanceError("times_s: expected a square matrix of seconds, 0 or more")
    return DayInstance(times, tuple(tasks), tuple(depots), tuple(vehicles), float(capacity_s), float(turnaround_s))
