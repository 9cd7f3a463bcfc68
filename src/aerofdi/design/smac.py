"""Design of SMAC-FDI for an aircraft file: the filter from its physics, everything else measured on its closed loop.

1. Rate model: the aircraft linearised about level flight, folded into the three-state filter (section 3.1).
2. Health evaluators: each surface is excited in noise-free closed-loop flight; its answer R0 gives the delay lambda, the
   answering share kappa and the loop gain (section 3.4).
3. Thresholds: healthy flights with the aircraft's sensor noise, without and with gusts, give the uncertainty of (12).

No faulty flight is used. Source: paper "smac", sections 3.2 to 3.4; the formulas are in `smac_tuning`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..aircraft import hash as aircraft_hash
from ..autopilot import autopilot_of
from ..core import Array, CannotJudge, Design, Flight, Series, WrongUse, bind, run
from ..diagnosers import smac as online
from ..diagnosers import smac_types as t
from ..diagnosers.smac_ekf import RateModel, rate_model
from ..dynamics.build import plant_params
from ..dynamics.linearise import linearise
from ..dynamics.trim import Trim, trim
from ..dynamics.wind import low_altitude
from ..scenarios import Guidance, Point, Scenario, Start, Turbulence, WindSpec
from ..simulate import fly, fly_with
from . import smac_tuning as tune
from .exciter import exciter, fourier_answer

EVALUATORS = {"rectified": t.RECTIFIED, "synchronous": t.SYNCHRONOUS, "fused": t.FUSED}
RULES = {"sum": t.SUM, "axes": t.AXES}
AXES = ("roll", "pitch", "yaw")
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Spec:
    """What is chosen; SI and rad unless the name says otherwise. The defaults are not the paper's: see `PAPER`.

    airspeed: m/s, None: the file's. dt_s: s. rule: "axes" or "sum" (5). evaluator: "fused", "synchronous" or
    "rectified" (17). together: test the surfaces of a group at once, each at its own frequency. amplitude_deg: A.
    frequency_hz: of the excitation; together, twins get its multiples. f1_hz, f2_hz: LP1, LP2. f_i1_hz, f_i2_hz,
    f_i3_hz: of the evaluators. threshold_sigmas: the noise part of sup|gamma| in standard deviations. gamma2: for
    "sum", rad/s. axis: p, q, r thresholds instead of computed ones, rad/s. smallest_fault_deg: stuck angle about trim
    that must be found, None: whatever the noise allows. lambda_share: Lambda_thresh as a share of 2A/pi. kappa: answering
    share, None: measured. torque_scale: of the model's torques. r_w, r_v: noise of the filter. odds: log-likelihood ratio
    that decides a test; a wrong decision has a probability below exp(-odds) if the noise is as heard. follow_wind: thresholds
    grow with the measured gusts, up to wind_cap times. wind: standard deviation of the gusts
    of the training flights, m/s. seconds, bank_deg, pitch_deg, altitude_m, track_m: excitation budget.
    sweep_every_s: test all surfaces this often without suspicion, 0: never. Times of the isolator in s.
    """

    airspeed: float | None = None
    dt_s: float = 0.02
    rule: str = "axes"
    evaluator: str = "fused"
    together: bool = True
    amplitude_deg: float = 2.0
    frequency_hz: float = 1.0
    f1_hz: float = 0.5
    f2_hz: float = 0.5
    f_i1_hz: float = 0.3
    f_i2_hz: float = 3.0
    f_i3_hz: float = 0.35
    threshold_sigmas: float = 4.0
    gamma2: float = 0.025
    axis: tuple[float, float, float] | None = None
    release: float = 0.5
    smallest_fault_deg: float | None = None
    lambda_share: float = 0.45
    kappa: float | None = None
    stuck_below: float = 0.3
    torque_scale: float = 1.0
    r_w: float = 2.0
    r_v: float = 0.1
    odds: float = 8.0
    follow_wind: bool = True
    wind_cap: float = 3.0
    wind: float = 2.5
    seconds: float = 240.0
    bank_deg: float = 30.0
    pitch_deg: float = 15.0
    altitude_m: float = 30.0
    track_m: float = 100.0
    sweep_every_s: float = 0.0
    settle_s: float = 8.0
    test_min_s: float = 1.2
    test_max_s: float = 20.0
    confirm_s: float = 0.1
    recover_s: float = 0.3
    rest_s: float = 2.0
    retest_s: float = 10.0
    max_age_s: float = 0.1
    calibration_s: float = 120.0
    seed: int = 1


# What the paper states (sections 3.1.4, 3.2.2, 3.4.4, 3.5, 4); f_i1 by (19) with 5 % in 1.6 s, the rest is not stated.
PAPER = Spec(
    rule="sum", evaluator="rectified", together=False, f1_hz=0.4, f2_hz=0.4, axis=(0.03, 0.2, 0.5), gamma2=0.025,
    lambda_share=0.01 / tune.lambda_max(math.radians(2.0)), kappa=1.0, torque_scale=0.75, follow_wind=False,
    release=1.0, test_max_s=4.0,
)  # fmt: skip


class Answers(NamedTuple):
    """Measured on the healthy loop without noise: complex R0 of every surface at its frequency, (nu,), and omega (nu,)."""

    value: Array
    omega: Array


def make_spec(spec: Spec | Mapping[str, Any] | None) -> Spec:
    """A Spec from itself, from a mapping of its fields, or the default; unknown names are refused."""
    if spec is None or isinstance(spec, Spec):
        out = spec or Spec()
    else:
        unknown = [k for k in spec if k not in Spec.__dataclass_fields__]
        if unknown:
            raise WrongUse(
                f"smac has no setting {', '.join(unknown)}; it has {', '.join(Spec.__dataclass_fields__)}"
            )
        out = Spec(**dict(spec))
    for value, known, what in ((out.rule, RULES, "rule"), (out.evaluator, EVALUATORS, "evaluator")):
        if value not in known:
            raise WrongUse(f"smac: {what} {value!r} is not known; known are {', '.join(known)}")
    if out.together and out.evaluator == "rectified":
        raise WrongUse(
            "smac: the rectified evaluator cannot test surfaces together; choose 'fused' or together=False"
        )
    return out


def level_flight(aircraft: Aircraft, condition: Trim, duration_s: float, **changes: Any) -> Scenario:
    """Straight and level flight from trim, the scenario every measurement here is made in."""
    V, h = condition.airspeed, condition.altitude
    settings: dict[str, Any] = {"name": "smac design", "title": "straight and level", "seed": 1}
    return Scenario(
        aircraft=str(aircraft.path), duration_s=duration_s, start=Start(V, h),
        guidance=Guidance("heading", (Point(0.0, V, h, 0.0),)), **(settings | changes),
    )  # fmt: skip


def dryden(altitude: float, sigma: float) -> WindSpec:
    """Dryden gusts of the same standard deviation (m/s) along all axes, with the scale lengths of the altitude (m)."""
    _, length = low_altitude(min(altitude, 300.0), 1.0)
    return WindSpec(turbulence=Turbulence("dryden", 0.0, (sigma,) * 3, (length[0], length[1], length[2])))


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
    """The filter's model: the aircraft's angular accelerations linearised about trim, gyroscopic terms exact."""
    names = ("p", "q", "r")
    model = linearise(aircraft, condition, states=("u", "v", "w", *names), inputs=surfaces)
    rows = [model.states.index(n) for n in names]
    A, B = model.A[rows], model.B[rows]
    V, alpha = condition.airspeed, condition.alpha
    body = plant_params(aircraft).body
    rho = _density(aircraft, condition)
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


def _density(aircraft: Aircraft, condition: Trim) -> float:
    from ..dynamics.atmosphere import density

    return float(density(plant_params(aircraft).body.air, condition.altitude))


def measure_answers(
    aircraft: Aircraft,
    condition: Trim,
    surfaces: tuple[str, ...],
    omega: Array,
    spec: Spec,
    progress: Progress,
) -> Answers:
    """R0 of every surface: one noise-free flight each surface excited in turn at a quarter of A, whole periods at the
    end of each turn compared."""
    turn, pause = 8.0, 6.0
    n = len(surfaces)
    start = 2.0 + (turn + pause) * np.arange(n)
    amplitude = np.full(n, 0.25 * math.radians(spec.amplitude_deg))
    d = exciter(surfaces, amplitude, omega, start, start + turn, spec.dt_s)
    progress("measuring the answers of the closed loop", 0.1)
    flight = fly_with(
        level_flight(aircraft, condition, float(start[-1] + turn), noise_factor=0.0), [d]
    ).flight
    if flight.meta["diverged"]:
        raise CannotJudge(
            f"aircraft {aircraft.name!r} does not survive an excitation of {spec.amplitude_deg / 4} deg"
        )
    out = []
    for i, s in enumerate(surfaces):
        periods = max(1, math.floor(4.0 * omega[i] / (2.0 * math.pi)))
        stop = start[i] + turn
        t0 = stop - periods * 2.0 * math.pi / omega[i]
        grid = np.arange(t0, stop - 1e-9, spec.dt_s)
        command, excitation = (
            _at(flight.measured[f"{kind}.{s}"], grid) for kind in ("command", "excitation")
        )
        out.append(fourier_answer(command, excitation, float(omega[i]), spec.dt_s))
    return Answers(np.array(out), omega)


def _at(series: Series, grid: Array) -> Array:
    return np.asarray(series.value[np.searchsorted(series.t_s, grid + 1e-9, side="right") - 1])


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
    loop = np.array([tune.lone_loop(r, h) for r, h in zip(answers.value, twins, strict=True)])
    alone = np.array([tune.lone_answer(x) for x in loop])
    heard = np.array(
        [tune.common_answer(r * m, x * m) for r, x, m in zip(answers.value, alone, mean, strict=True)]
    )
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


class Noise(NamedTuple):
    """What healthy flights show. level (3,): standard deviation of the residuals behind both low-passes, rad/s; slow
    (3,): behind the estimate's filter. gusty (3,): the first in gusts. floor, activity: of the vanes, rad2."""

    level: Array
    slow: Array
    gusty: Array
    floor: float
    activity: float


