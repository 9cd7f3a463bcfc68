"""Maths names for scalar code that runs in plain Python, compiles with Numba, and can be traced later.

Use `where, minimum, maximum, clip` instead of `if` on values, and `@jit` (or `@lean`) on the fast path.
Without Numba (or with NUMBA_DISABLE_JIT=1) the same source runs uncompiled.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from math import atan2, cos, exp, floor, log, pi, sin, sqrt, tan
from typing import Any, TypeVar

__all__ = [
    "COMPILED",
    "atan2",
    "clip",
    "cos",
    "exp",
    "floor",
    "inline",
    "jit",
    "lean",
    "log",
    "maximum",
    "merged",
    "minimum",
    "pi",
    "sign",
    "sin",
    "sqrt",
    "tan",
    "where",
]

F = TypeVar("F", bound=Callable[..., Any])

try:
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        raise ImportError
    import numba

    COMPILED = True
except ImportError:
    COMPILED = False


def jit(function: F) -> F:
    """Compile with Numba and cache on disk (see `parts.cache`); without Numba return the function as it is.

    Compiled calls release the interpreter, so that threads run them side by side.
    """
    return _compiled(function, _nrt=True)


def lean(function: F) -> F:
    """As `jit`, for steps that create no array and return none (views within are fine).

    Array arguments are then used without counting references, which in a step of nanoseconds costs more
    than the work itself: a step with ten arrays in its tuples takes 10 ns instead of 190 ns.
    """
    return _compiled(function, _nrt=False)


def inline(function: F) -> F:
    """As `lean`, and merged into every compiled caller: for small functions that take large tuples, whose
    copying would cost more than their work. A large function called several times is better left to
    `lean`."""
    return _compiled(function, _nrt=False, forceinline=True)


def merged(function: F) -> F:
    """As `lean`, and written into its compiled callers before they are typed.

    For helpers with one or two callers that take large tuples: nothing is passed, so they run faster, and the whole
    compiles in about half the time. A helper called in many places is better left to `lean`.
    """
    return _compiled(function, _nrt=False, inline="always")


def _compiled(function: F, **options: bool | str) -> F:
    # _nrt is always given: left out it would be taken from whichever caller happens to be compiled first.
    if not COMPILED:
        return function
    from .cache import cache_on_disk

    compiler = numba.njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True, **options)  # type: ignore[call-overload]
    compiled: F = cache_on_disk(compiler(function))
    return compiled


@jit
def where(condition: bool, a: float, b: float) -> float:
    """a if condition else b; both are evaluated."""
    return a if condition else b


@jit
def minimum(a: float, b: float) -> float:
    """The smaller of two numbers."""
    return a if a < b else b


@jit
def maximum(a: float, b: float) -> float:
    """The larger of two numbers."""
    return a if a > b else b


@jit
def clip(x: float, lo: float, hi: float) -> float:
    """x held within [lo, hi]."""
    return minimum(maximum(x, lo), hi)


@jit
def sign(x: float) -> float:
    """-1, 0 or 1."""
    return (1.0 if x > 0.0 else 0.0) - (1.0 if x < 0.0 else 0.0)
