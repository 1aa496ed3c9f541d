"""Compiles kernels for the types in their annotations and caches them on disk.

Kernels are compiled without the GIL and without numba's reference counts. numba counts references to arrays with an
atomic operation for every array of every named tuple passed on. Without counts (a compiler option that numba does not
document) an annealing is several times as fast, starts in threads do not contend for the counters, and compiling takes
half the time. A kernel without counts allocates no array: the caller passes its work space.

numba notices a change in a kernel's own file, not in the files of the kernels that it calls (numba #1833), and by
default writes its cache next to the sources, which may be read-only. So the kernels are cached in a user directory, one
for each state of all their sources and each numba version.
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
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numba
import numba as nb

LOGGER = logging.getLogger(__name__)
SCALARS = {int: nb.int64, float: nb.float64, bool: nb.boolean, type(None): nb.void}
Function = TypeVar("Function", bound=Callable[..., object])


def kernel(*, counted: bool = False, inline: bool = False) -> Callable[[Function], Function]:
    """Return the decorator of a kernel that Python calls.

    Args:
        counted: whether the kernel allocates arrays.
        inline: as for ``inner``.
    """
    options: dict[str, Any] = {} if counted else {"_nrt": False}
    return _build_compiler(forceinline=inline, **options)


def inner(*, inline: bool = False) -> Callable[[Function], Function]:
    """Return the decorator of a kernel that only other kernels call.

    Args:
        inline: whether to inline it into each caller, for short or hot kernels.
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
    """Log once per process that the first start waits for compiling."""
    LOGGER.info("compiling the planner for this computer, once: about half a minute")


def find_type(hint: Any) -> Any:
    """Return the numba type for the annotation of an argument, a result or a named tuple field."""
    if hint in SCALARS:
        return SCALARS[hint]
    if get_origin(hint) is Annotated:
        return hint.__metadata__[0]
    if get_origin(hint) is tuple:
        return nb.types.Tuple(tuple(map(find_type, get_args(hint))))
    entries = get_type_hints(hint, include_extras=True).values()
    return nb.types.BaseTuple.from_types(tuple(map(find_type, entries)), hint)


def use_cache() -> None:
    """Set ``make_cache_directory`` as numba's cache for all kernels declared from now on."""
    numba.config.CACHE_DIR = str(make_cache_directory(numba.__version__))  # type: ignore[attr-defined] # set at run time


def compute_sources_digest(version: str) -> str:
    """Return a short digest of the kernels' sources and numba's ``version``."""
    digest = hashlib.sha256(version.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def make_cache_directory(version: str) -> Path:
    """Create and return a writable directory for compiled kernels.

    Uses NUMBA_CACHE_DIR if set, else the user's cache directory. If neither is writable, it is a private directory that
    is deleted when the process ends: a predictable name in a shared directory would let other users plant code.
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
