"""A test signal as a diagnoser: excites one surface after the other and judges nothing.

It rides in the closed loop like any active diagnoser, so the answer of the loop is measured where it will
be used: through the same actuators, sensors, autopilot and one-sample delay. `fourier_answer` reads it from
the flight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core import HEALTHY, Array, Channels, Diagnoser, Verdict
from ..parts.ops import lean, sin


class ExciterParams(NamedTuple):
    """Surface i gets amplitude[i] sin(omega[i] (t - start[i])) while start[i] <= t < stop[i]; (nu,) each,
    dt in s.
    """

    amplitude: Array
    omega: Array
    start: Array
    stop: Array
    dt: float


class ExciterState(NamedTuple):
    """k (1,): samples so far."""

    k: Array


def init(params: ExciterParams) -> ExciterState:
    return ExciterState(np.zeros(1))


@lean
def step_into(params: ExciterParams, state: ExciterState, z: Array, age: Array, out: Verdict, k: int) -> None:
    """Row k of out: what is added to the commands at the next sample."""
    state.k[0] += 1.0
    t = state.k[0] * params.dt
    for i in range(len(params.amplitude)):
        on = params.start[i] <= t < params.stop[i]
        out.excitation[k, i] = (
            params.amplitude[i] * sin(params.omega[i] * (t - params.start[i])) if on else 0.0
        )
    out.active[k, 0] = True
    out.status[k] = 0


@lean
def run_into(params: ExciterParams, state: ExciterState, z: Array, age: Array, out: Verdict) -> None:
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def exciter(
    surfaces: tuple[str, ...], amplitude: Array, omega: Array, start: Array, stop: Array, dt_s: float
) -> Diagnoser:
    """The test signal for these surfaces; arrays (nu,), rad, rad/s, s, s."""
    rad = ("rad",) * len(surfaces)
    names = tuple(f"command.{s}" for s in surfaces)
    params = ExciterParams(
        np.array(amplitude, float),
        np.array(omega, float),
        np.array(start, float),
        np.array(stop, float),
        float(dt_s),
    )
    return Diagnoser(
        "exciter", Channels(names, rad, (np.inf,) * len(names)), Channels(tuple(f"excitation.{s}" for s in surfaces), rad),
        (HEALTHY,), float(dt_s), True, params, init, step_into, run_into, (), tuple(float(a) for a in params.amplitude),
    )  # fmt: skip


def fourier_answer(command: Array, excitation: Array, omega: float, dt_s: float) -> complex:
    """R = C / E at omega over whole periods of equal-length records (n,); their mean and linear drift are
    taken out.

    R < 0 real: the command moves against the excitation, as a controller that corrects it does.
    """
    t = dt_s * np.arange(len(command))
    basis = np.column_stack([np.ones_like(t), t - t.mean(), np.cos(omega * t), np.sin(omega * t)])
    c, e = (np.linalg.lstsq(basis, np.asarray(x, float), rcond=None)[0] for x in (command, excitation))
    return complex((c[2] - 1j * c[3]) / (e[2] - 1j * e[3]))
