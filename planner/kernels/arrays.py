"""The arrays that all kernels share, and how kernels are compiled: for what the names of their arrays say.

Named tuples rather than classes: numba sees through them at no cost, and the arrays in them change in place.

Kernels are kept on disk, without Python's lock and numba's reference counts. numba counts references to arrays with an
atomic operation each, for every array of every named tuple that is handed on. Without it (an option of its compiler
that its documentation leaves out) an annealing is several times as fast, starts in threads do not fight for the
counters, and compiling takes half the time. A kernel without counts makes no array: its work space is handed in.

numba notices a change in the file of a kernel, not in the files of the kernels that it calls (numba #1833), and by
default writes beside the sources, which may be read-only. So the kernels are cached in a directory of the user's,
one for each state of all their sources and each numba.
"""

from __future__ import annotations

import atexit
import hashlib
import logging
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numba
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


LOGGER = logging.getLogger(__name__)
SCALARS = {int: nb.int64, float: nb.float64, bool: nb.boolean, type(None): nb.void}
Function = TypeVar("Function", bound=Callable[..., object])


def kernel(*, counted: bool = False, inline: bool = False) -> Callable[[Function], Function]:
    """Return the decorator of a kernel that Python calls.

    Args:
        counted: whether it makes arrays of its own.
        inline: as ``inner`` has it.
    """
    options: dict[str, Any] = {} if counted else {"_nrt": False}
    return _build_compiler(forceinline=inline, **options)


def inner(*, inline: bool = False) -> Callable[[Function], Function]:
    """Return the decorator of a kernel that only other kernels call.

    Args:
        inline: whether it is put into each of its callers, as short or hot ones are.
    """
    return _build_compiler(forceinline=inline, _nrt=False, no_cpython_wrapper=True)


def _build_compiler(**options: Any) -> Callable[[Function], Function]:
    compile_for: Any = nb.njit

    def compile_function(function: Function) -> Function:
        hints = get_type_hints(function, include_extras=True)
        returns = find_type(hints.pop("return"))
        signature = returns(*map(find_type, hints.values()))
        compiled = compile_for(signature, cache=True, nogil=True, no_cfunc_wrapper=True, **options)(function)
        if compiled.stats.cache_misses:
            _log_compiling()
        made: Function = compiled
        return made

    return compile_function


@cache
def _log_compiling() -> None:
    """Log, once in a process, what a first start waits for."""
    LOGGER.info("compiling the planner for this computer, once: about half a minute")


def find_type(hint: Any) -> Any:
    """Return what numba compiles for, from the hint of an argument, a result or an entry of a named tuple."""
    if hint in SCALARS:
        return SCALARS[hint]
    if get_origin(hint) is Annotated:
        return hint.__metadata__[0]
    if get_origin(hint) is tuple:
        return nb.types.Tuple(tuple(map(find_type, get_args(hint))))
    entries = get_type_hints(hint, include_extras=True).values()
    return nb.types.BaseTuple.from_types(tuple(map(find_type, entries)), hint)


def use_cache() -> None:
    """Have numba keep the kernels that are declared from now on in ``make_cache_directory``."""
    numba.config.CACHE_DIR = str(make_cache_directory(numba.__version__))  # type: ignore[attr-defined] # set at run time


def compute_sources_digest(version: str) -> str:
    """Return a short digest of the kernels' sources and numba's ``version``."""
    digest = hashlib.sha256(version.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def make_cache_directory(version: str) -> Path:
    """Return a directory for compiled kernels, made and writable.

    It lies in NUMBA_CACHE_DIR if that is set, else in the user's cache directory. Where neither can be written it is
    a private one that goes when the process ends: a predictable name in a shared directory would let others plant
    code.
    """
    chosen = _find_user_cache() / f"kernels-{compute_sources_digest(version)}"
    try:
        chosen.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=chosen):
            return chosen
    except OSError:
        private = Path(tempfile.mkdtemp(prefix="faultline-kernels-"))
        atexit.register(shutil.rmtree, private, ignore_errors=True)
        return private


def _find_user_cache() -> Path:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "faultline"