def _listen(
    params: t.Params, surfaces: tuple[str, ...], flight: Flight, spec: Spec
) -> tuple[Array, Array, float]:
    """Standard deviations of the two filtered residuals, and vane activity, of one healthy flight."""
    d = online.from_design(_as_design(params, surfaces, ("",) * len(surfaces)))
    some = flight.measured[f"command.{surfaces[0]}"]
    zero = some._replace(value=np.zeros(len(some.value)))
    flight = flight.with_measured(**{f"excitation.{s}": zero for s in surfaces})
    sample = bind(flight, d.inputs, d.dt_s, who="smac design")
    _, verdict = run(d, sample)
    after = sample.t_s > 10.0
    level = np.sqrt(np.mean(verdict.residual[after, :3] ** 2, axis=0))
    activity = np.mean(_vane_activity(params.detector, sample.z[after]))
    # The estimate's filter is slower than LP1 and LP2 together: apply it to their output, which it dominates.
    from scipy.signal import lfilter

    a = params.detector.a_estimate
    slow = lfilter([a], [1.0, a - 1.0], verdict.residual[after, :3], axis=0)
    return level, np.sqrt(np.mean(slow**2, axis=0)), float(activity)


def _vane_activity(d: t.Detector, z: Array) -> Array:
    """The wind measure of the diagnoser before its last filter, rad2."""
    from scipy.signal import lfilter

    vanes = z[:, [t.ALPHA, t.BETA]]
    if not np.isfinite(vanes).all():
        return np.zeros(len(z))
    fast, slow = (
        lfilter([a], [1.0, a - 1.0], vanes, axis=0, zi=(1.0 - a) * vanes[:1])[0] for a in (d.a_fast, d.a_slow)
    )
    return np.sum((fast - slow) ** 2, axis=1)


