"""The block diagrams of method B: closed-loop aircraft as seen by the two filters of `lpv_observer`.

Lateral (Figures 6 and 7 of the paper), inputs w, du, dy1, dy2, dr and, where asked for, df; outputs v, delta,
phi_cmd, phi_n, p_n:

    u_g = delta + w -> G -> phi, p                    v = W_Delta delta,  w = Delta v,  |Delta| <= 1
    phi_cmd = Wr dr,  phi_n = phi + Wy1 dy1,  p_n = p + Wy2 dy2      the controller sees what the filter sees
    xi' = phi_cmd - phi_n - leak xi
    delta_c = k_i xi + k_p (phi_cmd - phi_n) + k_d p_n,   delta = G_a (delta_c + Wu du) + Wf df

Longitudinal (Figure 10), inputs w, du, dy and, where asked for, df; outputs v, delta, q_n:

    u_g = delta + w -> G -> q,   q_n = q + Wy dy,   delta_c = k_q q_n,   delta = G_a (delta_c + Wu du) + Wf df

df is the fault: the difference between the true deflection and what the healthy actuator would give. The
published diagrams have none, so their filters never see the loop opened by a stuck surface (see
`lpv_observer`). A stuck surface is a step in df minus the loop's own reaction; Wf shapes it.

Signs: phi_n enters the roll controller without a minus of its own (k_p, k_i < 0 for a surface that rolls left
when positive); k_q > 0 damps where positive elevator pitches down. leak makes the integrator of the design
model stable and observable: xi' is a function of measured signals, so without it [C3 D3] has an invariant
zero at s = 0; gamma does not change from 1e-4 to 1e-2 rad/s.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial
from typing import NamedTuple

import numpy as np

from ..core import Array
from .estimator import Estimation
from .lpv import Gridded, connect, gain, gridded, transfer

LAT_STATES = ("v", "p", "r", "phi")
LON_STATES = ("q", "w")
LAT_MEASURED = ("phi_cmd", "phi_n", "p_n")
LON_MEASURED = ("q_n",)


class Ratio(NamedTuple):
    """A transfer function num(s)/den(s), highest power first."""

    num: tuple[float, ...]
    den: tuple[float, ...]

    def block(self, inp: str, out: str) -> Gridded:
        """As a system."""
        return transfer(self.num, self.den, inp, out)

    def gain_at(self, w_rad_s: float) -> float:
        """|num(jw)/den(jw)|."""
        s = 1j * w_rad_s
        return float(abs(np.polyval(self.num, s) / np.polyval(self.den, s)))


class Weights(NamedTuple):
    """Sizes of the normalised inputs and shapes over frequency (Tables 2 and 3).

    actuator: Wu, rad. noise: Wy per measured motion, rad or rad/s. command: Wr, rad (0: none). uncertainty:
    W_Delta. error: W, the inverse of the wanted sensitivity. fault: Wf; num 0 leaves the fault input out.
    """

    actuator: float
    noise: tuple[float, ...]
    command: float
    uncertainty: Ratio
    error: Ratio
    fault: Ratio = Ratio((0.0,), (1.0,))


class Controller(NamedTuple):
    """Gains of the loop the aircraft flies in: roll k_p (rad/rad), k_i (1/s), k_d (s); pitch rate k_q (s);
    leak, rad/s.
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    kq: float = 0.0
    leak: float = 0.01


def delay_free_actuator(servo: Gridded, delay_s: float, pade: int = 5, drop: int = 2) -> Gridded:
    """A servo behind a transport delay, rational: Pade approximation, balanced, `drop` states residualised
    (gain at rest kept).

    With wn = 62.8 rad/s, zeta = 0.77 and 0.05 s this is (18) of the paper within 0.004 at every frequency.
    Without a delay: the servo.
    """
    servo = servo._replace(inputs=("x",), outputs=("y",))
    if not delay_s:
        return servo._replace(inputs=("u",))
    n = pade
    c = [
        factorial(2 * n - k) * factorial(n) / (factorial(2 * n) * factorial(k) * factorial(n - k))
        for k in range(n + 1)
    ]
    num = [c[k] * (-delay_s) ** k for k in range(n, -1, -1)]
    den = [c[k] * delay_s**k for k in range(n, -1, -1)]
    full = connect([transfer(num, den, "u", "x"), servo], ["u"], ["y"])
    A, B, C = _balanced(full.A[0], full.B[0], full.C[0])
    k = A.shape[0] - drop
    fast = np.linalg.solve(A[k:, k:], np.hstack((A[k:, :k], B[k:])))
    reduced = np.hstack((A[:k, :k], B[:k])) - A[:k, k:] @ fast
    out = np.hstack((C[:, :k], full.D[0])) - C[:, k:] @ fast
    return gridded([0.0], reduced[:, :k], reduced[:, k:], out[:, :k], out[:, k:], ("u",), ("y",))


