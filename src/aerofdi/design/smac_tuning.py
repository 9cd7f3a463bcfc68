"""The tuning strategy of SMAC-FDI as functions, each with its equation number.

A linear single-axis model of the turn rate chi and its Kalman-type filter, a_ b_ their model, L the gain:

    chi' = a chi + b delta,    chi_^' = a_ chi_^ + b_ delta_c + L (chi - chi_^)                      (6), (8)
    residual' = -(L - a_) residual + b_ (delta - delta_c + gamma)                                  (9), (11)

gamma gathers every uncertainty (torque error, noise, wind) as an equivalent deflection in rad. Source:
paper "smac", sections 3.2 to 3.4. Symbols: A excitation amplitude (rad), omega its frequency (rad/s), Ts
sample period (s).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..core import Array, CannotJudge, WrongUse
from ..diagnosers.smac_ekf import RateModel, transition


class Window(NamedTuple):
    """Bounds (12) of a residual threshold, rad/s: above `low` no uncertainty reaches it, below `high` the
    fault does.
    """

    low: float
    high: float


def filter_gain(model: RateModel, airspeed: float) -> tuple[Array, Array]:
    """Steady-state gain of the filter in straight flight and its transition: L (3, 3), phi (3, 3)."""
    F = np.reshape(transition(model, 0.0, 0.0, 0.0, 0.5 * model.rho * airspeed), (3, 3))
    phi = np.eye(3) + F * model.dt
    from scipy.linalg import solve_discrete_are

    Q = _integral(F, np.diag(model.process_noise), model.dt)
    P = solve_discrete_are(phi.T, np.eye(3), Q, np.diag(model.rate_noise))
    return np.linalg.solve(P + np.diag(model.rate_noise), P).T, phi


def _integral(F: Array, R_w: Array, T: float) -> Array:
    """Integral of (I + F t) R_w (I + F t)' over [0, T] (4), written out."""
    return R_w * T + (F @ R_w + R_w @ F.T) * T**2 / 2 + F @ R_w @ F.T * T**3 / 3


def stiffness(model: RateModel, airspeed: float) -> Array:
    """L - a_ of (9) for each axis, (3,), 1/s; (10) asks that it is positive. Exact for the sampled filter."""
    L, phi = filter_gain(model, airspeed)
    return np.asarray((1.0 - np.diag(phi @ (np.eye(3) - L))) / model.dt)


def residual_response(model: RateModel, airspeed: float, omega: float = 0.0) -> Array:
    """Residual (3, nu) per rad of delta - delta_c at a frequency, complex; real at omega = 0, where it is
    b_/(L - a_).

    y - x(k|k-1) of the sampled filter with y = 0: x(k+1|k) = phi (I - L) x(k|k-1) + Ts B u, B the
    acceleration per rad.
    """
    L, phi = filter_gain(model, airspeed)
    B = model.force[:, 3:] * 0.5 * model.rho * airspeed**2 * model.dt
    z = cmath.exp(1j * omega * model.dt)
    return np.asarray(np.linalg.solve(z * np.eye(3) - phi @ (np.eye(3) - L), B.astype(complex)))


def steady_residual(b: float, L_minus_a: float, deviation: float, uncertainty: float = 0.0) -> float:
    """(11): residual in rad/s after a fault that leaves delta - delta_c = deviation (rad), uncertainty
    gamma (rad).
    """
    return b * (deviation + uncertainty) / _positive(L_minus_a)


def smallest_detectable(uncertainty: float) -> float:
    """(13): |delta - delta_c| below which a fault cannot be told from the uncertainty sup|gamma|, rad."""
    return 2.0 * uncertainty


def threshold_window(
    b: float, L_minus_a: float, fault: float, uncertainty: Mapping[str, float], axis: str = "this axis"
) -> Window:
    """(12): the window in which a residual threshold must lie.

    b: rad/s2 per rad. fault: smallest |delta - delta_c| to be found, rad. uncertainty: cause -> its part of
    sup|gamma|, rad; they add up. Raises CannotJudge where the window is empty, which by (13) is where fault
    <= 2 sup|gamma|, naming the largest cause and how far it must come down.

    >>> w = threshold_window(41.0, 30.0, 0.035, {"torque error": 0.004, "noise": 0.006})
    >>> round(w.low, 4), round(w.high, 4)
    (0.0137, 0.0342)
    """
    gamma = sum(uncertainty.values())
    if not (b > 0 and fault > 0 and all(g >= 0 for g in uncertainty.values())):
        raise WrongUse("threshold_window needs b and fault above 0 and no negative uncertainty")
    window = Window(b * gamma / _positive(L_minus_a), b * (fault - gamma) / L_minus_a)
    if not window.low < window.high:
        cause = max(uncertainty, key=lambda k: uncertainty[k])
        spare = 0.5 * fault - (gamma - uncertainty[cause])
        move = (
            f"reduce {cause!r} from {math.degrees(uncertainty[cause]):.2f} deg to below {math.degrees(spare):.2f} deg"
            if spare > 0
            else f"reduce {cause!r} and the others together to below {math.degrees(fault) / 2:.2f} deg"
        )
        raise CannotJudge(
            f"no threshold of {axis} finds a deviation of {math.degrees(fault):.2f} deg: the uncertainties add up to "
            f"{math.degrees(gamma):.2f} deg and (13) asks for less than half the fault; {move}, or accept "
            f"{math.degrees(2 * gamma):.2f} deg as the smallest fault"
        )
    return window


