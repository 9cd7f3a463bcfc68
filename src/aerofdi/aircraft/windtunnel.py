"""Wind-tunnel tables: a TOML file of axes and coefficients beside the aircraft file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from .lines import read_toml
from .schema import WIND_TUNNEL
from .units import DEG

_ANGLES = ("alpha", "beta", "deflection")


def read_tables(path: Path) -> dict[str, Array]:
    """Every table and axis of a wind-tunnel file as `table.axis` and `table.data`; angles in rad.

    Raises WrongUse with file and line for a missing table, an axis that does not increase, or a wrong shape.
    """
    document, lines = read_toml(path)
    out: dict[str, Array] = {}

    def refuse(at: tuple[str, ...], message: str) -> WrongUse:
        line = next((lines[at[:i]] for i in range(len(at), 0, -1) if at[:i] in lines), 1)
        return WrongUse(f"{path}, line {line}: {message}")

    known = {*WIND_TUNNEL, "source", "angle_unit"}
    for key in document:
        if key not in known:
            raise refuse((key,), f"unknown table {key!r}; known: {', '.join(sorted(known))}")
    unit = document.get("angle_unit")
    if unit not in ("deg", "rad") or not isinstance(document.get("source"), str):
        raise refuse(
            ("angle_unit",), "a wind-tunnel file needs angle_unit = 'deg' or 'rad', and source = a text"
        )
    scale = DEG if unit == "deg" else 1.0
    for name, (axes, coefficients) in WIND_TUNNEL.items():
        table: Any = document.get(name)
        if not isinstance(table, dict) or set(table) != {*axes, "data"}:
            raise refuse((name,), f"table [{name}] must have exactly {', '.join(axes)} and data")
        shape: tuple[int, ...] = ()
        for axis in axes:
            x = np.array(table[axis], dtype=float)
            if x.ndim != 1 or len(x) < 2 or not np.isfinite(x).all() or (np.diff(x) <= 0.0).any():
                raise refuse(
                    (name, axis), f"{name}.{axis} must be two or more numbers that increase strictly"
                )
            out[f"{name}.{axis}"] = x * (scale if axis in _ANGLES else 1.0)
            shape = (*shape, len(x))
        shape = (*shape, coefficients) if coefficients else shape
        try:
            data = np.array(table["data"], dtype=float)
        except (TypeError, ValueError):
            raise refuse((name, "data"), f"{name}.data must be a table of numbers of shape {shape}") from None
        if data.shape != shape or not np.isfinite(data).all():
            raise refuse((name, "data"), f"{name}.data has shape {data.shape}, expected {shape}, all finite")
        out[f"{name}.data"] = data
    return out
