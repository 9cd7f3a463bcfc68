"""Filters of method B: estimate the true aileron and elevator deflection from what the aircraft does.

`design_lpv_observer(aircraft, spec, progress) -> core.Design` makes two output-estimation filters, gain-scheduled over the
airspeed V and its rate Vdot (method B of the paper "vireo_comparison", section 3.2, Figures 4 to 7 and 10).

What a Design with method "lpv_observer" holds (all numbers SI and radians; arrays are float64, C order)
-------------------------------------------------------------------------------------------------------
`params` is a flat dictionary; the prefix is the axis, `lat.` (aileron) or `lon.` (elevator):

    lat.V       (N,)        airspeed nodes of the filter, m/s, increasing
    lat.A       (N, n, n)   filter  xF' = (A + Vdot * A_rate) xF + B y ,   deltahat = C xF + D y
    lat.A_rate  (N, n, n)   slope of A in Vdot, 1/(m/s^2) * 1/s; zero for LTI and nominal filters; B, C, D have none
    lat.B       (N, n, ny)
    lat.C       (N, 1, n)
    lat.D       (N, 1, ny)
    lon.*       the same; its own N and n

Measurements y, in this order: lat (phi_cmd, phi, p) in rad, rad, rad/s; lon (q) in rad/s. All are taken as they are: the trim
values of phi_cmd, phi, p and q are zero (wings level).
Output: lat: the aileron delta_a in rad; lon: the elevator delta_e in rad, both as DEVIATION FROM TRIM (trim aileron 0). The
true elevator is `trim.elevator` at the current V plus the estimate. Elevons follow from
delta_l = delta_e - delta_a, delta_r = delta_e + delta_a (`spec["mixing"]` = [[1, -1], [1, 1]] acting on [delta_e; delta_a]).

    trim.V          (N,)    m/s
    trim.elevator   (N,)    rad, elevator in level trimmed flight at that airspeed
    trim.alpha      (N,)    rad
    rate_bound      ()      m/s^2, |Vdot| <= this (8 for the Vireo); clip Vdot to it
    airspeed        (2,)    m/s, lowest and highest airspeed the filters were made for

The state is in one coordinate system over all nodes, so matrices are interpolated linearly in V between nodes (the
certificate is computed for exactly this interpolation). A filter of one node (N = 1) is LTI: use it at every airspeed.
Poles reach about -500 rad/s: discretise exactly (matrix exponential), never by Euler.

What the paper overlooks: its synthesis has no input that opens the loop, and a stuck surface does. With fault = Wf > 0 the true
deflection gets an exogenous input (df of `lpv_observer_plants`), which the filter must estimate as well.

`spec` (plain numbers and strings): kind ("nominal_lti", "robust_lti", "nominal_lpv", "robust_lpv"), aircraft name, nominal airspeed, actuator (wn,
zeta, delay), controller gains, weights with numerators and denominators, psi_pole, backoff, basis degree, fault_weight.
`certificate` (plain numbers and strings, per axis): gamma, gamma_optimal, solver, status of both stages, largest scaled LMI eigenvalue on the
nodes and between them, `on_grid_only`, filter poles, wall-clock seconds.
`design.io.save_design(design, "x.toml")` writes x.toml (spec, certificate, names and shapes) and x.npz (arrays) beside it;
`load_design("x.toml")` reads them back.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..aircraft import hash as aircraft_hash
from ..autopilot.gains import load_gains
from ..core import Array, CannotJudge, Design, WrongUse
from ..dynamics.linearise import LATERAL, lpv_grid
from .certificates import certificate, check_lmis, refine
from .estimator import Estimation, Filter, Options, Solution
from .lmi import SOLVED, Progress
from .lpv import Gridded, connect, gain, interpolate, transfer
from .lpv_observer_plants import (
    LAT_MEASURED,
    LON_MEASURED,
    Controller,
    Ratio,
    Weights,
    delay_free_actuator,
    estimation,
    unweighted,
)
from .synthesis import filter_at, reconstruct, solve
from .worst_case_gain import Uncertain

KINDS = ("nominal_lti", "robust_lti", "nominal_lpv", "robust_lpv", "stuck_lpv")
AXES = ("lat", "lon")
DEG = math.pi / 180.0
LON = ("q", "w")
FILTER_NODES = 33
# Wf of "stuck_lpv": size (rad) and corner (rad/s) of the fault input, aileron and elevator; chosen by `stuck_study`.
FAULT = {"lat": (20.0 * DEG, 3.0), "lon": (4.0 * DEG, 3.0)}
DENSE = 161


class Spec(NamedTuple):
    """What is asked for. None: taken from the aircraft file.

    kind: one of KINDS; "stuck_lpv" is "robust_lpv" with the fault as an input (FAULT), the others are the paper's. airspeeds: lowest and highest, m/s. nominal: airspeed of the time-invariant filters. nodes: synthesis
    nodes (LPV). rate_bound: m/s^2. weights: axis -> Weights. psi_poles: axis -> poles of the multiplier, rad/s. backoff, degree: see
    `estimator.Options`. w_scale: axis -> scale of (w, v), None: searched on one node. rounds: times nodes may be added.
    """

    kind: str = "stuck_lpv"
    airspeeds: tuple[float, float] | None = None
    nominal: float | None = None
    nodes: int = 20
    rate_bound: float | None = None
    weights: dict[str, Weights] | None = None
    psi_poles: tuple[tuple[float, ...], tuple[float, ...]] = ((0.031,), (0.031,))
    backoff: float = 1.05
    degree: int = 2
    w_scale: tuple[float, float] | None = None
    time_limit_s: float = 240.0
    rounds: int = 2


class Axis(NamedTuple):
    """One axis of one aircraft: what `lpv_observer_plants.estimation` needs."""

    name: str
    model: Callable[[Array], tuple[Array, Array]]
    actuator: Gridded
    weights: Weights
    controller: Controller

    def problem(self, robust: bool, psi_poles: tuple[float, ...]) -> Estimation:
        """The estimation problem."""
        return estimation(
            self.name, self.model, self.actuator, self.weights, self.controller, robust, psi_poles
        )


class Models(NamedTuple):
    """An aircraft on a fine grid of airspeeds: V (K,), lateral and longitudinal (A, B), trims (K,) in rad."""

    V: Array
    lat: tuple[Array, Array]
    lon: tuple[Array, Array]
    elevator: Array
    alpha: Array

    def at(self, axis: str, V: Array) -> tuple[Array, Array]:
        """(A, B) of one axis, linear in V between the fine nodes."""
        A, B = self.lat if axis == "lat" else self.lon
        v = np.atleast_1d(np.asarray(V, float))
        return interpolate(self.V, A, v), interpolate(self.V, B, v)


def linear_models(aircraft: Aircraft, V: Array) -> Models:
    """Level flight at each airspeed, linearised; raises CannotJudge where an airspeed has no trim."""
    grid = lpv_grid(
        aircraft, V, states=(*LATERAL, *LON), inputs=("aileron", "elevator"), rate_bounds=(0.0, 0.0)
    )
    i = [grid.states.index(s) for s in LATERAL]
    j = [grid.states.index(s) for s in LON]
    lat = grid.A[:, i][:, :, i], grid.B[:, i][:, :, :1]
    lon = grid.A[:, j][:, :, j], grid.B[:, j][:, :, 1:]
    elevator = np.array([t.commands["elevator"] for t in grid.trims])
    return Models(grid.airspeeds, lat, lon, elevator, np.array([t.alpha for t in grid.trims]))


def _oscillation(A: Array) -> float:
    """Natural frequency of the slowest complex pair, rad/s; of the slowest mode where there is none."""
    e = np.linalg.eigvals(A)
    pair = np.abs(e[np.abs(e.imag) > 1e-9])
    return float(pair.min() if len(pair) else np.abs(e).min())


def sensitivity_weight(dc_db: float, high_db: float, bandwidth: float) -> Ratio:
    """W = 1/Sbar, Sbar first order with these gains, 3 dB below its high-frequency gain at `bandwidth` (rad/s).

    Sbar = (h s + d w0)/(s + w0), d = dc, h = high gain, w0 from |Sbar(j bandwidth)| = h/sqrt 2.

    >>> W = sensitivity_weight(-35.0, 1.0, 4.0)
    >>> [round(x, 3) for x in (*W.num, *W.den)]
    [1.0, 4.004, 1.122, 0.071]
    """
    d, h = 10.0 ** (dc_db / 20.0), 10.0 ** (high_db / 20.0)
    # h^2 W^2 + d^2 w0^2 = (h^2/2)(W^2 + w0^2)
    if d >= h / math.sqrt(2.0):
        raise WrongUse(f"a sensitivity bound of {dc_db} dB at rest and {high_db} dB above has no -3 dB point")
    w0 = bandwidth * math.sqrt((0.5 * h * h) / (0.5 * h * h - d * d))
    return Ratio((1.0, w0), (h, d * w0))


def default_weights(aircraft: Aircraft, models: Models, nominal: float) -> dict[str, Weights]:
    """Tables 2 and 3 for the Vireo as printed; for other aircraft the same sizes, and shapes moved to its own modes.

    The corner frequencies of W_Delta move with the actuator bandwidth (lateral) and the short period (longitudinal), those of W with
    Dutch roll and short period. Sizes of disturbances are the paper's.
    """
    lat = Weights(
        3 * DEG,
        (6 * DEG, 6 * DEG),
        30 * DEG,
        Ratio((1.0, 3.924), (1.0, 392.4)),
        Ratio((1.0, 4.0), (1.122, 0.07113)),
    )
    lon = Weights(
        4 * DEG,
        (10 * DEG,),
        0.0,
        Ratio((1.0, 53.43, 213.5), (1.0, 436.0, 427.0)),
        Ratio((1.0, 14.5), (1.122, 9.149)),
    )
    if aircraft.name == "vireo":
        return {"lat": lat, "lon": lon}
    dutch, short = (_oscillation(models.at(a, np.array([nominal]))[0][0]) for a in AXES)
    surface = next(s for s in aircraft.surfaces if "aileron" in s.command)
    a, b = surface.bandwidth / 62.8, short / 14.5
    lat = lat._replace(
        uncertainty=Ratio((1.0, 3.924 * a), (1.0, 392.4 * a)), error=sensitivity_weight(-35.0, 1.0, dutch)
    )
    lon = lon._replace(
        uncertainty=Ratio((1.0, 53.43 * b, 213.5 * b * b), (1.0, 436.0 * b, 427.0 * b * b)),
        error=Ratio((1.0, short), (1.122, 9.149 * b)),
    )
    return {"lat": lat, "lon": lon}


def _controllers(aircraft: Aircraft) -> dict[str, Controller]:
    table = aircraft.autopilot
    if not table.get("controller"):
        raise WrongUse(
            f"aircraft {aircraft.name!r} has no [autopilot]; the observer needs the roll and pitch-rate gains it flies with"
        )
    g = load_gains(table["controller"], table["gains"], f"aircraft {aircraft.name!r}")
    missing = [k for k in ("bank_kp", "bank_ki", "roll_rate_kp", "pitch_rate_kp") if not hasattr(g, k)]
    if missing:
        raise WrongUse(
            f"autopilot {table['controller']!r} of aircraft {aircraft.name!r} has no {', '.join(missing)}"
        )
    return {"lat": Controller(g.bank_kp, g.bank_ki, g.roll_rate_kp), "lon": Controller(kq=g.pitch_rate_kp)}


def _actuator(aircraft: Aircraft, command: str) -> Gridded:
    """The delay-free approximation of the surfaces a classic command moves."""
    moved = [s for s in aircraft.surfaces if command in s.command]
    if not moved:
        raise WrongUse(f"aircraft {aircraft.name!r} has no surface that answers {command!r}")
    s, b = moved[0], moved[0].bandwidth
    if s.actuator == "second_order":
        servo = transfer([b * b], [1.0, 2.0 * s.damping * b, b * b], "x", "y")
    elif s.actuator == "first_order":
        servo = transfer([b], [1.0, b], "x", "y")
    else:
        raise WrongUse(
            f"surface {s.name!r} of aircraft {aircraft.name!r} has no actuator dynamics; the observer needs some"
        )
    return delay_free_actuator(servo, s.delay)


def axes_of(aircraft: Aircraft, spec: Spec, models: Models, nominal: float) -> dict[str, Axis]:
    """Both axes of an aircraft, with the weights of the spec or the default ones."""
    weights = spec.weights or default_weights(aircraft, models, nominal)
    if spec.kind == "stuck_lpv" and not spec.weights:
        weights = {a: w._replace(fault=Ratio((FAULT[a][0] * FAULT[a][1],), (1.0, FAULT[a][1]))) for a, w in weights.items()}
    k = _controllers(aircraft)
    out = {}
    for name, command in zip(AXES, ("aileron", "elevator"), strict=True):
        model = lambda V, name=name: models.at(name, V)
        out[name] = Axis(name, model, _actuator(aircraft, command), weights[name], k[name])
    return out


def _attempts(
    axis: Axis, spec: Spec, robust: bool, rate: float, nominal: float, scale: float | None
) -> list[Options]:
    """Scalings worth trying in turn: the given one, or those of a search on one node with the smallest gains first."""
    base = Options(rate, spec.degree, spec.backoff, time_limit_s=spec.time_limit_s)
    if not robust:
        return [base, base._replace(normal=0.25), base._replace(normal=0.0)]
    if scale is not None:
        return [base._replace(w_scale=scale), base._replace(w_scale=scale, normal=0.25)]
    problem = axis.problem(True, spec.psi_poles[AXES.index(axis.name)])
    found = []
    for w in (0.005, 0.02, 0.1, 0.5, 2.0):
        o = base._replace(w_scale=w, rate_bound=0.0)
        try:
            s = solve(problem, np.array([nominal]), o)
        except CannotJudge:
            continue
        found.append(((s.stage1.status, s.stage2.status) != (SOLVED, SOLVED), s.stage1.iterations, w))
    if not found:
        raise CannotJudge(
            f"the {axis.name} problem has no robust filter even at {nominal:g} m/s; lower its uncertainty weight"
        )
    best = [w for *_, w in sorted(found)[:2]]
    return [base._replace(w_scale=w, normal=n) for n in (0.5, 0.25) for w in best]


def _first_solved(
    problem: Estimation, V: Array, tries: list[Options], say: Progress
) -> tuple[Solution, Options]:
    """The first attempt with both stages solved; else the first that ended at all (its status tells)."""
    kept: tuple[Solution, Options] | None = None
    error: CannotJudge | None = None
    for o in tries:
        try:
            s = solve(problem, V, o, say)
        except CannotJudge as e:
            error = error or e
            continue
        if (s.stage1.status, s.stage2.status) == (SOLVED, SOLVED):
            return s, o
        kept = kept or (s, o)
    if kept is None:
        raise error or CannotJudge("no attempt")
    return kept


class Made(NamedTuple):
    """One axis done: what was asked, the solution, the filter and the proof."""

    axis: Axis
    problem: Estimation
    options: Options
    solution: Solution
    filter: Filter
    certificate: dict[str, Any]


def design_axis(
    axis: Axis,
    spec: Spec,
    span: tuple[float, float],
    nominal: float,
    rate: float,
    progress: Progress | None = None,
) -> Made:
    """One filter: synthesis, nodes added where the inequalities fail between them, reconstruction, certificate."""
    start = time.perf_counter()
    say = progress or (lambda text, share: None)
    robust, lti = not spec.kind.startswith("nominal"), spec.kind.endswith("lti")
    k = AXES.index(axis.name)
    problem = axis.problem(robust, spec.psi_poles[k])
    V = np.array([nominal]) if lti else np.linspace(*span, spec.nodes)
    tries = _attempts(
        axis, spec, robust, 0.0 if lti else rate, nominal, spec.w_scale[k] if spec.w_scale else None
    )
    dense = V if lti else np.linspace(*span, DENSE)
    for turn in range(spec.rounds + 1):
        s, o = _first_solved(
            problem, V, tries, lambda text, share: say(f"{axis.name} {spec.kind}: {text}", share)
        )
        grown = V if lti else refine(V, check_lmis(problem, s, o, dense).worst, dense)
        if turn == spec.rounds or len(grown) == len(V):
            break
        V, tries = grown, [o, *(x for x in tries if x != o)]
    f = reconstruct(problem, s, V if lti else np.linspace(*span, FILTER_NODES))
    proof = certificate(problem, s, o, f, len(dense))
    proof["w_scale"], proof["normal"] = o.w_scale, o.normal
    proof["seconds"] = round(time.perf_counter() - start, 2)
    return Made(axis, problem, o, s, f, proof)


def saved_filter(design: Design, axis: str) -> Filter:
    """The filter of one axis of a Design."""
    measured = LAT_MEASURED if axis == "lat" else LON_MEASURED
    return Filter(*(np.asarray(design.params[f"{axis}.{k}"]) for k in ("V", "A", "A_rate", "B", "C", "D")), measured, "estimate")


def analysis_loop(axis: Axis, f: Filter, V: Array) -> Uncertain:
    """(w, df) -> (v, e): plant with W_Delta, controller without leak, actuator and filter; every other weight is one.

    df is added to the deflection behind the actuator, e = deltahat - delta. This is how "from -delta to e" in section 3.2.4 and
    Figures 9, 12 and 13 is read here. Without w and v it is Figure 9's loop.
    """
    V = np.atleast_1d(np.asarray(V, float))
    k = axis.controller._replace(leak=0.0)
    full = unweighted(axis.name, axis.model, axis.actuator, axis.weights, k)(V)
    plant = full.select(("w", "df"), full.outputs)
    error = gain("e", {"estimate": 1.0, "delta": -1.0})
    still, moving = (connect([plant, filter_at(f, V, rate), error], ("w", "df"), ("v", "e")) for rate in (0.0, 1.0))
    return Uncertain(V, still.A, moving.A - still.A, still.B, still.C, still.D)


def _weights_table(w: Weights) -> dict[str, Any]:
    ratio = lambda r: {"num": list(r.num), "den": list(r.den)}
    return {
        "actuator": w.actuator,
        "noise": list(w.noise),
        "command": w.command,
        "uncertainty": ratio(w.uncertainty),
        "error": ratio(w.error),
        "fault": ratio(w.fault),
    }


def weights_from(table: dict[str, Any]) -> Weights:
    """The inverse of what a Design's spec holds for one axis."""
    ratio = lambda r: Ratio(tuple(r["num"]), tuple(r["den"]))
    return Weights(
        table["actuator"],
        tuple(table["noise"]),
        table["command"],
        ratio(table["uncertainty"]),
        ratio(table["error"]),
        ratio(table["fault"]),
    )


