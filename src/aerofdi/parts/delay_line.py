"""A transport delay of any length, in samples, as a ring buffer that holds its own place.

The input is a held signal (constant over each step). Delayed by D + f samples, D whole and 0 <= f < 1, it
changes inside the step; its mean over step k is

    y[k] = (1 - f) u[k - D] + f u[k - D - 1]

which is what the line returns: exact for whole delays, and exact in the mean over each step for others.
Delay 0 returns the input of the same step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import WrongUse
from .ops import lean


def delay_line(delay: float, value: float = 0.0) -> NDArray[np.float64]:
    """A line long enough for `delay` samples, filled with `value`, as one array: [place, ring...].

    >>> line = delay_line(2.0)
    >>> [delay_step(line, u, 2.0) for u in (1.0, 2.0, 3.0, 4.0)]
    [0.0, 0.0, 1.0, 2.0]
    """
    if not (delay >= 0 and math.isfinite(delay)):
        raise WrongUse(f"a delay is a number of samples, 0 or more, not {delay!r}")
    line = np.full(delay_width(delay), float(value))
    line[0] = 0.0
    return line


def delay_width(delay: float) -> int:
    """Length of the array for a delay of up to `delay` samples."""
    return math.floor(delay) + 3


@lean
def delay_fill(line: NDArray[np.float64], value: float) -> None:
    """As if the input had been `value` for ever."""
    for i in range(1, len(line)):
        line[i] = value


@lean
def delay_step(line: NDArray[np.float64], u: float, delay: float) -> float:
    """Put this step's input in, take out the input of `delay` samples ago (held within the line's length).

    The delay may change from step to step; it is held within [0, len(line) - 3 + 1).
    """
    n = len(line) - 1
    place = int(line[0])
    line[1 + place] = u
    whole = min(int(delay), n - 2)
    part = min(delay - whole, 1.0)
    # Places wrap by comparison: a division would cost more than all the rest.
    newer = place - whole
    newer += n if newer < 0 else 0
    older = newer - 1
    older += n if older < 0 else 0
    line[0] = 0.0 if place + 1 == n else place + 1.0
    # Written so that a whole delay returns the stored value to the bit.
    return line[1 + newer] + part * (line[1 + older] - line[1 + newer])
