"""Robust LPV observer: what the surfaces must be doing, from how the aircraft moves, against what they were
told.

Symbols (paper "vireo_comparison", section 3.2, Figures 4 and 5): F_lat, F_long filters scheduled by the
airspeed V and its rate Vdot; delta^ estimates from the motion; delta- positions from commands and actuator
models; e- = delta- minus delta^; e after the Bessel filter R_B; T threshold.

    x_F' = (A(V) + Vdot A_rate(V)) x_F + B(V) y,   delta^ = C(V) x_F + D(V) y          per axis
    [delta^_l; delta^_r] = M ([delta_e,trim(V) + delta^_e; delta^_a])                    recombination
    fault on surface s where |e_s| >= T

The filters are discretised exactly (matrix exponential, inputs held) at nodes over (V, Vdot) and the discrete
matrices interpolated linearly in both: no switching, so no bump. V and Vdot come from one causal second-order
filter of the measured airspeed, w^2 / (s^2 + 2 w s + w^2) and its derivative, so that Vdot is the rate of the
V that is used.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core import HEALTHY, Array, Channels, Design, Diagnoser, Hypothesis, Verdict, WrongUse
from ..parts.bessel import bessel_sections, sections_step
from ..parts.delay_line import delay_fill, delay_line, delay_step
from ..parts.lti import hold
from ..parts.ops import clip, jit
from ..parts.servo import servo_step

SEEN, GAP, OUTSIDE = range(3)
DELAY, SETTLE, MAX_GAP, PERSIST, LOWEST, HIGHEST, RATE_BOUND, MARGIN = range(8)
PHI_CMD, PHI, P, Q, AIRSPEED = range(5)
LOW_PASS_ORDER = 5


class Bank(NamedTuple):
    """One axis on its nodes: V (nv,) and rate (nr,) both evenly spaced (one node: constant). A (nv, nr, n,
    n), B (nv, nr, n, ny) discrete; C (nv, n), D (nv, ny).
    """

    V: Array
    rate: Array
    A: Array
    B: Array
    C: Array
    D: Array


class Params(NamedTuple):
    """lat, lon: banks. trim_V, trim_elevator (nt,): m/s, rad. mixing (ns, 2): surfaces from [elevator;
    aileron]. speed (2, 3): discrete airspeed filter, [V; Vdot]+ = speed[:, :2] [V; Vdot] + speed[:, 2]
    V_measured. servo (ns, 8), low (nl, 5): sections of R_B. threshold (ns,) rad. settings: by the indices
    DELAY ... above. max_age (nz,) s.
    """

    lat: Bank
    lon: Bank
    trim_V: Array
    trim_elevator: Array
    mixing: Array
    speed: Array
    servo: Array
    low: Array
    threshold: Array
    settings: Array
    max_age: Array


class State(NamedTuple):
    """x_lat, x_lon: filters. next_lat, next_lon: scratch. speed (2,): V, Vdot. servo (ns, 2), line (ns,
    width): actuator models. low, low_estimate (ns, nl, 2): Bessel filters. clock (3,): good samples, bad in a
    row, outside in a row.
    """

    x_lat: Array
    x_lon: Array
    next_lat: Array
    next_lon: Array
    speed: Array
    servo: Array
    line: Array
    low: Array
    low_estimate: Array
    clock: Array


def init(params: Params) -> State:
    """Nothing seen yet."""
    n, m, ns, nl = params.lat.A.shape[2], params.lon.A.shape[2], len(params.mixing), len(params.low)
    line = np.stack([delay_line(float(params.settings[DELAY])) for _ in range(ns)])
    zeros = np.zeros
    return State(
        zeros(n), zeros(m), zeros(n), zeros(m), zeros(2), zeros((ns, 2)), line, zeros((ns, nl, 2)),
        zeros((ns, nl, 2)), np.zeros(3, dtype=np.int64),
    )  # fmt: skip


@jit
def _place(nodes: Array, value: float) -> tuple[int, float]:
    """Cell of evenly spaced nodes and the place in it (0 to 1); held at the ends."""
    if len(nodes) == 1:
        return 0, 0.0
    x = (value - nodes[0]) / (nodes[1] - nodes[0])
    i = int(clip(x, 0.0, len(nodes) - 2.0))
    return i, clip(x - i, 0.0, 1.0)


@jit
def bank_step(bank: Bank, V: float, Vdot: float, y: Array, x: Array, work: Array) -> float:
    """delta^ now from state x and measurement y, then x one sample on, in place; work is scratch of the
    length of x.
    """
    i, a = _place(bank.V, V)
    j, b = _place(bank.rate, Vdot)
    n, ny = len(x), len(y)
    for s in range(n):
        work[s] = 0.0
    out = 0.0
    for di in range(2):
        wi = a if di == 1 else 1.0 - a
        if wi == 0.0:
            continue
        total = 0.0
        for s in range(n):
            total += bank.C[i + di, s] * x[s]
        for s in range(ny):
            total += bank.D[i + di, s] * y[s]
        out += wi * total
        for dj in range(2):
            w = wi * (b if dj == 1 else 1.0 - b)
            if w == 0.0:
                continue
            for r in range(n):
                total = 0.0
                for s in range(n):
                    total += bank.A[i + di, j + dj, r, s] * x[s]
                for s in range(ny):
                    total += bank.B[i + di, j + dj, r, s] * y[s]
                work[r] += w * total
    for s in range(n):
        x[s] = work[s]
    return out


@jit
def _trim(params: Params, V: float) -> float:
    """Elevator of level flight at V, rad; linear between the nodes, held beyond them."""
    v, e = params.trim_V, params.trim_elevator
    last = len(v) - 1
    x = clip(V, v[0], v[last])
    for i in range(1, last + 1):
        if v[i] >= x:
            return e[i - 1] + (e[i] - e[i - 1]) * (x - v[i - 1]) / (v[i] - v[i - 1])
    return e[last]


@jit
def _input_status(params: Params, z: Array, age: Array) -> int:
    status = 0
    for j in range(len(z)):
        if not np.isfinite(z[j]):
            return 3
        if age[j] > params.max_age[j]:
            status = 2
    return status


@jit
def _start(params: Params, state: State, z: Array) -> None:
    """Filters at rest, actuators where the commands are, airspeed as measured."""
    state.x_lat[:] = 0.0
    state.x_lon[:] = 0.0
    state.speed[0] = z[AIRSPEED]
    state.speed[1] = 0.0
    for s in range(len(params.mixing)):
        state.servo[s, 0] = z[AIRSPEED + 1 + s]
        state.servo[s, 1] = 0.0
        delay_fill(state.line[s], z[AIRSPEED + 1 + s])
    state.low[:] = 0.0
    state.low_estimate[:] = 0.0
    state.clock[SEEN] = 0
    state.clock[OUTSIDE] = 0


@jit
def _schedule(params: Params, state: State, airspeed: float) -> tuple[float, float]:
    """(V, Vdot) to schedule with, inside the ranges of the design; advances the airspeed filter."""
    c, f = params.settings, params.speed
    v, rate = state.speed[0], state.speed[1]
    state.speed[0] = f[0, 0] * v + f[0, 1] * rate + f[0, 2] * airspeed
    state.speed[1] = f[1, 0] * v + f[1, 1] * rate + f[1, 2] * airspeed
    outside = v < c[LOWEST] - c[MARGIN] or v > c[HIGHEST] + c[MARGIN]
    state.clock[OUTSIDE] = state.clock[OUTSIDE] + 1 if outside else 0
    return clip(v, c[LOWEST], c[HIGHEST]), clip(rate, -c[RATE_BOUND], c[RATE_BOUND])


@jit
def _silent(status: int, params: Params, out: Verdict, k: int) -> None:
    out.status[k] = status
    out.detected[k] = False
    out.active[k, :] = False
    out.score[k, :] = np.nan
    out.estimate[k, :] = np.nan
    out.estimate_std[k, :] = np.nan
    out.residual[k, :] = np.nan
    out.threshold[k, :] = params.threshold
    out.request[k] = 0


@jit
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: z = phi_cmd, phi, p, q, airspeed, then the commands.

    A bad sample changes nothing but the Status; after more than MAX_GAP of them the filters start again.
    Outside the airspeeds of the design for longer than PERSIST the Status is OUT_OF_ENVELOPE; the filters go
    on at the edge.
    """
    c = params.settings
    _silent(_input_status(params, z, age), params, out, k)
    if out.status[k] > 0:
        state.clock[GAP] += 1
        return
    if state.clock[SEEN] == 0 or state.clock[GAP] > c[MAX_GAP]:
        _start(params, state, z)
    state.clock[GAP] = 0
    state.clock[SEEN] += 1
    V, Vdot = _schedule(params, state, z[AIRSPEED])
    aileron = bank_step(params.lat, V, Vdot, z[PHI_CMD : P + 1], state.x_lat, state.next_lat)
    elevator = bank_step(params.lon, V, Vdot, z[Q : Q + 1], state.x_lon, state.next_lon) + _trim(params, V)
    ready = state.clock[SEEN] > c[SETTLE]
    inside = state.clock[OUTSIDE] <= c[PERSIST]
    out.status[k] = 1 if not ready else (0 if inside else 5)
    judging = out.status[k] == 0
    worst = 0.0
    for s in range(len(params.mixing)):
        estimate = params.mixing[s, 0] * elevator + params.mixing[s, 1] * aileron
        e = sections_step(params.low, state.low[s], state.servo[s, 0] - estimate)
        smooth = sections_step(params.low, state.low_estimate[s], estimate)
        u = delay_step(state.line[s], z[AIRSPEED + 1 + s], c[DELAY])
        state.servo[s, 0], state.servo[s, 1] = servo_step(
            params.servo[s], state.servo[s, 0], state.servo[s, 1], u
        )
        out.residual[k, s] = e
        if judging:
            out.score[k, s + 1] = abs(e) / params.threshold[s]
            out.active[k, s + 1] = abs(e) >= params.threshold[s]
            out.estimate[k, s + 1] = smooth
            worst = max(worst, out.score[k, s + 1])
    if judging:
        out.score[k, 0] = 1.0 - worst
        out.detected[k] = worst >= 1.0
        out.active[k, 0] = worst < 1.0


