"""The filter bank of multiple-model adaptive estimation: nominal plus one steady-state Kalman filter per
stuck surface.

From a continuous linear model x' = A x + B d (d surface deflections, rad about neutral or about trim, see
below) sampled with a zero-order hold, k delay states per measured signal, and for each suspect l its
deflection as a state:

    [x; y1; ...; yk; d_l](k+1) = [A_d ... B_d(:, l); shift; ... 1] [...] + [B_d(:, j); 0; 0] d_j(k),  j != l
    (11)

with y1 = C x and the measurement yk. Gains from the discrete Riccati equation. See `diagnosers.mmae` for the
rest.

The model is a perturbation about a trim, whose deflections are taken off the commands (and put back on
estimates). They need not be known where they cancel in B, as those of a left and a right surface do in a
lateral model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..core import Array, Design, WrongUse
from ..diagnosers.mmae import LOW_PASS_ORDER, PAPER
from ..parts.bessel import bessel_sections
from ..parts.lti import hold


class Tuning(NamedTuple):
    """Everything that is chosen, not modelled; SI and radians.

    state_std: per state, per sample. measured: signal -> standard deviation of its noise; these drive the
    filters. weight: signal -> entry of W (13), for all signals compared. stuck_std: per sample, of the
    wandering stuck position. delay: samples of pure delay before the measured signals; command_delay: samples
    before the actuators, any number. compare_delay: samples
    by which the prediction of a signal that is compared but not measured is held back. low_pass: bandwidth of
    the fifth-order Bessel filters, rad/s. gain, threshold, quorum: of (14). prior: of the healthy model; the
    rest share what is left. floor: lowest probability. rule: PAPER or TEXTBOOK. settle_s, max_gap_s,
    max_age_s: see `diagnosers.mmae.step_into`.
    """

    state_std: Mapping[str, float]
    measured: Mapping[str, float]
    weight: Mapping[str, float]
    stuck_std: float = 1e-3
    delay: int = 0
    command_delay: float = 0.0
    compare_delay: int = 1
    low_pass: float = 5.0
    gain: float = 0.04
    threshold: float = 0.08
    quorum: int = 2
    prior: float = 0.98
    floor: float = 0.01
    rule: int = PAPER
    settle_s: float = 3.0
    max_gap_s: float = 0.5
    max_age_s: float = 0.2


def _check(states: Sequence[str], surfaces: Sequence[str], suspects: Sequence[str], t: Tuning) -> None:
    for what, given, known in (
        ("state_std", t.state_std, states),
        ("measured", t.measured, states),
        ("weight", t.weight, states),
        ("suspects", suspects, surfaces),
    ):
        unknown = [name for name in given if name not in known]
        if unknown:
            raise WrongUse(f"mmae: {what} names {', '.join(unknown)}, but the model has {', '.join(known)}")
    missing = [s for s in states if s not in t.state_std]
    if missing:
        raise WrongUse(
            f"mmae: state_std needs {', '.join(missing)}; give a standard deviation per sample for each"
        )
    if not t.measured or not suspects:
        raise WrongUse("mmae: at least one measured signal and one suspect surface are needed")
    if not 0.0 < t.floor < 1.0 / (len(suspects) + 1) or not t.floor <= t.prior < 1.0:
        raise WrongUse(
            f"mmae: floor {t.floor} and prior {t.prior} were given; 0 < floor < 1/{len(suspects) + 1} and "
            f"floor <= prior < 1 are accepted"
        )


def _augment(Ad: Array, Bd: Array, C: Array, delay: int, stuck: int) -> tuple[Array, Array, Array]:
    """(A, B, C) of (10) or, with stuck >= 0, of (11), padded to one size: the last state is the stuck
    position.
    """
    n, m = Bd.shape
    ny = len(C)
    size = n + delay * ny + 1
    A, B = np.zeros((size, size)), np.zeros((size, m))
    A[:n, :n], B[:n] = Ad, Bd
    for d in range(delay):
        rows = slice(n + d * ny, n + (d + 1) * ny)
        A[rows, slice(n + (d - 1) * ny, n + d * ny) if d else slice(0, n)] = np.eye(ny) if d else C
    if stuck >= 0:
        A[:n, -1], B[:n, stuck] = Bd[:, stuck], 0.0
        A[-1, -1] = 1.0
    out = np.zeros((ny, size))
    out[:, size - 1 - ny : size - 1] = np.eye(ny) if delay else 0.0
    if not delay:
        out[:, :n] = C
    return A, B, out


def kalman(A: Array, C: Array, Q: Array, R: Array) -> tuple[Array, Array, Array, Array]:
    """Steady state: gain L (n, ny), innovation covariance S, filtered covariance P+, predicted covariance P.

    P = A P A' - A P C' S^-1 C P A' + Q, S = C P C' + R, L = P C' S^-1, P+ = (I - L C) P.
    """
    from scipy.linalg import solve_discrete_are

    P = solve_discrete_are(A.T, C.T, Q, R)
    S = C @ P @ C.T + R
    L = np.linalg.solve(S, C @ P).T
    return L, S, (np.eye(len(A)) - L @ C) @ P, P


def _bank(Ad: Array, Bd: Array, states: list[str], surfaces: list[str], suspects: list[str], t: Tuning):
    """Arrays of every model and, per model, the numbers of its certificate."""
    signals = _signals(states, t)
    pick = np.eye(len(states))[[states.index(s) for s in signals]]
    measured = [j for j, s in enumerate(signals) if s in t.measured]
    R = np.diag([t.measured[signals[j]] ** 2 for j in measured])
    n, size = len(states), len(states) + t.delay * len(measured) + 1
    rows: dict[str, list] = {k: [] for k in ("A", "B", "H", "L", "S_inv", "log_beta", "std", "stuck")}
    proof: dict[str, list[float]] = {"riccati_residual": [], "slowest_pole": [], "observable_rank": []}
    for name in [None, *suspects]:
        stuck = surfaces.index(name) if name else -1
        A, B, C = _augment(Ad, Bd, pick[measured], t.delay, stuck)
        live = size if name else size - 1
        Q = np.zeros((size, size))
        Q[:n, :n] = np.diag([t.state_std[s] ** 2 for s in states])
        Q[-1, -1] = t.stuck_std**2
        a, c, q = A[:live, :live], C[:, :live], Q[:live, :live]
        gain, S, after, P = kalman(a, c, q, R)
        H = np.zeros((len(signals), size))
        H[:, :n], H[measured] = pick, C
        L = np.zeros((size, len(signals)))
        L[:live, measured] = gain
        S_inv = np.zeros((len(signals),) * 2)
        S_inv[np.ix_(measured, measured)] = np.linalg.inv(S)
        values = (
            A,
            B,
            H,
            L,
            S_inv,
            -0.5 * np.linalg.slogdet(S)[1],
            np.sqrt(after[-1, -1]) if name else np.nan,
            stuck,
        )
        for key, value in zip(rows, values):
            rows[key].append(value)
        closed = (np.eye(live) - gain @ c) @ a
        riccati = a @ (P - gain @ S @ gain.T) @ a.T + q - P
        reach = np.vstack([c @ np.linalg.matrix_power(a, k) for k in range(live)])
        proof["riccati_residual"].append(float(np.abs(riccati).max() / np.abs(P).max()))
        proof["slowest_pole"].append(float(np.abs(np.linalg.eigvals(closed)).max()))
        proof["observable_rank"].append(int(np.linalg.matrix_rank(reach)) - live)
    return {k: np.array(v, float) for k, v in rows.items()}, proof, signals, pick, measured


def _signals(states: Sequence[str], t: Tuning) -> list[str]:
    """Signals in the order of the states: those measured and those with a weight."""
    return [s for s in states if s in t.measured or t.weight.get(s, 0.0) > 0.0]


def _start(pick: Array, measured: list[int], delay: int, size: int) -> Array:
    """(size, ns): states from the first sample of the signals, delay states included."""
    n = pick.shape[1]
    start = np.zeros((size, len(pick)))
    start[:n] = pick.T
    ny = len(measured)
    for d in range(delay):
        for i, j in enumerate(measured):
            start[n + d * ny + i, j] = 1.0
    return start


def design_mmae(
    A: Array,
    B: Array,
    states: Sequence[str],
    surfaces: Sequence[str],
    suspects: Sequence[str],
    servos: Array,
    dt_s: float,
    tuning: Tuning,
    *,
    trim: Sequence[float] | None = None,
    units: Mapping[str, str] | None = None,
    group: str = "",
    aircraft_hash: str = "",
) -> Design:
    """Filters of the healthy aircraft and of each suspect stuck, from a linear model.

    A (n, n), B (n, nu): x' = A x + B d, SI and rad. states: names of x; channels of the flight bear the same
    names. surfaces: names of d, commands arrive as `command.<surface>`. suspects: the surfaces that may be
    stuck; a fault of one must show differently from the others, which a redundant pair with separate commands
    gives. servos (nu, 8): `parts.servo.servo_coefficients` of each surface at dt_s. units: of the states that
    are signals (default rad/s for p, q, r and rad otherwise). group: of the hypotheses (default: the common
    stem of suspects).

    The certificate holds, per model, the relative residual of the Riccati equation, the largest |pole| of the
    filter and the observability rank minus the number of states (0 where observable).

    Source: paper "vireo_comparison" (2), (7), (9)-(12).
    """
    states, surfaces, suspects = list(states), list(surfaces), list(suspects)
    _check(states, surfaces, suspects, tuning)
    Ad, Bd = hold(np.asarray(A, float), np.asarray(B, float), dt_s)
    bank, proof, signals, pick, measured = _bank(Ad, Bd, states, surfaces, suspects, tuning)
    t, models, size = tuning, len(suspects) + 1, bank["A"].shape[1]
    prior = np.log(np.array([t.prior] + [(1 - t.prior) / len(suspects)] * len(suspects)))
    settings = [t.gain, t.threshold, t.quorum, np.log(t.floor), t.rule, t.compare_delay, t.settle_s / dt_s,
                t.max_gap_s / dt_s, 0.5, t.command_delay]  # fmt: skip
    params = bank | {
        "measured": np.array([float(j in measured) for j in range(len(signals))]),
        "weight": np.array([t.weight.get(s, 0.0) for s in signals]),
        "start": _start(pick, measured, t.delay, size),
        "trim": np.zeros(len(surfaces)) if trim is None else np.asarray(trim, float),
        "servo": np.asarray(servos, float),
        "low": bessel_sections(LOW_PASS_ORDER, t.low_pass, dt_s),
        "prior": prior,
        "settings": np.array(settings, float),
    }  # fmt: skip
    known = {"p": "rad/s", "q": "rad/s", "r": "rad/s", **(units or {})}
    stem = group or suspects[0].rsplit("_", 1)[0]
    spec = {
        "states": states, "surfaces": surfaces, "suspects": suspects, "signals": signals, "group": stem,
        "units": [known.get(s, "rad") for s in signals], "dt_s": float(dt_s), "max_age_s": t.max_age_s,
        "tuning": {k: dict(v) if isinstance(v, Mapping) else v for k, v in t._asdict().items()},
    }  # fmt: skip
    return Design("mmae", spec, aircraft_hash, params, {**proof, "models": models})
