"""What SMAC says: row k of the verdict from the state."""

from __future__ import annotations

import math

from ..core import Request, Status, Verdict
from ..parts.ops import inline, lean
from .smac_health import loss_std, remaining
from .smac_isolator import TEST, TRACK
from .smac_types import (
    ANGLE_STD,
    AXES,
    AXIS,
    DELTA,
    EXCITATION,
    EXCITED,
    FLAG,
    GAMMA2,
    HEARD,
    LABEL,
    LAMBDA,
    LEVEL,
    MODE,
    SCALE,
    TRIM,
    Detector,
    Params,
    State,
)

NONFINITE, STALE, OUTSIDE = int(Status.NONFINITE), int(Status.STALE_INPUT), int(Status.OUT_OF_ENVELOPE)
HOLD_LEVEL = int(Request.HOLD_LEVEL)


@inline
def gamma_threshold(d: Detector, s: State, scale: int) -> float:
    """Gamma2_thresh as the wind has it: AXES scales each axis itself, SUM takes the mean of their scales."""
    m = s.misc
    return d.threshold if d.rule == AXES else d.threshold * (m[scale] + m[scale + 1] + m[scale + 2]) / 3.0


@inline
def _alone(p: Params, s: State, i: int) -> bool:
    """Whether no other declared surface shares the axis: two stuck twins leave one residual for two
    unknowns.
    """
    for j in range(len(s.count)):
        if j != i and s.count[j, LABEL] > 0 and p.probe.place[j, AXIS] == p.probe.place[i, AXIS]:
            return False
    return True


@inline
def _say_surface(p: Params, s: State, i: int, ok: bool, out: Verdict, k: int) -> None:
    """The two hypotheses of surface i."""
    a, b = 1 + 2 * i, 2 + 2 * i
    active, score, estimate, std = out.active, out.score, out.estimate, out.estimate_std
    label = s.count[i, LABEL]
    heard = s.count[i, EXCITED] > 0 and s.count[i, HEARD] > 0
    lost = 1.0 - remaining(p.probe, s, i) if heard else math.nan
    active[k, a], active[k, b] = ok and label == 1, ok and label == 2
    score[k, a], score[k, b] = s.surface[i, LAMBDA] if heard else math.nan, lost
    angle = ok and label == 1 and _alone(p, s, i)
    estimate[k, a] = s.surface[i, TRIM] + s.surface[i, DELTA] if angle else math.nan
    # In gusts the residual the angle is read from moves as much more as its threshold does.
    gusty = s.misc[SCALE + p.probe.place[i, AXIS]]
    std[k, a] = p.probe.surface[i, ANGLE_STD] * gusty if angle else math.nan
    share = ok and label == 2 and heard
    estimate[k, b] = lost if share else math.nan
    std[k, b] = loss_std(p.probe, s, i) if share else math.nan


@inline
def _say_nothing(i: int, out: Verdict, k: int) -> None:
    """The two hypotheses of a surface that is neither declared nor excited."""
    active, score, estimate, std = out.active, out.score, out.estimate, out.estimate_std
    for j in range(1 + 2 * i, 3 + 2 * i):
        active[k, j] = False
        score[k, j], estimate[k, j], std[k, j] = math.nan, math.nan, math.nan


@lean
def say(p: Params, s: State, status: int, out: Verdict, k: int) -> None:
    """Row k of the verdict."""
    judging = status in (0, OUTSIDE)
    count, excitation = s.count, out.excitation
    fault = s.clock[FLAG] > 0 and judging
    for i in range(len(count)):
        excitation[k, i] = s.surface[i, EXCITATION]
        if count[i, LABEL] == 0 and count[i, EXCITED] == 0:
            _say_nothing(i, out, k)
        else:
            _say_surface(p, s, i, judging, out, k)
            fault = fault or (judging and count[i, LABEL] > 0)
    out.detected[k] = fault
    out.active[k, 0] = status == 0 and not fault
    out.score[k, 0], out.estimate[k, 0], out.estimate_std[k, 0] = math.nan, math.nan, math.nan
    bad = status in (NONFINITE, STALE)
    residual, threshold = out.residual, out.threshold
    for i in range(3):
        residual[k, i] = math.nan if bad else s.axes[i, LEVEL]
        threshold[k, i] = p.detector.axis[i] * s.misc[SCALE + i]
    residual[k, 3] = math.nan if bad else s.misc[GAMMA2]
    threshold[k, 3] = gamma_threshold(p.detector, s, SCALE)
    busy = s.clock[MODE] in (TEST, TRACK)
    out.request[k] = HOLD_LEVEL if judging and busy else 0
    out.status[k] = status
