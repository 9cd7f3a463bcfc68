"""A saved LPV observer examined: its filters, the loop they are judged in, and its proof evaluated again."""

from __future__ import annotations

import numpy as np

from ..aircraft import Aircraft
from ..core import Array, Design
from .certificates import check_dissipation, check_lmis
from .estimator import Filter, Options, Scaling, Solution
from .lmi import Outcome
from .lpv import basis_for, connect, gain
from .lpv_observer import DENSE, MODEL_NODES
from .lpv_observer_models import AXES, Axis, axes_of, linear_models, weights_from
from .lpv_observer_plants import LAT_MEASURED, LON_MEASURED, unweighted
from .synthesis import filter_at
from .worst_case_gain import Uncertain

FILTER_ARRAYS = ("V", "A", "A_rate", "B", "C", "D")


def saved_filter(design: Design, axis: str) -> Filter:
    """The filter of one axis of a Design."""
    measured = LAT_MEASURED if axis == "lat" else LON_MEASURED
    V, A, A_rate, B, C, D = (np.asarray(design.params[f"{axis}.{k}"]) for k in FILTER_ARRAYS)
    return Filter(V, A, A_rate, B, C, D, measured, "estimate")


def analysis_loop(axis: Axis, f: Filter, V: Array) -> Uncertain:
    """(w, df) -> (v, e): plant with W_Delta, controller without leak, actuator and filter; every other weight
    is one.

    df is added to the deflection behind the actuator, e = deltahat - delta. This is how "from -delta to e" in
    section 3.2.4 and Figures 9, 12 and 13 is read here. Without w and v it is Figure 9's loop.
    """
    V = np.atleast_1d(np.asarray(V, float))
    k = axis.controller._replace(leak=0.0)
    full = unweighted(axis.name, axis.model, axis.actuator, axis.weights, k)(V)
    plant = full.select(("w", "df"), full.outputs)
    error = gain("e", {"estimate": 1.0, "delta": -1.0})
    still, moving = (
        connect([plant, filter_at(f, V, rate), error], ("w", "df"), ("v", "e")) for rate in (0.0, 1.0)
    )
    return Uncertain(V, still.A, moving.A - still.A, still.B, still.C, still.D)


def recheck(aircraft: Aircraft, design: Design, axis: str, points: int = DENSE) -> dict[str, float]:
    """The inequalities of a saved filter evaluated again from the aircraft file and the stored X, Z and
    multiplier.

    Returns the largest scaled eigenvalue of (X), (Z), (Q) ("lmi") and of the loop with the filter as stored
    ("loop") on `points` airspeeds. Needs no solver: this is how a design from elsewhere is trusted.
    """
    said, p = design.spec, design.params
    weights = {a: weights_from(said["weights"][a]) for a in AXES}
    poles = tuple(said["psi_poles"][AXES.index(axis)])
    lo, hi = said["airspeeds"]
    nominal = said["nominal_airspeed"]
    models = linear_models(aircraft, np.unique(np.append(np.linspace(lo, hi, MODEL_NODES), nominal)))
    problem = axes_of(aircraft, models, nominal, weights=weights)[axis].problem(
        not said["kind"].startswith("nominal"), poles
    )
    c = design.certificate[axis]
    nodes = p[f"{axis}.nodes"]
    scale = Scaling(p[f"{axis}.T"], c["time_scale"], c["estimand_scale"], c["w_scale"])
    done = Outcome(c["status"], None, 0.0, 0, 0.0)
    basis = basis_for(nodes, said["degree"])
    sol = Solution(
        p[f"{axis}.X"],
        p[f"{axis}.Z"],
        p[f"{axis}.multiplier"],
        c["gamma"],
        c["gamma_optimal"],
        basis,
        scale,
        done,
        done,
        nodes,
    )
    o = Options(said["rate_bound"], said["degree"])
    V = np.linspace(lo, hi, points) if len(nodes) > 1 else nodes
    loop = check_dissipation(problem, sol, o, saved_filter(design, axis), V)
    return {"lmi": float(check_lmis(problem, sol, o, V).worst.max()), "loop": float(loop.max())}