def _balanced(A: Array, B: Array, C: Array) -> tuple[Array, Array, Array]:
    """Balanced coordinates; A is scaled first, companion forms are badly scaled."""
    from scipy.linalg import cholesky, matrix_balance, solve_continuous_lyapunov

    Ab, T = matrix_balance(A)
    Bb, Cb = np.linalg.solve(T, B), C @ T
    Lc = cholesky(solve_continuous_lyapunov(Ab, -Bb @ Bb.T), lower=True)
    Lo = cholesky(solve_continuous_lyapunov(Ab.T, -Cb.T @ Cb), lower=True)
    _, s, Vt = np.linalg.svd(Lo.T @ Lc)
    T = Lc @ Vt.T / np.sqrt(s)
    return np.linalg.solve(T, Ab @ T), np.linalg.solve(T, Bb), Cb @ T


Matrices = Callable[[Array], tuple[Array, Array]]


def _fault(weights: Weights, inputs: tuple[str, ...]) -> tuple[list[Gridded], tuple[str, ...]]:
    """delta = actuator output (+ fault), and the inputs with or without df."""
    if not any(weights.fault.num):
        return [gain("delta", {"moved": 1.0})], inputs
    return [weights.fault.block("df", "f"), gain("delta", {"moved": 1.0, "f": 1.0})], (*inputs, "df")


def lateral_plant(model: Matrices, actuator: Gridded, weights: Weights, k: Controller, V: Array) -> Gridded:
    """Figure 7. model: airspeeds -> (A (N, 4, 4), B (N, 4, 1)) with states v, p, r, phi and the aileron in
    rad.
    """
    A, B = model(V)
    C = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]])
    fault, inputs = _fault(weights, ("w", "du", "dy1", "dy2", "dr"))
    blocks = [
        gridded(V, A, B, C, np.zeros((2, 1)), ("ug",), ("phi", "p")),
        gain("ug", {"delta": 1.0, "w": 1.0}),
        weights.uncertainty.block("delta", "v"),
        gain("phi_cmd", {"dr": weights.command}),
        gain("phi_n", {"phi": 1.0, "dy1": weights.noise[0]}),
        gain("p_n", {"p": 1.0, "dy2": weights.noise[1]}),
        transfer([1.0], [1.0, k.leak], "miss", "xi"),
        gain("miss", {"phi_cmd": 1.0, "phi_n": -1.0}),
        gain("ua", {"xi": k.ki, "miss": k.kp, "p_n": k.kd, "du": weights.actuator}),
        actuator._replace(inputs=("ua",), outputs=("moved",)),
        *fault,
    ]
    return connect(blocks, inputs, ("v", "delta", *LAT_MEASURED))


def longitudinal_plant(
    model: Matrices, actuator: Gridded, weights: Weights, k: Controller, V: Array
) -> Gridded:
    """Figure 10. model: airspeeds -> (A (N, 2, 2), B (N, 2, 1)) with states q, w and the elevator in rad."""
    A, B = model(V)
    fault, inputs = _fault(weights, ("w", "du", "dy"))
    blocks = [
        gridded(V, A, B, [[1.0, 0.0]], [[0.0]], ("ug",), ("q",)),
        gain("ug", {"delta": 1.0, "w": 1.0}),
        weights.uncertainty.block("delta", "v"),
        gain("q_n", {"q": 1.0, "dy": weights.noise[0]}),
        gain("ua", {"q_n": k.kq, "du": weights.actuator}),
        actuator._replace(inputs=("ua",), outputs=("moved",)),
        *fault,
    ]
    return connect(blocks, inputs, ("v", "delta", *LON_MEASURED))


def estimation(
    axis: str,
    model: Matrices,
    actuator: Gridded,
    weights: Weights,
    k: Controller,
    robust: bool,
    psi_poles: tuple[float, ...],
) -> Estimation:
    """The estimation problem of one axis, "lat" or "lon"; nominal problems have no w and v."""
    plant = lateral_plant if axis == "lat" else longitudinal_plant
    measured = LAT_MEASURED if axis == "lat" else LON_MEASURED
    inputs = ("du", "dy1", "dy2", "dr") if axis == "lat" else ("du", "dy")
    d = (*inputs, "df") if any(weights.fault.num) else inputs

    def on(V: Array) -> Gridded:
        full = plant(model, actuator, weights, k, V)
        return full if robust else full.select(d, ("delta", *measured))

    return Estimation(
        on, "delta", measured, d, weights.error.block("e", "ebar"), ("w", "v") if robust else None, psi_poles
    )


def unweighted(
    axis: str, model: Matrices, actuator: Gridded, weights: Weights, k: Controller
) -> Callable[[Array], Gridded]:
    """The loop with every weight one except W_Delta and the fault entering directly: inputs w, ..., df; for
    the analysis.

    "-delta -> e" of Figures 9, 12 and 13 is read as: df added to the deflection behind the actuator, loop
    closed, to the error deltahat - delta (sign dropped).
    """
    one = Ratio((1.0,), (1.0,))
    plain = weights._replace(actuator=1.0, noise=(1.0,) * len(weights.noise), command=1.0, fault=one)
    plant = lateral_plant if axis == "lat" else longitudinal_plant
    return lambda V: plant(model, actuator, plain, k, V)
