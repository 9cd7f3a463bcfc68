"""Compiled code on disk that knows everything it was compiled from.

Numba keeps compiled code next to its source and drops it when that one file changes. A loop compiled into
one piece with functions of other files would then go on running their old code. Here the stamp of a function
covers every file of its package that it can reach: the modules of all names its module holds, and of all
implementations registered with `parts.dispatch.by_type`, transitively.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from functools import cache
from types import ModuleType
from typing import Any

_OURS = __name__.partition(".")[0]


@cache
def _digest(path: str, changed_ns: int, size: int) -> bytes:
    with open(path, "rb") as f:
        return hashlib.sha256(f.read()).digest()


def _origins(value: Any) -> Iterator[str]:
    """Names of the modules a global value comes from."""
    if isinstance(value, ModuleType):
        yield value.__name__
        return
    origin = getattr(value, "__module__", None)
    if isinstance(origin, str):
        yield origin
    registered = getattr(value, "registered", None)
    if isinstance(registered, dict):
        for implementation in registered.values():
            yield implementation.__module__


def source_files(function: Callable[..., Any]) -> list[str]:
    """Every source file of its package (and of this one) that the function can reach, sorted."""
    packages = {_OURS, function.__module__.partition(".")[0]}
    seen: dict[str, str] = {}
    waiting = [function.__module__]
    while waiting:
        name = waiting.pop()
        module = sys.modules.get(name)
        path = getattr(module, "__file__", None)
        if name in seen or path is None or name.partition(".")[0] not in packages:
            continue
        seen[name] = path
        for value in list(vars(module).values()):
            waiting.extend(origin for origin in _origins(value) if origin not in seen)
    return sorted(set(seen.values()))


def stamp(function: Callable[..., Any]) -> str:
    """A digest of the content of `source_files(function)`."""
    total = hashlib.sha256()
    for path in source_files(function):
        if os.path.exists(path):
            status = os.stat(path)
            total.update(path.encode() + _digest(path, status.st_mtime_ns, status.st_size))
    return total.hexdigest()


def cache_on_disk(dispatcher: Any) -> Any:
    """The Numba dispatcher with a disk cache stamped with all its sources, or without where none can be kept.

    None can be kept for a function without a source file (typed at a prompt) or without any writable folder.
    """
    from numba.core.caching import FunctionCache

    class StampedCache(FunctionCache):
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            # Only now, at the first call, is everything imported and registered.
            self._cache_file._source_stamp = stamp(self._py_func)
            return super().load_overload(sig, target_context)

    with contextlib.suppress(RuntimeError):
        dispatcher._cache = StampedCache(dispatcher.py_func)
    return dispatcher