def _as_design(params: t.Params, surfaces: tuple[str, ...], groups: tuple[str, ...]) -> Design:
    return Design("smac", {"surfaces": list(surfaces), "groups": list(groups)}, "", t.flatten(params), {})


def measure_noise(
    aircraft: Aircraft,
    condition: Trim,
    surfaces: tuple[str, ...],
    params: t.Params,
    spec: Spec,
    progress: Progress,
) -> Noise:
    """Healthy flights with sensor noise, in still air and in Dryden gusts of spec.wind m/s, through the diagnoser."""
    progress("flying healthy in still air", 0.5)
    base = level_flight(aircraft, condition, spec.calibration_s, seed=spec.seed)
    level, slow, floor = _listen(params, surfaces, fly(base), spec)
    progress("flying healthy in gusts", 0.7)
    gusts = dryden(condition.altitude, spec.wind)
    windy = level_flight(aircraft, condition, spec.calibration_s, seed=spec.seed + 1, wind=gusts)
    gusty, _, activity = _listen(params, surfaces, fly(windy), spec)
    return Noise(level, slow, gusty, floor, activity)


def _axes(sensitivity: Array) -> Array:
    """The axis each surface belongs to: where it acts most, measured in the strongest surface of each axis."""
    strongest = np.abs(sensitivity).max(axis=1, keepdims=True)
    return np.asarray(np.argmax(np.abs(sensitivity) / np.where(strongest > 0, strongest, np.inf), axis=0))


