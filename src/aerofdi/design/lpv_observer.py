"""Filters of method B: estimate the true aileron and elevator deflection from what the aircraft does.

`design_lpv_observer(aircraft, spec, progress) -> core.Design` makes two output-estimation filters,
gain-scheduled over the airspeed V and its rate Vdot (method B of the paper "vireo_comparison", section 3.2,
Figures 4 to 7 and 10).

What a Design with method "lpv_observer" holds (all numbers SI and radians; arrays are float64, C order)
-------------------------------------------------------------------------------------------------------
`params` is a flat dictionary; the prefix is the axis, `lat.` (aileron) or `lon.` (elevator):

    lat.V       (N,)        airspeed nodes of the filter, m/s, increasing
    lat.A       (N, n, n)   filter  xF' = (A + Vdot * A_rate) xF + B y ,   deltahat = C xF + D y
    lat.A_rate  (N, n, n)   slope of A in Vdot, 1/s per m/s^2; zero for LTI and nominal filters (B, C, D have none)
    lat.B       (N, n, ny)
    lat.C       (N, 1, n)
    lat.D       (N, 1, ny)
    lon.*       the same; its own N and n

Measurements y, in this order: lat (phi_cmd, phi, p) in rad, rad, rad/s; lon (q) in rad/s. All are taken as
they are: the trim values of phi_cmd, phi, p and q are zero (wings level).
Output: lat: the aileron delta_a in rad; lon: the elevator delta_e in rad, both as DEVIATION FROM TRIM (trim
aileron 0). The true elevator is `trim.elevator` at the current V plus the estimate. Elevons follow from
delta_l = delta_e - delta_a, delta_r = delta_e + delta_a (`spec["mixing"]` = [[1, -1], [1, 1]] acting on
[delta_e; delta_a]).

    lat.X, lat.Z    (3, m, m)  storage of the proof: coefficients of 1, s, s^2, s = (V - centre)/half width
    lat.multiplier  (k,)       of the proof; lat.T (m, m), lat.nodes (j,) in m/s: see `lpv_observer_check.recheck`
    trim.V          (N,)    m/s
    trim.elevator   (N,)    rad, elevator in level trimmed flight at that airspeed
    trim.alpha      (N,)    rad
    rate_bound      ()      m/s^2, |Vdot| <= this (8 for the Vireo); clip Vdot to it
    airspeed        (2,)    m/s, lowest and highest airspeed the filters were made for

The state is in one coordinate system over all nodes, so matrices are interpolated linearly in V between nodes
(the certificate is computed for exactly this interpolation). A filter of one node (N = 1) is LTI: use it at
every airspeed. Poles reach about -1000 rad/s: discretise exactly (matrix exponential), never by Euler.

What the paper overlooks: its synthesis has no input that opens the loop, and a stuck surface does. The kind
"stuck_lpv" gives the true deflection an exogenous input (df of `lpv_observer_plants`, weight Wf), which the
filter must estimate as well.

`spec` (plain numbers and strings): kind (one of KINDS), aircraft, surfaces, mixing, airspeeds, nominal_airspeed,
rate_bound, nodes, backoff, degree, psi_poles, controller, weights (numerators and denominators per axis).
`certificate`, per axis: gamma (proved) and gamma_optimal, status of both stages in the solver's words, largest scaled
eigenvalues on and between the nodes and of the loop as run, `proved`, `on_grid_only`, poles, seconds.
`design.io.save_design(design, "x.toml")` writes x.toml and, beside it, x.npz with the arrays; `load_design` reads them.
"""

from __future__ import annotations

import math
import time
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..aircraft import hash as aircraft_hash
from ..core import Array, CannotJudge, Design, WrongUse
from .certificates import LIMIT, certificate, check_lmis, refine
from .estimator import Estimation, Filter, Options, Solution
from .lmi import SOLVED, Progress
from .lpv_observer_models import AXES, Axis, axes_of, linear_models, mixing, weights_table
from .lpv_observer_plants import Weights
from .synthesis import reconstruct, solve

KINDS = ("nominal_lti", "robust_lti", "nominal_lpv", "robust_lpv", "stuck_lpv")
# Nodes a filter is stored on, more where its matrices bend too much for linear interpolation.
FILTER_NODES = (33, 65, 129)
W_SCALES = (0.005, 0.02, 0.1, 0.5, 2.0)
DENSE = 161
MODEL_NODES = 41