def _mixing(aircraft: Aircraft) -> tuple[list[str], list[list[float]]]:
    """Names of the surfaces that answer elevator or aileron, and their rows [elevator, aileron]."""
    moved = [s for s in aircraft.surfaces if "elevator" in s.command or "aileron" in s.command]
    return [s.name for s in moved], [
        [s.command.get("elevator", 0.0), s.command.get("aileron", 0.0)] for s in moved
    ]


def design_lpv_observer(
    aircraft: Aircraft, spec: Spec | None = None, progress: Progress | None = None
) -> Design:
    """The two filters of method B for an aircraft file; see the top of this module for what the Design holds.

    progress(text, share) is called from start to end. Raises WrongUse for an aircraft without autopilot gains, actuators or two
    airspeeds, CannotJudge where a synthesis is infeasible or ends at its limits.

    Not modelled: rudder loops, phugoid, attitude and speed loops above the pitch damper.

    >>> from aerofdi.aircraft import load_aircraft
    >>> d = design_lpv_observer(load_aircraft("vireo"), Spec(kind="nominal_lti"))
    >>> d.params["lat.A"].shape, round(d.certificate["lat"]["gamma_optimal"], 3)
    ((1, 13, 13), 0.081)
    """
    spec = spec or Spec()
    if spec.kind not in KINDS:
        raise WrongUse(f"observer kind {spec.kind!r} is not known; accepted: {', '.join(KINDS)}")
    lo, hi = spec.airspeeds or (
        aircraft.number("envelope.min_airspeed"),
        aircraft.number("envelope.max_airspeed"),
    )
    nominal = spec.nominal or aircraft.number("reference.airspeed")
    if not lo < hi or not lo <= nominal <= hi or spec.nodes < 2:
        raise WrongUse(
            f"the observer needs airspeeds lowest < highest around {nominal:g} m/s and two nodes or more; given {lo:g}, {hi:g}, {spec.nodes}"
        )
    rate = aircraft.number("envelope.airspeed_rate", 8.0) if spec.rate_bound is None else spec.rate_bound
    say = progress or (lambda text, share: None)
    say("linear models", 0.0)
    models = linear_models(aircraft, np.unique(np.append(np.linspace(lo, hi, 41), nominal)))
    axes = axes_of(aircraft, spec, models, nominal)
    params: dict[str, Any] = {}
    proof: dict[str, Any] = {}
    for k, name in enumerate(AXES):
        made = design_axis(
            axes[name],
            spec,
            (lo, hi),
            nominal,
            rate,
            lambda text, share, k=k: say(text, 0.05 + 0.95 * (k + share) / 2),
        )
        params |= {f"{name}.{key}": getattr(made.filter, key) for key in ("V", "A", "A_rate", "B", "C", "D")}
        proof[name] = made.certificate
    params |= {"trim.V": models.V, "trim.elevator": models.elevator, "trim.alpha": models.alpha}
    params |= {"rate_bound": np.array(rate), "airspeed": np.array([lo, hi])}
    names, mixing = _mixing(aircraft)
    said = {
        "kind": spec.kind,
        "aircraft": aircraft.name,
        "surfaces": names,
        "mixing": mixing,
        "airspeeds": [lo, hi],
        "nominal_airspeed": nominal,
        "rate_bound": rate,
        "nodes": spec.nodes,
        "backoff": spec.backoff,
        "degree": spec.degree,
        "psi_poles": [list(p) for p in spec.psi_poles],
        "controller": {a: axes[a].controller._asdict() for a in AXES},
        "weights": {a: _weights_table(axes[a].weights) for a in AXES},
    }
    say("done", 1.0)
    return Design("lpv_observer", said, aircraft_hash(aircraft), params, proof)
