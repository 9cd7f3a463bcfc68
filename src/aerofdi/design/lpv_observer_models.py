"""An aircraft file as the two estimation problems of `lpv_observer`: linear models, weights, controllers,
actuators.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..autopilot.gains import load_gains
from ..core import Array, WrongUse
from ..dynamics.linearise import LATERAL, lpv_grid
from .estimator import Estimation
from .lpv import Gridded, interpolate, transfer
from .lpv_observer_plants import Controller, Ratio, Weights, delay_free_actuator, estimation

AXES = ("lat", "lon")
DEG = math.pi / 180.0
LON = ("q", "w")
# Wf of "stuck_lpv": size (rad) and corner (rad/s) of the fault input of aileron and elevator, chosen by
# `stuck_study`.
FAULT = {"lat": (20.0 * DEG, 3.0), "lon": (4.0 * DEG, 3.0)}


def fault_weight(size: float, corner: float) -> Ratio:
    """Wf = size * corner/(s + corner): a stuck surface differs from its command mostly slowly."""
    return Ratio((size * corner,), (1.0, corner))


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
    """W = 1/Sbar, Sbar first order with these gains, 3 dB below its high-frequency gain at `bandwidth`
    (rad/s).

    Sbar = (h s + d w0)/(s + w0), d = dc, h = high gain, w0 from |Sbar(j bandwidth)| = h/sqrt 2.

    >>> W = sensitivity_weight(-35.0, 1.0, 4.0)
    >>> [round(x, 3) for x in (*W.num, *W.den)]
    [1.0, 4.001, 1.122, 0.071]
    """
    d, h = 10.0 ** (dc_db / 20.0), 10.0 ** (high_db / 20.0)
    # h^2 W^2 + d^2 w0^2 = (h^2/2)(W^2 + w0^2)
    if d >= h / math.sqrt(2.0):
        raise WrongUse(f"a sensitivity bound of {dc_db} dB at rest and {high_db} dB above has no -3 dB point")
    w0 = bandwidth * math.sqrt((0.5 * h * h) / (0.5 * h * h - d * d))
    return Ratio((1.0, w0), (h, d * w0))


def default_weights(aircraft: Aircraft, models: Models, nominal: float) -> dict[str, Weights]:
    """Tables 2 and 3 for the Vireo as printed; for other aircraft the same sizes, and shapes moved to its own
    modes.

    The corner frequencies of W_Delta move with the actuator bandwidth (lateral) and the short period
    (longitudinal), those of W with Dutch roll and short period. Sizes of disturbances are the paper's.
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
            f"aircraft {aircraft.name!r} has no [autopilot]; the observer needs the roll and "
            f"pitch-rate gains it flies with"
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


def axes_of(
    aircraft: Aircraft,
    models: Models,
    nominal: float,
    fault: bool = False,
    weights: Mapping[str, Weights] | None = None,
) -> dict[str, Axis]:
    """Both axes of an aircraft with the given weights, else the default ones, with the fault as an input
    (FAULT) or without.
    """
    if weights is None:
        weights = default_weights(aircraft, models, nominal)
        if fault:
            weights = {a: w._replace(fault=fault_weight(*FAULT[a])) for a, w in weights.items()}
    k = _controllers(aircraft)
    out = {}
    for name, command in zip(AXES, ("aileron", "elevator"), strict=True):
        model = lambda V, name=name: models.at(name, V)
        out[name] = Axis(name, model, _actuator(aircraft, command), weights[name], k[name])
    return out


def weights_table(w: Weights) -> dict[str, Any]:
    """Weights as plain numbers, for a Design's spec."""
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


def mixing(aircraft: Aircraft) -> tuple[list[str], list[list[float]]]:
    """Names of the surfaces that answer elevator or aileron, and their rows [elevator, aileron]."""
    moved = [s for s in aircraft.surfaces if "elevator" in s.command or "aileron" in s.command]
    return [s.name for s in moved], [
        [s.command.get("elevator", 0.0), s.command.get("aileron", 0.0)] for s in moved
    ]