def excited_residual(
    b: float, L_minus_a: float, A: float, omega: float, deviation: float
) -> tuple[float, float, float]:
    """(16): C1 (rad/s), C2 (rad/s), phi0 (rad) of the residual C1 - C2 sin(omega t - phi0) of an excited
    stuck surface.
    """
    _positive(L_minus_a)
    return b * deviation / L_minus_a, b * A / math.hypot(omega, L_minus_a), math.atan2(omega, L_minus_a)


def lambda_max(A: float) -> float:
    """(20): Lambda of a surface that does not answer at all, 2A/pi, rad."""
    return 2.0 * A / math.pi


def smallest_amplitude(command_std: float, answer: float, deviations: float) -> float:
    """The least A at which a sound and a dead surface are `deviations` standard deviations apart, rad.

    Section 3.3 asks for A as large as the aircraft tolerates; this is the other bound. command_std: standard
    deviation of one quadrature of the amplitude that the command has by itself at the test frequency over
    one window, rad. answer: |C/E| of a sound surface.
    """
    if not min(command_std, answer, deviations) > 0:
        raise WrongUse(
            f"smallest_amplitude needs a positive standard deviation, answer and number of deviations, but was given "
            f"{command_std}, {answer} and {deviations}"
        )
    return deviations * command_std / answer


def opposite_delay(answer: complex, omega: float, dt_s: float) -> int:
    """lambda of (17): the delay in samples that puts the excitation in opposite phase to the answer R =
    C/E.
    """
    lag = cmath.phase(-1.0 / answer) % (2.0 * math.pi)
    return round((lag if lag < 1.5 * math.pi else 0.0) / omega / dt_s)


def mean_frequency(epsilon: float, settle_s: float) -> float:
    """(18), (19): lowest f_i1 in Hz with which the mean is known within epsilon (relative) after settle_s."""
    if not (0 < epsilon < 1 and settle_s > 0):
        raise WrongUse(
            f"epsilon {epsilon} and settle_s {settle_s} were given; 0 < epsilon < 1 and settle_s > 0 are accepted"
        )
    return math.log(1.0 / epsilon) / (2.0 * math.pi * settle_s)


def lone_loop(answer: complex, twins: int) -> complex:
    """Loop gain L1 through one surface, from its answer with `twins` sound twins: R = -L1 / (1 + (1 +
    twins) L1).
    """
    rho = answer / (1.0 + answer)
    return -rho / (1.0 + twins * rho)


def lone_answer(loop: complex) -> complex:
    """Answer of a sound surface whose twins are all stuck: -L1 / (1 + L1)."""
    return -loop / (1.0 + loop)


def common_answer(shared: complex, alone: complex) -> complex:
    """The reference R0 in whose direction both answers of a sound surface, shared and alone, project to at
    least 1.

    It is the point nearest to 0 of the segment between them: Re(R / R0) >= 1 for both, 0 for no answer, and
    no other direction lets noise weigh less.
    """
    along = alone - shared
    if abs(along) < 1e-9 * abs(shared):
        return shared
    step = -(shared * along.conjugate()).real / abs(along) ** 2
    return shared + min(max(step, 0.0), 1.0) * along


def share(frequency_hz: float, dt_s: float) -> float:
    """1 - exp(-2 pi f Ts): the step of an exactly sampled first-order low-pass with a held input."""
    return 1.0 - math.exp(-2.0 * math.pi * frequency_hz * dt_s)


def low_pass(frequency_hz: float, omega: float, dt_s: float) -> complex:
    """Response of that low-pass at omega."""
    a = share(frequency_hz, dt_s)
    return a / (1.0 - (1.0 - a) * cmath.exp(-1j * omega * dt_s))


def _positive(L_minus_a: float) -> float:
    if not L_minus_a > 0:
        raise WrongUse(
            f"the filter does not converge: L - a = {L_minus_a:.3g} 1/s must be positive (10); raise R_w"
        )
    return L_minus_a