def design_smac(
    aircraft: Aircraft, spec: Spec | Mapping[str, Any] | None = None, progress: Progress | None = None
) -> Design:
    """SMAC-FDI for one aircraft file.

    spec: see `Spec`; `PAPER` is the paper's. progress(text, share) is called now and then. The result is run by
    `diagnosers.smac.from_design`. Its certificate holds, per axis, the window (12) and the noise it came from, and per
    surface the measured answer, lambda, kappa, and the smallest stuck angle about trim (13).

    Raises CannotJudge where the window (12) is empty for spec.smallest_fault_deg, saying which uncertainty to reduce,
    or where a surface gets no answer; WrongUse for unknown settings.

    The same aircraft and spec give the same design. Takes some seconds: three short closed-loop flights.
    """
    spec, say = make_spec(spec), progress or (lambda text, share: None)
    condition = trim(aircraft, spec.airspeed)
    surfaces = commanded_surfaces(aircraft)
    model = aircraft_rate_model(aircraft, condition, surfaces, spec)
    V = condition.airspeed
    sensitivity = np.ascontiguousarray(tune.residual_response(model, V).real)
    axis = _axes(sensitivity)
    answers = measure_answers(aircraft, condition, surfaces, _frequencies(axis, spec), spec, say)
    weak = [s for s, r in zip(surfaces, answers.value, strict=True) if abs(r) < 0.05]
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
    groups = tuple(aircraft.surface(s).group for s in surfaces)
    draft = _params(model, sensitivity, probe, np.full(3, np.inf), np.zeros(3), 0.0, aircraft, spec)
    noise = measure_noise(aircraft, condition, surfaces, draft, spec, say)
    wind = _wind_law(noise) if spec.follow_wind else np.zeros(3)
    windows, thresholds = _thresholds(model, V, sensitivity, axis, noise, spec)
    probe.surface[:, t.ANGLE_STD] = [
        noise.slow[a] / abs(sensitivity[a, i]) for i, a in enumerate(axis)
    ]  # fmt: skip
    params = _params(model, sensitivity, probe, thresholds, wind, noise.floor, aircraft, spec)
    certificate = _certificate(surfaces, axis, answers, probe, noise, windows, thresholds, sensitivity, wind)
    table = asdict(spec) | {"surfaces": list(surfaces), "groups": list(groups), "aircraft": aircraft.name}
    table |= {"airspeed": V, "axis": [] if spec.axis is None else list(spec.axis)}
    say("done", 1.0)
    return Design("smac", table, aircraft_hash(aircraft), t.flatten(params), certificate)


