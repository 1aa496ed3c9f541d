"""The arrays that all kernels share.

Named tuples rather than classes: numba reads them at no cost, and their arrays change in place. Work space tuples state
the shape of each array in its annotation: ``allocate`` builds them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numba as nb
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Floats = Annotated[FloatArray, nb.types.Array(nb.float64, 1, "C")]
Table = Annotated[FloatArray, nb.types.Array(nb.float64, 2, "C")]
Cube = Annotated[FloatArray, nb.types.Array(nb.float64, 3, "C")]
Quad = Annotated[FloatArray, nb.types.Array(nb.float64, 4, "C")]
Ints = Annotated[IntArray, nb.types.Array(nb.int64, 1, "C")]
IntTable = Annotated[IntArray, nb.types.Array(nb.int64, 2, "C")]
IntCube = Annotated[IntArray, nb.types.Array(nb.int64, 3, "C")]
Flags = Annotated[npt.NDArray[np.bool_], nb.types.Array(nb.boolean, 1, "C")]
RandomState = Annotated[npt.NDArray[np.uint64], nb.types.Array(nb.uint64, 1, "C")]
SpaceT = TypeVar("SpaceT")


def allocate(kind: Callable[..., SpaceT], **sizes: int) -> SpaceT:
    """Return a named tuple of zeros, nested named tuples included.

    Args:
        kind: The class; the annotation of each array gives its shape, such as `k n+1`.
        sizes: The sizes of the names used in shapes.
    """
    entries = [
        allocate(part, **sizes) if shape is None else np.zeros([_size_of(one, sizes) for one in shape], dtype=part)
        for part, shape in _find_layout(kind)
    ]
    return kind(*entries)


def _size_of(name: str, sizes: dict[str, int]) -> int:
    name, _, more = name.partition("+")
    return (sizes[name] if name in sizes else int(name)) + int(more or 0)


@cache
def _find_layout(kind: Callable[..., object]) -> list[tuple[Any, list[str] | None]]:
    """Return each array's dtype and shape; for a nested named tuple, its class and None."""
    found: list[tuple[Any, list[str] | None]] = []
    for hint in get_type_hints(kind, include_extras=True).values():
        if get_origin(hint) is Annotated:
            _, array, shape = get_args(hint)
            found.append((str(array.dtype), shape.split()))
        else:
            found.append((hint, None))
    return found


class Problem(NamedTuple):
    """An instance for the kernels: ``n`` segments, ``k`` vehicles, ``p`` profiles; energies in percent of a battery."""

    profile: Ints
    """(k,): index of each vehicle's profile in ``move``."""
    move: Cube
    """(p, 2n, 2n): energy [., i, j] from the end of visit i to the end of visit j, for a consumption of 1."""
    move_into: Cube
    """(p, 2n, 2n): the transpose, [., j, i], so that all moves into a visit are contiguous in memory."""
    start: Table
    """(k, 2n): energy from the vehicle's start to the end of a visit."""
    home: Table
    """(k, 2n): energy from the end of a visit to the landing place."""
    idle: Floats
    """(k,): energy of a route without a visit."""
    consumption: Floats
    """(k,): factor applied to ``move``."""
    budget: Floats
    """(k,): upper limit for every route with a visit in the best plan."""
    value: Floats
    """(n,): cost to the plan of leaving a segment out; positive."""
    prize: Floats
    """(n,): the same in percent of a battery, as the search weighs it against energy."""
    effort: Floats
    """(n,): least energy of a route that visits this segment only."""
    near: IntTable
    """(n, m): nearest segments of each segment, starting with the segment itself."""
    twin: Ints
    """(k,): an earlier vehicle with identical data, -1 for none: only one of several idle twins is tried."""


class Weights(NamedTuple):
    """The objective that guides the search: a sum of weighted terms."""

    total: float
    """Weight of the total energy of all routes."""
    peak: float = 0.0
    """Weight of the largest load."""
    norm: float = 0.0
    """Weight of the p-norm of the loads: a maximum that also reacts to the second largest."""
    power: float = 1.0
    """Exponent p of the norm, a whole number."""
    scale: float = 1.0
    """Divisor of the loads before they are raised to p; positive."""
    prize: float = 0.0
    """Weight of the prizes of uncovered segments."""
    empty: float = 0.0
    """Cost of each route without a visit; 0 unless all vehicles must fly."""
    excess: float = 0.0
    """Weight of the energy beyond budgets."""
    slack: float = 0.0
    """Amount by which the search may temporarily exceed a route's budget, as a share of the budget."""


class State(NamedTuple):
    """The routes that the search changes: ``k`` routes of at most ``n`` visits."""

    visits: Annotated[IntTable, "k n"]
    """Row r holds route r in its first ``lengths[r]`` entries."""
    legs: Annotated[Table, "k n+1"]
    """Energy of the move that ends with visit p; entry ``lengths[r]`` is the return leg."""
    lengths: Annotated[Ints, "k"]
    loads: Annotated[Floats, "k"]
    """Energy of each route."""
    route_of: Annotated[Ints, "n"]
    """Route that visits the segment, -1 for none."""


class SearchWorkspace(NamedTuple):
    """Work space of an annealing: lists, and the cheapest positions found with the versions of their routes."""

    waiting: Annotated[Ints, "n"]
    pending: Annotated[Ints, "n"]
    keys: Annotated[Floats, "n"]
    touched: Annotated[Ints, "k"]
    """Zeros between two uses."""
    came_from: Annotated[IntTable, "n 2"]

    versions: Annotated[Ints, "k"]
    """Route versions: positive, incremented whenever a change to a route is accepted."""
    version: Annotated[IntTable, "n k"]
    """Route version for which the position of the segment was computed; 0 if never."""
    added: Annotated[Table, "n k"]
    """Energy that the segment adds to the route at that position."""
    place: Annotated[IntTable, "n k"]
    """2 * position, plus 1 if the segment is flown in reverse."""
