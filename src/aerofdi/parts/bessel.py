"""Bessel low-pass filters as second-order sections: nearly constant group delay, so a step does not ring.

The bandwidth is the -3 dB frequency in rad/s. Discretised by the bilinear transform with the bandwidth pre-warped.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from .ops import lean


def bessel_sections(order: int, bandwidth: float, dt_s: float) -> Array:
    """Sections (ceil(order/2), 5) of b0 b1 b2 a1 a2 for `sections_step`; unit gain at zero frequency.

    order: 1 to 10. bandwidth: rad/s, below the Nyquist frequency pi/dt_s. dt_s: s.

    >>> import numpy as np
    >>> sos = bessel_sections(5, 2.0, 0.01)
    >>> state = np.zeros((3, 2))
    >>> y = 0.0
    >>> for _ in range(1000):
    ...     y = sections_step(sos, state, 1.0)
    >>> round(y, 6)
    1.0
    """
    if not (0 < bandwidth * dt_s < math.pi):
        raise WrongUse(
            f"a Bessel low-pass of {bandwidth} rad/s at a period of {dt_s} s is at or above the Nyquist frequency "
            f"{math.pi / dt_s:.3g} rad/s; lower the bandwidth or the period"
        )
    from scipy.signal import bessel

    # scipy pre-warps and uses fs; a frequency normalised to Nyquist keeps that choice visible here.
    sos = bessel(order, bandwidth * dt_s / math.pi, btype="low", output="sos", norm="mag")
    return np.ascontiguousarray(sos[:, [0, 1, 2, 4, 5]])


@lean
def sections_step(sos: Array, state: Array, u: float) -> float:
    """One sample through all sections (transposed direct form II); `state` (n, 2) is advanced in place."""
    for i in range(sos.shape[0]):
        y = sos[i, 0] * u + state[i, 0]
        state[i, 0] = sos[i, 1] * u - sos[i, 3] * y + state[i, 1]
        state[i, 1] = sos[i, 2] * u - sos[i, 4] * y
        u = y
    return u


@lean
def sections_settle(sos: Array, state: Array, u: float) -> None:
    """Put the state where a constant input u would have left it (unit gain at zero frequency in all)."""
    for i in range(sos.shape[0]):
        gain = (sos[i, 0] + sos[i, 1] + sos[i, 2]) / (1.0 + sos[i, 3] + sos[i, 4])
        y = gain * u
        state[i, 1] = sos[i, 2] * u - sos[i, 4] * y
        state[i, 0] = sos[i, 1] * u - sos[i, 3] * y + state[i, 1]
        u = y
