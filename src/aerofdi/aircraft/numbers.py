"""The numbers of an aircraft as rows for a table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .types import Aircraft


class NumberRow(NamedTuple):
    """One number as text: where it is, what the file says, unit, source, whether assumed, note."""

    path: str
    value: str
    unit: str
    source: str
    assumed: bool
    note: str


def _text(value: object) -> str:
    array = np.asarray(value)
    if array.ndim == 0:
        return f"{float(array):g}"
    if array.size <= 6:
        return "[" + ", ".join(f"{float(x):g}" for x in array.ravel()) + "]"
    return f"{' x '.join(str(n) for n in array.shape)} table"


def number_rows(aircraft: Aircraft) -> list[NumberRow]:
    """Every number in the order and the unit of the file, with its source in full.

    >>> from aerofdi.aircraft import load_aircraft
    >>> number_rows(load_aircraft("vireo"))[0].path
    'reference.airspeed'
    """
    return [
        NumberRow(path, _text(n.given), n.unit, aircraft.sources[n.source], n.assumed, n.note)
        for path, n in aircraft.numbers.items()
    ]