@jit
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row of z (n, nz)."""
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def discretise(p: dict, axis: str, rate_bound: float, dt_s: float, nodes: int = 33, rates: int = 5) -> Bank:
    """A Bank from the arrays `<axis>.V`, `.A`, `.A_rate`, `.B`, `.C`, `.D` of a Design.

    The continuous matrices are interpolated linearly in V to `nodes` even nodes (the interpolation their
    certificate is about) and discretised exactly at each node and at `rates` values of Vdot within
    +-rate_bound (one where A_rate = 0).
    """
    V, A, slope, B, C, D = (np.asarray(p[f"{axis}.{k}"], float) for k in ("V", "A", "A_rate", "B", "C", "D"))
    grid = np.linspace(V[0], V[-1], nodes) if len(V) > 1 else V
    rate = np.linspace(-rate_bound, rate_bound, rates) if np.any(slope) else np.zeros(1)

    def at(table: Array, v: float) -> Array:
        i = int(np.clip(np.searchsorted(V, v) - 1, 0, max(len(V) - 2, 0)))
        if len(V) == 1:
            return table[0]
        w = (v - V[i]) / (V[i + 1] - V[i])
        return (1 - w) * table[i] + w * table[i + 1]

    pairs = [[hold(at(A, v) + r * at(slope, v), at(B, v), dt_s) for r in rate] for v in grid]
    Ad, Bd = (np.ascontiguousarray([[pair[k] for pair in row] for row in pairs]) for k in (0, 1))
    ends = [np.ascontiguousarray([at(table, v)[0] for v in grid]) for table in (C, D)]
    return Bank(grid.copy(), rate, Ad, Bd, *ends)


def _speed_filter(bandwidth: float, dt_s: float) -> Array:
    """(2, 3): exact discrete form of V'' = w^2 (V_m - V) - 2 w V' with V_m held over each sample."""
    w = bandwidth
    Ad, Bd = hold(np.array([[0.0, 1.0], [-w * w, -2.0 * w]]), np.array([[0.0], [w * w]]), dt_s)
    return np.ascontiguousarray(np.hstack([Ad, Bd]))


