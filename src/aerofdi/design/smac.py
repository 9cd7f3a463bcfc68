"""Design of SMAC-FDI for an aircraft file: the filter from its physics, everything else measured on its
closed loop.

1. Rate model: the aircraft linearised about level flight, folded into the three-state filter (section 3.1).
2. Health evaluators: each surface is excited in noise-free closed-loop flight; its answer R0 gives the
delay lambda, the
   answering share kappa and the loop gain (section 3.4).
3. Thresholds: healthy flights with the aircraft's sensor noise, without and with gusts, give the
uncertainty of (12).

No faulty flight is used. Source: paper "smac", sections 3.2 to 3.4; the formulas are in `smac_tuning`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..aircraft import hash as aircraft_hash
from ..autopilot import autopilot_of
from ..core import Array, CannotJudge, Design
from ..diagnosers import smac_types as t
from ..diagnosers.smac_ekf import RateModel, rate_model
from ..dynamics.atmosphere import density
from ..dynamics.build import plant_params
from ..dynamics.linearise import linearise
from ..dynamics.trim import Trim, trim
from . import smac_tuning as tune
from .smac_measure import Answers, Noise, dryden, level_flight, measure_answers, measure_noise
from .smac_spec import EVALUATORS, PAPER, RULES, Spec, make_spec

__all__ = ["PAPER", "Spec", "design_smac", "dryden", "level_flight", "make_spec"]

AXES = ("roll", "pitch", "yaw")
LEAST_ANSWER = 0.05
Progress = Callable[[str, float], None]


def commanded_surfaces(aircraft: Aircraft) -> tuple[str, ...]:
    """The surfaces the aircraft's autopilot commands, in the file's order; none is a refusal."""
    fields = autopilot_of(aircraft.autopilot, who=str(aircraft.path)).module.Command._fields
    names = tuple(s.name for s in aircraft.surfaces if s.name in fields)
    if not names:
        raise CannotJudge(
            f"aircraft {aircraft.name!r} has no surface its autopilot commands; SMAC needs at least one"
        )
    return names


def aircraft_rate_model(
    aircraft: Aircraft, condition: Trim, surfaces: tuple[str, ...], spec: Spec
) -> RateModel:
    """The filter's model: the aircraft's angular accelerations linearised about trim, gyroscopic terms
    exact.
    """
    names = ("p", "q", "r")
    model = linearise(aircraft, condition, states=("u", "v", "w", *names), inputs=surfaces)
    rows = [model.states.index(n) for n in names]
    A, B = model.A[rows], model.B[rows]
    V, alpha = condition.airspeed, condition.alpha
    body = plant_params(aircraft).body
    rho = float(density(body.air, condition.altitude))
    qbar = 0.5 * rho * V * V
    J, slope, fuel = body.mass.inertia, body.mass.inertia_slope, condition.state.fuel
    Jx, Jy, Jz, Jxz = (a + b * fuel for a, b in zip(J, slope, strict=True))
    inertia = np.array([[Jx, 0.0, -Jxz], [0.0, Jy, 0.0], [-Jxz, 0.0, Jz]])
    by_alpha = V * (math.cos(alpha) * A[:, 2] - math.sin(alpha) * A[:, 0])
    by_beta = V * A[:, 1]
    delta = np.array([condition.surfaces[aircraft.surface_index(s)] for s in surfaces])
    # In trim the accelerations are zero, which fixes the constant.
    constant = -(by_alpha * alpha + by_beta * condition.beta + B @ delta)
    # Coefficients of a unit area and length: moment = qbar C, damping on p / 2V.
    static = inertia @ np.column_stack([constant, by_alpha, by_beta]) / qbar
    damping = inertia @ A[:, 3:6] * (2.0 * V / qbar)
    damping[0, 1] = damping[1, 0] = damping[1, 2] = damping[2, 1] = 0.0
    return rate_model(
        inertia, 1.0, 1.0, 1.0, rho, static, inertia @ B / qbar, damping, spec.dt_s, spec.r_w, spec.r_v,
        spec.torque_scale, 0.3 * V,
    )  # fmt: skip


def _frequencies(axis: Array, spec: Spec) -> Array:
    """omega of every surface: together, twins get multiples of the base frequency; else all get it."""
    order = np.array([np.sum(axis[:i] == axis[i]) for i in range(len(axis))])
    return 2.0 * math.pi * spec.frequency_hz * (1.0 + order * spec.together)


def _probe(surfaces: tuple[str, ...], axis: Array, answers: Answers, dead: Array, spec: Spec) -> t.Probe:
    """Everything of the excitation and the evaluators from the measured answers."""
    n, dt, A = len(surfaces), spec.dt_s, math.radians(spec.amplitude_deg)
    window = round(1.0 / spec.frequency_hz / dt)
    twins = np.array([np.sum(axis == a) - 1 for a in axis])
    mean = np.array([1.0 - tune.low_pass(spec.f_i1_hz, w, dt) for w in answers.omega])
    noise = np.array([tune.low_pass(spec.f_i2_hz, w, dt) for w in answers.omega])
    known = np.where(np.abs(answers.value) < 1e-3, 1e-3 + 0j, answers.value)
    loop = np.array([tune.lone_loop(r, h) for r, h in zip(known, twins, strict=True)])
    alone = np.array([tune.lone_answer(x) for x in loop])
    heard = np.array(
        [tune.common_answer(r * m, x * m) for r, x, m in zip(answers.value, alone, mean, strict=True)]
    )
    # Without an answer (a surface the autopilot holds still) the command says nothing, the residual all.
    heard = np.where(np.abs(answers.value) < LEAST_ANSWER, 0j, heard)
    # Sound twins share the answer, a lone one gives all of it: the rectified evaluator aims between the two.
    middle = 0.5 * (answers.value + alone) * mean * noise
    kappa = np.abs(middle) if spec.kappa is None else np.full(n, spec.kappa)
    lag = np.array([tune.opposite_delay(x, w, dt) for x, w in zip(middle, answers.omega, strict=True)])
    surface = np.column_stack(
        [
            np.full(n, A), answers.omega * dt, np.full(n, A), np.full(n, spec.lambda_share * tune.lambda_max(A)), kappa,
            loop.real, loop.imag, heard.real, heard.imag, dead.real, dead.imag, np.zeros(n),
        ]
    )  # fmt: skip
    slots = [(axis == a) for a in dict.fromkeys(axis)] if spec.together else list(np.eye(n, dtype=bool))
    k = np.arange(window)[:, None] * answers.omega * dt
    return t.Probe(
        EVALUATORS[spec.evaluator], tune.share(spec.f_i1_hz, dt), tune.share(spec.f_i2_hz, dt),
        tune.share(spec.f_i3_hz, dt), tune.share(0.15, dt), window, spec.stuck_below, np.ascontiguousarray(surface),
        np.column_stack([axis, lag]).astype(np.int64), np.array(slots, dtype=np.int64),
        np.hstack([np.cos(k), np.sin(k)]),
    )  # fmt: skip


def _timing(spec: Spec) -> t.Timing:
    def n(seconds: float) -> int:
        return round(seconds / spec.dt_s)

    return t.Timing(
        n(spec.settle_s), n(spec.test_min_s), n(spec.test_max_s), n(spec.confirm_s), n(spec.recover_s), n(spec.rest_s),
        n(spec.retest_s), n(spec.sweep_every_s), spec.odds,
    )  # fmt: skip


def _axes(sensitivity: Array, groups: tuple[str, ...]) -> Array:
    """The axis each surface is tested on: that of its group by name, else where the surface acts most."""
    own = {"aileron": 0, "elevator": 1, "rudder": 2}
    most = np.argmax(np.abs(sensitivity), axis=0)
    return np.array([own.get(g, int(a)) for g, a in zip(groups, most, strict=True)])


def design_smac(
    aircraft: Aircraft, spec: Spec | Mapping[str, Any] | None = None, progress: Progress | None = None
) -> Design:
    """SMAC-FDI for one aircraft file.

    spec: see `Spec`; `PAPER` is the paper's. progress(text, share) is called now and then. The result is
    run by `diagnosers.smac.from_design`. Its certificate holds, per axis, the window (12) and the noise it
    came from, and per surface the measured answer, lambda, kappa, and the smallest stuck angle about trim
    (13).

    Raises CannotJudge where the window (12) is empty for spec.smallest_fault_deg, saying which uncertainty
    to reduce, or where a surface gets no answer; WrongUse for unknown settings.

    The same aircraft and spec give the same design. Takes some seconds: three short closed-loop flights.
    """
    spec, say = make_spec(spec), progress or (lambda text, share: None)
    condition = trim(aircraft, spec.airspeed)
    surfaces = commanded_surfaces(aircraft)
    model = aircraft_rate_model(aircraft, condition, surfaces, spec)
    V = condition.airspeed
    sensitivity = np.ascontiguousarray(tune.residual_response(model, V).real)
    groups = tuple(aircraft.surface(s).group for s in surfaces)
    axis = _axes(sensitivity, groups)
    answers = measure_answers(aircraft, condition, surfaces, _frequencies(axis, spec), spec, say)
    weak = [s for s, r in zip(surfaces, answers.value, strict=True) if abs(r) < LEAST_ANSWER]
    if weak and spec.evaluator != "fused":
        raise CannotJudge(
            f"the autopilot of {aircraft.name!r} answers an excitation of {', '.join(weak)} by less than 5 %; raise its "
            f"gains, lower frequency_hz, or use the evaluator 'fused'"
        )
    # A surface that does not move leaves delta - delta_c = -delta_s.
    dead = np.array(
        [
            -tune.residual_response(model, V, w)[a, i]
            for i, (a, w) in enumerate(zip(axis, answers.omega, strict=True))
        ]
    )
    probe = _probe(surfaces, axis, answers, dead, spec)
    draft = _params(model, sensitivity, probe, np.full(3, np.inf), STILL, aircraft, spec)
    noise = measure_noise(aircraft, condition, surfaces, draft, spec, say)
    # No servo holds an angle better than this, however good the sensors of the file are.
    least = np.abs(sensitivity).max(axis=1) * math.radians(spec.resolution_deg) / spec.threshold_sigmas
    noise = noise._replace(level=np.maximum(noise.level, least))
    wind = _wind_law(noise) if spec.follow_wind else STILL
    windows, thresholds = _thresholds(model, V, sensitivity, axis, noise, spec)
    probe.surface[:, t.ANGLE_STD] = [
        noise.slow[a] / abs(sensitivity[a, i]) for i, a in enumerate(axis)
    ]  # fmt: skip
    params = _params(model, sensitivity, probe, thresholds, wind, aircraft, spec)
    certificate = _certificate(surfaces, axis, answers, probe, noise, windows, thresholds, sensitivity, wind)
    table = asdict(spec) | {"surfaces": list(surfaces), "groups": list(groups), "aircraft": aircraft.name}
    table |= {"airspeed": V, "axis": [] if spec.axis is None else list(spec.axis)}
    say("done", 1.0)
    return Design("smac", table, aircraft_hash(aircraft), t.flatten(params), certificate)


def _params(
    model: RateModel, sensitivity: Array, probe: t.Probe, axis: Array, wind: Wind,
    aircraft: Aircraft, spec: Spec,
) -> t.Params:  # fmt: skip
    dt, rad = spec.dt_s, math.radians
    vanes = int({"alpha", "beta"} <= set(aircraft.sensors))
    silent = not np.isfinite(axis).any()
    detector = t.Detector(
        RULES[spec.rule], tune.share(spec.f1_hz, dt), tune.share(spec.f2_hz, dt),
        math.inf if silent else spec.gamma2 if spec.rule == "sum" else 1.0, spec.release, wind.floor, spec.suspect,
        tune.share(0.5, dt), tune.share(0.05, dt), tune.share(0.016, dt), tune.share(0.15, dt),
        tune.share(0.006, dt), np.asarray(axis, float), wind.gain, wind.quiet, sensitivity,
    )  # fmt: skip
    budget = t.Budget(spec.seconds, rad(spec.bank_deg), rad(spec.pitch_deg), spec.altitude_m, spec.track_m)
    ages = np.full(t.FIRST + 2 * len(probe.surface) + 1, spec.max_age_s)
    ages[-1] = math.inf
    if not vanes:
        ages[[t.ALPHA, t.BETA]] = math.inf
    return t.Params(vanes, model, detector, probe, _timing(spec), budget, ages)


class Wind(NamedTuple):
    """How thresholds follow the wind; see `smac_types.Detector`. gain, quiet (3,), floor (rad2)."""

    gain: Array
    quiet: Array
    floor: float


STILL = Wind(np.zeros(3), np.full(3, np.inf), 0.0)


def _wind_law(noise: Noise) -> Wind:
    """Each threshold grows as its residual did in the gusts of the training flight."""
    more = noise.activity - noise.floor
    gain = (
        np.sqrt(np.maximum((noise.gusty / noise.level) ** 2 - 1.0, 0.0) / more) if more > 0 else np.zeros(3)
    )
    return Wind(gain, noise.level, noise.floor)


def _thresholds(
    model: RateModel, V: float, sensitivity: Array, axis: Array, noise: Noise, spec: Spec
) -> tuple[dict[int, tuple[float, float]], Array]:
    """(12) for every axis with a surface: the window, and the threshold at its lower end (or the given
    one).
    """
    stiff = tune.stiffness(model, V)
    out, thresholds = {}, spec.threshold_sigmas * noise.level
    for a in sorted(set(int(x) for x in axis)):
        members = [i for i in range(len(axis)) if axis[i] == a]
        gain = max(abs(sensitivity[a, i]) for i in members)
        heard = spec.threshold_sigmas * float(noise.level[a]) / gain
        quiet = heard <= math.radians(spec.resolution_deg) * (1.0 + 1e-9)
        gamma = {"servo resolution" if quiet else "sensor noise": heard}
        # Its sound twins re-trim the aircraft, so the deviation is the stuck angle once more for each.
        deviation = math.radians(spec.smallest_fault_deg or 0.0) * len(members)
        if spec.smallest_fault_deg is None:
            deviation = tune.smallest_detectable(sum(gamma.values())) * (1.0 + 1e-9)
        window = tune.threshold_window(
            gain * float(stiff[a]), float(stiff[a]), deviation, gamma, _where(a, len(members))
        )
        out[a] = (window.low, window.high)
        thresholds[a] = window.low
    return out, thresholds if spec.axis is None else np.array(spec.axis, float)


def _where(axis: int, members: int) -> str:
    """The axis in an error about (12), whose deviations count the twins that re-trim the aircraft."""
    twins = "" if members == 1 else f" (where each degree of a stuck surface is {members} deg of deviation)"
    return f"the {AXES[axis]} axis{twins}"


def _certificate(
    surfaces: tuple[str, ...], axis: Array, answers: Answers, probe: t.Probe, noise: Noise,
    windows: dict[int, tuple[float, float]], thresholds: Array, sensitivity: Array, wind: Wind,
) -> dict[str, Any]:  # fmt: skip
    """Plain numbers: where every threshold comes from and what it can find."""
    per_surface = {}
    for i, s in enumerate(surfaces):
        a, members = int(axis[i]), int(np.sum(axis == axis[i]))
        found = 2.0 * thresholds[a] / abs(sensitivity[a, i]) / members
        per_surface[s] = {
            "axis": AXES[a],
            "frequency_hz": float(answers.omega[i] / (2.0 * math.pi)),
            "answer": float(abs(answers.value[i])),
            "answer_lag_deg": float(np.degrees(np.angle(-1.0 / (answers.value[i] or 1.0)))),
            "lambda_samples": int(probe.place[i, t.LAG]),
            "kappa": float(probe.surface[i, t.REPLY]),
            "lambda_threshold_rad": float(probe.surface[i, t.THRESHOLD]),
            "smallest_stuck_angle_deg": float(np.degrees(found)),
            "angle_std_deg": float(np.degrees(probe.surface[i, t.ANGLE_STD])),
        }
    per_axis = {
        AXES[a]: {
            "threshold_rad_s": float(thresholds[a]),
            "window_rad_s": [float(x) for x in windows[a]],
            "noise_rad_s": float(noise.level[a]),
            "noise_in_gusts_rad_s": float(noise.gusty[a]),
        }
        for a in windows
    }
    return {
        "surfaces": per_surface,
        "axes": per_axis,
        "wind_gain": wind.gain.tolist(),
        "wind_floor_rad2": noise.floor,
    }
