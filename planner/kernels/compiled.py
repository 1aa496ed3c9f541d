"""How kernels are compiled: one signature each, kept on disk, free of Python's lock and of numba's reference counts.

numba counts references to arrays with an atomic operation each, for every array of every named tuple that is handed on.
Without it (an option of its compiler that its documentation leaves out) an annealing is several times as fast, starts
in threads do not fight for the counters, and compiling takes half the time. A kernel without counts makes no array: its
work space is handed in.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import numba as nb

Function = TypeVar("Function", bound=Callable[..., object])


class Compiler(Protocol):
    """A decorator that leaves a function's types as they are."""

    def __call__(self, function: Function, /) -> Function:
        """Return the compiled function."""
        ...


def kernel(signature: object, *, counted: bool = False, inline: bool = False) -> Compiler:
    """Return the decorator of a kernel that Python calls.

    Args:
        signature: the one that it is compiled for.
        counted: whether it makes arrays of its own.
        inline: as ``inner`` has it.
    """
    options: dict[str, Any] = {} if counted else {"_nrt": False}
    return _build_compiler(signature, forceinline=inline, **options)


def inner(signature: object, *, inline: bool = False) -> Compiler:
    """Return the decorator of a kernel that only other kernels call.

    Args:
        signature: the one that it is compiled for.
        inline: whether it is put into each of its callers, as short or hot ones are.
    """
    return _build_compiler(signature, forceinline=inline, _nrt=False, no_cpython_wrapper=True)


def _build_compiler(signature: object, **options: Any) -> Compiler:
    compile_for: Any = nb.njit
    compiler: Compiler = compile_for(signature, cache=True, nogil=True, no_cfunc_wrapper=True, **options)
    return compiler