def _params(
    model: RateModel, sensitivity: Array, probe: t.Probe, axis: Array, wind: Array, floor: float,
    aircraft: Aircraft, spec: Spec,
) -> t.Params:  # fmt: skip
    dt, rad = spec.dt_s, math.radians
    vanes = int({"alpha", "beta"} <= set(aircraft.sensors))
    silent = not np.isfinite(axis).any()
    detector = t.Detector(
        RULES[spec.rule], tune.share(spec.f1_hz, dt), tune.share(spec.f2_hz, dt),
        math.inf if silent else spec.gamma2 if spec.rule == "sum" else 1.0, spec.release, floor, spec.wind_cap,
        tune.share(0.5, dt), tune.share(0.05, dt), tune.share(0.016, dt), tune.share(0.15, dt),
        np.asarray(axis, float), wind, sensitivity,
    )  # fmt: skip
    budget = t.Budget(spec.seconds, rad(spec.bank_deg), rad(spec.pitch_deg), spec.altitude_m, spec.track_m)
    ages = np.full(t.FIRST + 2 * len(probe.surface) + 1, spec.max_age_s)
    ages[-1] = math.inf
    if not vanes:
        ages[[t.ALPHA, t.BETA]] = math.inf
    return t.Params(vanes, model, detector, probe, _timing(spec), budget, ages)


def _wind_law(noise: Noise) -> Array:
    """wind_gain (3,): each threshold grows as sqrt(1 + gain^2 (activity - floor)), as its residual did in the gusts."""
    more = noise.activity - noise.floor
    if more <= 0:
        return np.zeros(3)
    return np.sqrt(np.maximum((noise.gusty / noise.level) ** 2 - 1.0, 0.0) / more)


def _thresholds(
    model: RateModel, V: float, sensitivity: Array, axis: Array, noise: Noise, spec: Spec
) -> tuple[dict[int, tuple[float, float]], Array]:
    """(12) for every axis with a surface: the window, and the threshold at its lower end (or the given one)."""
    stiff = tune.stiffness(model, V)
    out, thresholds = {}, spec.threshold_sigmas * noise.level
    for a in sorted(set(int(x) for x in axis)):
        members = [i for i in range(len(axis)) if axis[i] == a]
        gain = max(abs(sensitivity[a, i]) for i in members)
        gamma = {"sensor noise": spec.threshold_sigmas * float(noise.level[a]) / gain}
        # Its sound twins re-trim the aircraft, so the deviation is the stuck angle once more for each.
        deviation = math.radians(spec.smallest_fault_deg or 0.0) * len(members)
        if spec.smallest_fault_deg is None:
            deviation = tune.smallest_detectable(sum(gamma.values())) * (1.0 + 1e-9)
        window = tune.threshold_window(
            gain * float(stiff[a]), float(stiff[a]), deviation, gamma, f"the {AXES[a]} axis"
        )
        out[a] = (window.low, window.high)
        thresholds[a] = window.low
    return out, thresholds if spec.axis is None else np.array(spec.axis, float)


def _certificate(
    surfaces: tuple[str, ...], axis: Array, answers: Answers, probe: t.Probe, noise: Noise,
    windows: dict[int, tuple[float, float]], thresholds: Array, sensitivity: Array, wind: Array,
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
            "answer_lag_deg": float(np.degrees(np.angle(-1.0 / answers.value[i]))),
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
        "wind_gain": wind.tolist(),
        "wind_floor_rad2": noise.floor,
    }
