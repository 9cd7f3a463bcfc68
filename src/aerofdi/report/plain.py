"""Anything the house computes as plain JSON: arrays as lists, NaN and infinity as null."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from enum import Enum
from os import PathLike, fspath
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value in JSON's own types; NamedTuples become objects, unknown things their text.

    >>> import numpy as np
    >>> plain({"a": np.float64("nan"), 2: np.arange(2), "c": (True, None)})
    {'a': None, '2': [0, 1], 'c': [True, None]}
    """
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    return fspath(value) if isinstance(value, PathLike) else str(value)


def to_json(value: Any) -> str:
    """One JSON object as text, never with NaN in it."""
    return json.dumps(plain(value), allow_nan=False, ensure_ascii=False)