class Spec(NamedTuple):
    """What is asked for. None: taken from the aircraft file.

    kind: one of KINDS; "stuck_lpv" is "robust_lpv" with the fault as an input, the others are the paper's.
    airspeeds: lowest and highest, m/s. nominal: airspeed of the time-invariant filters. nodes: synthesis
    nodes (LPV). rate_bound: m/s^2. weights: axis -> Weights. psi_poles: axis -> poles of the multiplier,
    rad/s. backoff, degree: see `estimator.Options`. w_scale: axis -> scale of (w, v) tried first.
    rounds: times nodes may be added. time_limit_s: of an axis.
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
    w_scale: tuple[float, float] = (0.005, 0.5)
    time_limit_s: float = 900.0
    rounds: int = 2


class Made(NamedTuple):
    """One axis done: what was asked, the solution, the filter and the proof."""

    problem: Estimation
    options: Options
    solution: Solution
    filter: Filter
    certificate: dict[str, Any]

    @property
    def flaws(self) -> tuple[bool, bool, bool, float]:
        """What is wrong with it, worst first: unstable, not proved on its nodes, not fully solved, excess between
        nodes.
        """
        c = self.certificate
        between = max(c["largest_scaled_eigenvalue_between"], c["largest_scaled_eigenvalue_loop"])
        return not c["stable"], not c["proved"], c["status"] != SOLVED, between if between > LIMIT else 0.0


class _Search(NamedTuple):
    """What stays the same while one axis is tried: nodes of a filter lie in `span`, checks on `dense`."""

    problem: Estimation
    span: tuple[float, float]
    dense: Array
    deadline: float
    say: Progress


def _attempts(spec: Spec, robust: bool, rate: float, scale: float) -> list[Options]:
    """Scalings worth trying in turn: the one asked for in two coordinate systems, a larger backoff, then its
    neighbours.
    """
    base = Options(rate, spec.degree, spec.backoff, w_scale=scale)
    if not robust:
        return [
            base,
            base._replace(normal=0.25),
            base._replace(normal=0.0),
            base._replace(backoff=1.05 * spec.backoff),
        ]
    near = sorted(W_SCALES, key=lambda w: abs(math.log(w / scale)))
    others = [base._replace(w_scale=w, normal=n) for n in (0.5, 0.25) for w in near if w != scale][:4]
    return [base, base._replace(normal=0.25), base._replace(backoff=1.05 * spec.backoff), *others]


def _attempt(search: _Search, V: Array, o: Options) -> Made:
    """One synthesis with its filter on as few stored nodes as its interpolation needs."""
    left = max(5.0, search.deadline - time.perf_counter())
    sol = solve(search.problem, V, o._replace(time_limit_s=min(o.time_limit_s, left)), search.say)
    for count in FILTER_NODES:
        f = reconstruct(search.problem, sol, V if len(V) == 1 else np.linspace(*search.span, count))
        proof = certificate(search.problem, sol, o, f, len(search.dense))
        if len(V) == 1 or proof["largest_scaled_eigenvalue_loop"] <= LIMIT:
            break
    scales = {
        "w_scale": o.w_scale,
        "normal": o.normal,
        "time_scale": o.time_scale,
        "estimand_scale": o.estimand_scale,
    }
    return Made(search.problem, o, sol, f, proof | scales | {"backoff": o.backoff})


def _best_attempt(search: _Search, V: Array, tries: list[Options]) -> Made:
    """The first attempt that is solved, proved on its nodes and stable; else the least flawed one before the
    deadline.
    """
    kept: Made | None = None
    error: CannotJudge | None = None
    for o in tries:
        if kept is not None and time.perf_counter() > search.deadline:
            break
        try:
            made = _attempt(search, V, o)
        except CannotJudge as e:
            if "'infeasible'" in str(e) or time.perf_counter() > search.deadline:
                raise
            error = error or e
            continue
        if not any(made.flaws[:3]):
            return made
        kept = made if kept is None or made.flaws < kept.flaws else kept
    if kept is None:
        raise error or CannotJudge("no attempt was made")
    return kept


def design_axis(
    axis: Axis,
    spec: Spec,
    span: tuple[float, float],
    nominal: float,
    rate: float,
    progress: Progress | None = None,
) -> Made:
    """One filter: synthesis, nodes added where the inequalities fail between them, reconstruction, certificate.

    Raises CannotJudge where no attempt gives a stable filter that is proved on its nodes within spec.time_limit_s.
    """
    start = time.perf_counter()
    robust, lti = not spec.kind.startswith("nominal"), spec.kind.endswith("lti")
    k = AXES.index(axis.name)

    def say(text: str, share: float) -> None:
        if progress:
            progress(f"{axis.name} {spec.kind}: {text}", share)

    V = np.array([nominal]) if lti else np.linspace(*span, spec.nodes)
    dense = V if lti else np.linspace(*span, DENSE)
    search = _Search(axis.problem(robust, spec.psi_poles[k]), span, dense, start + spec.time_limit_s, say)
    tries = _attempts(spec, robust, 0.0 if lti else rate, spec.w_scale[k])
    best = made = _best_attempt(search, V, tries)
    for _ in range(0 if lti else spec.rounds):
        grown = refine(V, check_lmis(made.problem, made.solution, made.options, dense).worst, dense)
        if not any(best.flaws) or len(grown) == len(V) or time.perf_counter() > search.deadline:
            break
        V, tries = grown, [made.options, *(o for o in tries if o != made.options)]
        made = _best_attempt(search, V, tries)
        best = min(best, made, key=lambda m: m.flaws)
    if any(best.flaws[:2]):
        what = "unstable" if best.flaws[0] else "not proved even on its nodes"
        raise CannotJudge(
            f"every {axis.name} {spec.kind} filter tried over {span[0]:g} to {span[1]:g} m/s was {what}; narrow "
            f"the airspeed range, lower the rate bound or the uncertainty, or raise backoff or time_limit_s"
        )
    best.certificate["seconds"] = round(time.perf_counter() - start, 2)
    return best


def design_lpv_observer(
    aircraft: Aircraft, spec: Spec | None = None, progress: Progress | None = None
) -> Design:
    """The two filters of method B for an aircraft file; see the top of this module for what the Design holds.

    progress(text, share) is called from start to end. Raises WrongUse for an aircraft without autopilot
    gains, actuators or two airspeeds, CannotJudge where a synthesis is infeasible or ends at its limits.

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
            f"the observer needs airspeeds lowest < highest around {nominal:g} m/s and two nodes or more; "
            f"given {lo:g}, {hi:g}, {spec.nodes}"
        )
    rate = aircraft.number("envelope.airspeed_rate", 8.0) if spec.rate_bound is None else spec.rate_bound
    say = progress or (lambda text, share: None)
    say("linear models", 0.0)
    models = linear_models(aircraft, np.unique(np.append(np.linspace(lo, hi, MODEL_NODES), nominal)))
    axes = axes_of(aircraft, models, nominal, spec.kind == "stuck_lpv", spec.weights)
    params: dict[str, Any] = {}
    proof: dict[str, Any] = {}
    for k, name in enumerate(AXES):

        def part(text: str, share: float, done: int = k) -> None:
            say(text, 0.05 + 0.95 * (done + share) / len(AXES))

        made = design_axis(axes[name], spec, (lo, hi), nominal, rate, part)
        params |= {f"{name}.{key}": getattr(made.filter, key) for key in ("V", "A", "A_rate", "B", "C", "D")}
        params |= {f"{name}.{key}": getattr(made.solution, key) for key in ("X", "Z", "multiplier", "nodes")}
        params[f"{name}.T"] = made.solution.scaling.T
        proof[name] = made.certificate
    params |= {"trim.V": models.V, "trim.elevator": models.elevator, "trim.alpha": models.alpha}
    params |= {"rate_bound": np.array(rate), "airspeed": np.array([lo, hi])}
    names, rows = mixing(aircraft)
    said = {
        "kind": spec.kind,
        "aircraft": aircraft.name,
        "surfaces": names,
        "mixing": rows,
        "airspeeds": [lo, hi],
        "nominal_airspeed": nominal,
        "rate_bound": rate,
        "nodes": spec.nodes,
        "backoff": spec.backoff,
        "degree": spec.degree,
        "psi_poles": [list(p) for p in spec.psi_poles],
        "controller": {a: axes[a].controller._asdict() for a in AXES},
        "weights": {a: weights_table(axes[a].weights) for a in AXES},
    }
    say("done", 1.0)
    return Design("lpv_observer", said, aircraft_hash(aircraft), params, proof)