def from_design(
    design: Design,
    surfaces: tuple[str, ...],
    servos: Array,
    delay_s: float,
    dt_s: float,
    *,
    group: str = "",
    threshold: float = math.radians(5.0),
    low_pass: float = 10.0,
    speed_bandwidth: float = 1.0,
    speed_margin: float = 0.0,
    persist_s: float = 1.0,
    settle_s: float = 5.0,
    max_gap_s: float = 0.5,
    max_age_s: float = 0.2,
    name: str = "lpv_observer",
) -> Diagnoser:
    """Method B online, from a Design of `design.lpv_observer`.

    surfaces: in the order of `spec["mixing"]`; commands are `command.<surface>` in rad. servos (ns, 8):
    `parts.servo` coefficients at dt_s; delay_s: transport delay before them. threshold: T, rad. low_pass:
    bandwidth of the fifth-order Bessel filters, rad/s. speed_bandwidth: w of the airspeed filter, rad/s; Vdot
    is clipped to the rate bound of the design. speed_margin, persist_s: OUT_OF_ENVELOPE after this long more
    than this far (m/s) outside.

    Inputs: reference.phi, phi (rad), p, q (rad/s), airspeed (m/s), commands. Residuals e (rad), one per
    surface. The estimate is delta^, low-passed like the residual, in rad about neutral; it has no standard
    deviation (NaN), and at low frequency the longitudinal filter follows only part of the true elevator, by
    its weights. Guarantee: bumpless; at a node the discrete filter is the exact one. Not modelled: the
    phugoid.

    Source: paper "vireo_comparison", section 3.2; filters from `design.lpv_observer`.
    """
    p, mixing = design.params, np.asarray(design.spec["mixing"], float)
    if mixing.shape != (len(surfaces), 2) or np.shape(servos) != (len(surfaces), 8):
        raise WrongUse(
            f"{name}: {len(surfaces)} surfaces and servos {np.shape(servos)} were given, but the mixing of "
            f"the design is {mixing.shape}; give a surface and a row of servo numbers per row of the mixing"
        )
    bound, (lo, hi) = float(p["rate_bound"]), (float(x) for x in p["airspeed"])
    settings = [
        delay_s / dt_s,
        settle_s / dt_s,
        max_gap_s / dt_s,
        persist_s / dt_s,
        lo,
        hi,
        bound,
        speed_margin,
    ]
    names = ("reference.phi", "phi", "p", "q", "airspeed", *(f"command.{s}" for s in surfaces))
    units = ("rad", "rad", "rad/s", "rad/s", "m/s") + ("rad",) * len(surfaces)
    ages = (max_age_s,) * len(names)
    params = Params(
        discretise(p, "lat", bound, dt_s), discretise(p, "lon", bound, dt_s),
        np.atleast_1d(np.asarray(p["trim.V"], float)), np.atleast_1d(np.asarray(p["trim.elevator"], float)),
        mixing, _speed_filter(speed_bandwidth, dt_s), np.asarray(servos, float),
        bessel_sections(LOW_PASS_ORDER, low_pass, dt_s), np.full(len(surfaces), threshold),
        np.array(settings), np.array(ages),
    )  # fmt: skip
    stem = group or surfaces[0].rsplit("_", 1)[0]
    hypotheses = (HEALTHY, *(Hypothesis(s, "stuck", "rad", stem) for s in surfaces))
    return Diagnoser(
        name, Channels(names, units, ages), Channels((), ()), hypotheses, dt_s, False, params, init,
        step_into, run_into, tuple(f"e {s}" for s in surfaces), (), settle_s,
    )  # fmt: skip


def state_count(d: Diagnoser) -> dict[str, int]:
    """States of the two filters, the actuator models, the airspeed filter and the low passes of the
    residuals.
    """
    p: Params = d.params
    n, m, ns = p.lat.A.shape[2], p.lon.A.shape[2], len(p.mixing)
    counts = {"lateral": n, "longitudinal": m, "actuators": 2 * ns, "airspeed": 2}
    return {**counts, "low_passes": LOW_PASS_ORDER * ns, "total": n + m + 2 * ns}
