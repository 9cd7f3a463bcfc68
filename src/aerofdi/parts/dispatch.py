"""One name, several implementations, chosen by the type of the parameters; compiles, caches, runs plain.

Numba cannot cache a function that takes functions as arguments. It can cache one chosen by the type of
a NamedTuple, so that a single compiled loop serves every kind of aerodynamics, propulsion or autopilot, and
only the kinds in use are compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from .ops import COMPILED

__all__ = ["ByType", "by_type"]


class ByType(Protocol):
    """A callable `f(params, *rest)` with `f.register(params_type)` as a decorator for implementations."""

    registered: dict[type, Any]

    def __call__(self, params: Any, *rest: Any) -> Any: ...

    def register(self, params_type: type) -> Callable[[Any], Any]: ...


def by_type(name: str) -> Any:
    """A function `f(params, *rest)` that calls what is registered for type(params), a NamedTuple class.

    Callable from plain Python and from inside `@jit` functions alike; compiled callers are specialised to the
    type and stay cacheable. An implementation must itself be a `@jit` function and be registered before the
    first call.

    >>> from typing import NamedTuple
    >>> from aerofdi.parts.ops import jit
    >>> class Gain(NamedTuple):
    ...     k: float
    >>> control = by_type("control")
    >>> @control.register(Gain)
    ... @jit
    ... def gain(params, error):
    ...     return params.k * error
    >>> control(Gain(2.0), 3.0)
    6.0
    """
    table: dict[type, Any] = {}

    def choose(params: Any, *rest: Any) -> Any:
        implementation = table.get(type(params))
        if implementation is None:
            known = ", ".join(sorted(c.__name__ for c in table)) or "nothing"
            raise TypeError(f"{name} knows {known}; {type(params).__name__} is not registered")
        return implementation(params, *rest)

    def register(params_type: type) -> Callable[[Any], Any]:
        def decorate(implementation: Any) -> Any:
            table[params_type] = implementation
            return implementation

        return decorate

    choose.__name__ = choose.__qualname__ = name
    choose.register = register  # type: ignore[attr-defined]
    choose.registered = table  # type: ignore[attr-defined]
    if COMPILED:
        from numba.extending import overload

        # strict=False: the stub's parameter names differ from the implementations', which is the point.
        @overload(choose, strict=False, jit_options={"forceinline": True})
        def _choose(params: Any, *rest: Any) -> Any:
            implementation = table.get(getattr(params, "instance_class", None))  # type: ignore[arg-type]
            if implementation is None:
                return None

            def call(params: Any, *rest: Any) -> Any:
                return implementation(params, *rest)

            return call

    return choose
