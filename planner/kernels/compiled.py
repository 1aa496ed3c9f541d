"""How kernels are compiled: for what their hints say, kept on disk, without Python's lock and numba's reference counts.

numba counts references to arrays with an atomic operation each, for every array of every named tuple that is handed on.
Without it (an option of its compiler that its documentation leaves out) an annealing is several times as fast, starts
in threads do not fight for the counters, and compiling takes half the time. A kernel without counts makes no array: its
work space is handed in.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, Protocol, TypeVar, get_args, get_origin, get_type_hints

import numba as nb

SCALARS = {int: nb.int64, float: nb.float64, bool: nb.boolean, type(None): nb.void}
LOGGER = logging.getLogger(__name__)
Function = TypeVar("Function", bound=Callable[..., object])


class Compiler(Protocol):
    """A decorator that leaves a function's types as they are."""

    def __call__(self, function: Function, /) -> Function:
        """Return the compiled function."""
        ...


def kernel(*, counted: bool = False, inline: bool = False) -> Compiler:
    """Return the decorator of a kernel that Python calls.

    Args:
        counted: whether it makes arrays of its own.
        inline: as ``inner`` has it.
    """
    options: dict[str, Any] = {} if counted else {"_nrt": False}
    return _build_compiler(forceinline=inline, **options)


def inner(*, inline: bool = False) -> Compiler:
    """Return the decorator of a kernel that only other kernels call.

    Args:
        inline: whether it is put into each of its callers, as short or hot ones are.
    """
    return _build_compiler(forceinline=inline, _nrt=False, no_cpython_wrapper=True)


def _build_compiler(**options: Any) -> Compiler:
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
