"""What is chosen in a SMAC design, and the paper's choice."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..core import WrongUse
from ..diagnosers import smac_types as t
from .smac_tuning import lambda_max

EVALUATORS = {"rectified": t.RECTIFIED, "synchronous": t.SYNCHRONOUS, "fused": t.FUSED}
RULES = {"sum": t.SUM, "axes": t.AXES}


@dataclass(frozen=True)
class Spec:
    """What is chosen; SI and rad unless the name says otherwise. The defaults are not the paper's: see
    `PAPER`.

    airspeed: m/s, None: the file's. dt_s: s. rule: "axes" or "sum" (5). evaluator: "fused", "synchronous"
    or "rectified" (17). together: test the surfaces of a group at once, each at its own frequency.
    amplitude_deg: A. frequency_hz: of the excitation; together, twins get its multiples. f1_hz, f2_hz: LP1,
    LP2. f_i1_hz, f_i2_hz, f_i3_hz: of the evaluators. threshold_sigmas: the noise part of sup|gamma| in
    standard deviations. gamma2: for "sum", rad/s. axis: p, q, r thresholds instead of computed ones, rad/s.
    resolution_deg: deviation of a surface that is no fault.
    smallest_fault_deg: stuck angle about trim that must be found, None: whatever the noise allows.
    lambda_share: Lambda_thresh as a share of 2A/pi. kappa: answering share, None: measured. torque_scale:
    of the model's torques. r_w, r_v: noise of the filter. odds: log-likelihood ratio that decides a test; a
    wrong decision has a probability below exp(-odds) if the noise is as heard. follow_wind: thresholds
    grow with the gusts, as vanes and residuals tell them; then a test starts at the share `suspect` of the
    threshold. wind: standard deviation of the gusts of the training flights, m/s. seconds, bank_deg, pitch_deg,
    altitude_m, track_m: excitation budget. sweep_every_s: test all surfaces this often without suspicion, 0:
    never. Times of the isolator in s.
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
    resolution_deg: float = 0.1
    smallest_fault_deg: float | None = None
    lambda_share: float = 0.45
    kappa: float | None = None
    stuck_below: float = 0.3
    torque_scale: float = 1.0
    r_w: float = 2.0
    r_v: float = 0.1
    odds: float = 8.0
    follow_wind: bool = True
    suspect: float = 0.6
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


# What the paper states (sections 3.1.4, 3.2.2, 3.4.4, 3.5, 4); f_i1 by (19) with 5 % in 1.6 s, the rest is
# not stated.
PAPER = Spec(
    rule="sum", evaluator="rectified", together=False, f1_hz=0.4, f2_hz=0.4, axis=(0.03, 0.2, 0.5), gamma2=0.025,
    lambda_share=0.01 / lambda_max(math.radians(2.0)), kappa=1.0, torque_scale=0.75, follow_wind=False,
    release=1.0, test_max_s=4.0,
)  # fmt: skip


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
    _check_numbers(out)
    if out.together and out.evaluator == "rectified":
        raise WrongUse(
            "smac: the rectified evaluator cannot test surfaces together; choose 'fused' or together=False"
        )
    return out


# Settings that must be above 0; every other number may be 0, and airspeed, smallest_fault_deg and kappa None.
_POSITIVE = (
    "airspeed", "dt_s", "amplitude_deg", "frequency_hz", "f1_hz", "f2_hz", "f_i1_hz", "f_i2_hz", "f_i3_hz",
    "threshold_sigmas", "gamma2", "release", "smallest_fault_deg", "lambda_share", "kappa", "torque_scale", "r_w", "r_v",
    "odds", "max_age_s", "test_max_s",
)  # fmt: skip
_SHARES = ("release", "lambda_share", "stuck_below", "suspect")
_OTHER = ("rule", "evaluator", "together", "follow_wind", "axis")
_OPTIONAL = ("airspeed", "smallest_fault_deg", "kappa")
_SAMPLES_A_PERIOD, _CALIBRATION_S = 10, 20.0


def _check_numbers(spec: Spec) -> None:
    """Refuse a setting that is no number or outside its range, by name."""
    for name in Spec.__dataclass_fields__:
        value = getattr(spec, name)
        if name in _OTHER or (value is None and name in _OPTIONAL):
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise WrongUse(f"smac: {name} {value!r} was given; a number is accepted")
        if value < 0 or (value == 0 and name in _POSITIVE) or (value > 1 and name in _SHARES):
            low = "above 0" if name in _POSITIVE else "0 or more"
            high = ", at most 1" if name in _SHARES else ""
            raise WrongUse(f"smac: {name} = {value} was given; numbers {low}{high} are accepted")
    if spec.axis is not None and not (len(spec.axis) == 3 and all(a > 0 for a in spec.axis)):
        raise WrongUse(
            f"smac: axis = {spec.axis} was given; three thresholds above 0 (p, q, r; rad/s) are accepted"
        )
    if spec.frequency_hz * spec.dt_s * _SAMPLES_A_PERIOD > 1.0:
        raise WrongUse(
            f"smac: frequency_hz = {spec.frequency_hz} leaves fewer than {_SAMPLES_A_PERIOD} samples a period at "
            f"dt_s = {spec.dt_s}; at most {1.0 / (spec.dt_s * _SAMPLES_A_PERIOD):g} is accepted"
        )
    if spec.calibration_s < _CALIBRATION_S:
        raise WrongUse(
            f"smac: calibration_s = {spec.calibration_s} was given; the noise takes at least {_CALIBRATION_S:g} s to measure"
        )
