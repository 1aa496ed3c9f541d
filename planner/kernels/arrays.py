"""The arrays that all kernels share.

Named tuples rather than classes: numba sees through them at no cost, and the arrays in them change in place. Those that
are work space name the shape of each array in its annotation: ``allocate`` makes them.
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
    """Return a named tuple of zeros, and of named tuples of zeros.

    Args:
        kind: Its class; the annotation of each array says its shape, such as `k n+1`.
        sizes: What the names in shapes stand for.
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
    """Return the type of each array's figures and its shape; of a named tuple its class and None."""
    found: list[tuple[Any, list[str] | None]] = []
    for hint in get_type_hints(kind, include_extras=True).values():
        if get_origin(hint) is Annotated:
            _, array, shape = get_args(hint)
            found.append((str(array.dtype), shape.split()))
        else:
            found.append((hint, None))
    return found


class Problem(NamedTuple):
    """An instance for the kernels: ``n`` segments, ``k`` vehicles, ``p`` profiles, energies in percent of a battery."""

    profile: Ints
    """(k,): for each vehicle, which moves are its own."""
    move: Cube
    """(p, 2n, 2n): [., i, j] from the end of visit i to the end of visit j, for a consumption of 1."""
    move_into: Cube
    """(p, 2n, 2n): the same, [., j, i], so that all ways into a visit lie side by side in memory."""
    start: Table
    """(k, 2n): from the vehicle's start to the end of a visit."""
    home: Table
    """(k, 2n): from the end of a visit home."""
    idle: Floats
    """(k,): a route without a visit."""
    consumption: Floats
    """(k,): factor on ``move``."""
    budget: Floats
    """(k,): no route of the best plan that has a visit is over this."""
    value: Floats
    """(n,): what a plan loses by leaving a segment out; positive."""
    prize: Floats
    """(n,): the same in percent of a battery, as the search weighs it against energy."""
    effort: Floats
    """(n,): the least energy of a route of this segment alone."""
    near: IntTable
    """(n, m): the segments nearest to a segment, itself first."""
    twin: Ints
    """(k,): the vehicle before it that is equal in everything, -1 if there is none: of idle twins one is tried."""


class Weights(NamedTuple):
    """The objective that guides the search; its terms are added."""

    total: float
    """Of the sum of all routes' energies."""
    peak: float = 0.0
    """Of the largest."""
    norm: float = 0.0
    """Of their p-norm: a max that also feels the second largest."""
    power: float = 1.0
    """The p of it, a whole number."""
    scale: float = 1.0
    """Loads are divided by this before they are raised to p; positive."""
    prize: float = 0.0
    """Of the prizes of segments left out."""
    empty: float = 0.0
    """For each route without a visit; 0 unless all vehicles must fly."""
    excess: float = 0.0
    """Of the energy beyond budgets."""
    slack: float = 0.0
    """How far beyond its budget the search may take a route on its way, as a share of the budget."""


class State(NamedTuple):
    """Routes under work. ``k`` routes of at most ``n`` visits."""

    visits: Annotated[IntTable, "k n"]
    """The first ``lengths[r]`` entries of row r are the route."""
    legs: Annotated[Table, "k n+1"]
    """Energy of the move that ends with visit p; entry ``lengths[r]`` is the way home."""
    lengths: Annotated[Ints, "k"]
    loads: Annotated[Floats, "k"]
    """Energy of the route."""
    route_of: Annotated[Ints, "n"]
    """The route that visits the segment, -1 if none does."""


class SearchWorkspace(NamedTuple):
    """Work space of an annealing: lists, and the cheapest places found with the versions of the routes in question."""

    waiting: Annotated[Ints, "n"]
    pending: Annotated[Ints, "n"]
    keys: Annotated[Floats, "n"]
    touched: Annotated[Ints, "k"]
    """Zeros."""
    came_from: Annotated[IntTable, "n 2"]

    versions: Annotated[Ints, "k"]
    """Positive, counted up whenever a route changes for good."""
    version: Annotated[IntTable, "n k"]
    """Of the route when the place for the segment was looked for; 0 if never."""
    added: Annotated[Table, "n k"]
    """What the segment adds to the route there."""
    place: Annotated[IntTable, "n k"]
    """2 * position + 1 if it is visited in reverse."""
