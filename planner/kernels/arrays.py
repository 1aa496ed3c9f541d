"""The arrays that all kernels share, and their numba types.

Named tuples rather than classes: numba sees through them at no cost, and the arrays in them change in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
RandomState = npt.NDArray[np.uint64]


class Problem(NamedTuple):
    """An instance for the kernels: ``n`` segments, ``k`` vehicles, ``p`` profiles, energies in percent of a battery."""

    profile: IntArray
    """(k,): for each vehicle, which moves are its own."""
    move: FloatArray
    """(p, 2n, 2n): [., i, j] from the end of visit i to the end of visit j, for a consumption of 1."""
    move_into: FloatArray
    """(p, 2n, 2n): the same, [., j, i], so that all ways into a visit lie side by side in memory."""
    start: FloatArray
    """(k, 2n): from the vehicle's start to the end of a visit."""
    home: FloatArray
    """(k, 2n): from the end of a visit home."""
    idle: FloatArray
    """(k,): a route without a visit."""
    consumption: FloatArray
    """(k,): factor on ``move``."""
    budget: FloatArray
    """(k,): no route of the best plan that has a visit is over this."""
    value: FloatArray
    """(n,): what a plan loses by leaving a segment out; positive."""
    prize: FloatArray
    """(n,): the same in percent of a battery, as the search weighs it against energy."""
    effort: FloatArray
    """(n,): the least energy of a route of this segment alone."""
    near: IntArray
    """(n, m): the segments nearest to a segment, itself first."""
    twin: IntArray
    """(k,): the vehicle before it that is equal in everything, -1 if there is none: of idle twins one is tried."""


class Weights(NamedTuple):
    """The objective that guides the search; its terms are added."""

    total: float
    """Of the sum of all routes' energies."""
    peak: float
    """Of the largest."""
    norm: float
    """Of their p-norm: a max that also feels the second largest."""
    power: float
    """The p of it, a whole number."""
    scale: float
    """Loads are divided by this before they are raised to p; positive."""
    prize: float
    """Of the prizes of segments left out."""
    empty: float
    """For each route without a visit; 0 unless all vehicles must fly."""
    excess: float
    """Of the energy beyond budgets."""
    slack: float
    """How far beyond its budget the search may take a route on its way, as a share of the budget."""


class State(NamedTuple):
    """Routes under work. ``k`` routes of at most ``n`` visits."""

    visits: IntArray
    """(k, n): the first ``lengths[r]`` entries of row r are the route."""
    legs: FloatArray
    """(k, n + 1): energy of the move that ends with visit p; entry ``lengths[r]`` is the way home."""
    lengths: IntArray
    """(k,)"""
    loads: FloatArray
    """(k,): energy of the route."""
    route_of: IntArray
    """(n,): the route that visits the segment, -1 if none does."""


class SearchWorkspace(NamedTuple):
    """Work space of an annealing: lists, and the cheapest places found with the versions of the routes in question."""

    waiting: IntArray
    """(n,)"""
    pending: IntArray
    """(n,)"""
    keys: FloatArray
    """(n,)"""
    touched: IntArray
    """(k,): zeros."""
    came_from: IntArray
    """(n, 2)"""

    versions: IntArray
    """(k,): positive, counted up whenever a route changes for good."""
    version: IntArray
    """(n, k): of the route when the place for the segment was looked for; 0 if never."""
    added: FloatArray
    """(n, k): what the segment adds to the route there."""
    place: IntArray
    """(n, k): 2 * position + 1 if it is visited in reverse."""


FLOATS = nb.types.Array(nb.float64, 1, "C")
TABLE = nb.types.Array(nb.float64, 2, "C")
INTS = nb.types.Array(nb.int64, 1, "C")
INT_TABLE = nb.types.Array(nb.int64, 2, "C")
RANDOM = nb.types.Array(nb.uint64, 1, "C")
CUBE = nb.types.Array(nb.float64, 3, "C")
PROBLEM = nb.types.NamedTuple((INTS, CUBE, CUBE, TABLE, TABLE) + (FLOATS,) * 6 + (INT_TABLE, INTS), Problem)
WEIGHTS = nb.types.NamedUniTuple(nb.float64, 9, Weights)
STATE = nb.types.NamedTuple((INT_TABLE, TABLE, INTS, FLOATS, INTS), State)
MEMORY = nb.types.NamedTuple((INTS, INTS, FLOATS, INTS, INT_TABLE, INTS, INT_TABLE, TABLE, INT_TABLE), SearchWorkspace)
