"""The arrays that all kernels share.

Named tuples rather than classes: numba sees through them at no cost, and the arrays in them change in place.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

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

    visits: IntTable
    """(k, n): the first ``lengths[r]`` entries of row r are the route."""
    legs: Table
    """(k, n + 1): energy of the move that ends with visit p; entry ``lengths[r]`` is the way home."""
    lengths: Ints
    """(k,)"""
    loads: Floats
    """(k,): energy of the route."""
    route_of: Ints
    """(n,): the route that visits the segment, -1 if none does."""


class SearchWorkspace(NamedTuple):
    """Work space of an annealing: lists, and the cheapest places found with the versions of the routes in question."""

    waiting: Ints
    """(n,)"""
    pending: Ints
    """(n,)"""
    keys: Floats
    """(n,)"""
    touched: Ints
    """(k,): zeros."""
    came_from: IntTable
    """(n, 2)"""

    versions: Ints
    """(k,): positive, counted up whenever a route changes for good."""
    version: IntTable
    """(n, k): of the route when the place for the segment was looked for; 0 if never."""
    added: Table
    """(n, k): what the segment adds to the route there."""
    place: IntTable
    """(n, k): 2 * position + 1 if it is visited in reverse."""
