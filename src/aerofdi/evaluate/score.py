"""One flight, one diagnoser: what was found, when, which, how large, and what was cried wolf.

Times: a fault is active for start_s <= t < end_s. Only samples with Status OK count as judging.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Diagnoser, Hypothesis, Status, Verdict, WrongUse

Mask = NDArray[np.bool_]
NONE = "none"


class Fault(NamedTuple):
    """What was really wrong: a surface, a fault mode, from when to when (s), and its true size in SI (NaN: no
    size).
    """

    fault: str
    mode: str
    start_s: float
    end_s: float = math.inf
    value: float = math.nan


class Detection(NamedTuple):
    """One fault and what the diagnoser made of it.

    delay_s: from the onset to the first alarm that starts during the fault; inf where there is none.
    isolation_s: the same to the first named hypothesis. isolated: that hypothesis as "surface/mode", "none"
    where none was named. correct: it names the true surface. others: named hypotheses during the fault other
    than the true surface. estimate, estimate_std: of the hypothesis of the true surface, medians over the
    last `estimate_s` of the fault; error = estimate - true value. alarmed_before: an alarm was already on at
    the onset (a false one).
    """

    fault: str
    mode: str
    start_s: float
    value: float
    delay_s: float
    isolation_s: float
    isolated: str
    correct: bool
    others: tuple[str, ...]
    estimate: float
    estimate_std: float
    error: float
    alarmed_before: bool

    @property
    def missed(self) -> bool:
        return not math.isfinite(self.delay_s)


class Score(NamedTuple):
    """A flight: its detections, the false alarms (start times, s), the healthy time judged (s), share of
    Status OK.
    """

    detections: tuple[Detection, ...]
    false_alarms_s: tuple[float, ...]
    healthy_s: float
    ok_share: float

    @property
    def false_alarms(self) -> int:
        return len(self.false_alarms_s)


def rising_edges(on: Mask, t_s: Array, merge_s: float = 0.0) -> Array:
    """Times where `on` turns true (index 0 counts); an edge within merge_s of the last `on` sample is no new
    one.

    >>> rising_edges(np.array([False, True, False, True]), np.arange(4.0)).tolist()
    [1.0, 3.0]
    """
    at = np.flatnonzero(on)
    if not len(at):
        return np.empty(0)
    new = np.concatenate(([True], (np.diff(at) > 1) & (t_s[at[1:]] - t_s[at[:-1]] > merge_s)))
    return np.asarray(t_s[at[new]], float)


def label(h: Hypothesis) -> str:
    """How tables name a hypothesis: "elevon_right/stuck"."""
    return f"{h.fault}/{h.mode}"


def _names(hypotheses: Sequence[Hypothesis], fault: Fault) -> list[int]:
    """Indices of the hypotheses that name the surface of the fault (itself, or a group that holds it)."""
    return [i for i, h in enumerate(hypotheses) if i > 0 and fault.fault in (h.fault, h.group)]


def _during(t_s: Array, fault: Fault) -> Mask:
    return (t_s >= fault.start_s) & (t_s < fault.end_s)


def _isolation(t_s: Array, v: Verdict, hypotheses: Sequence[Hypothesis], fault: Fault, judged: Mask) -> tuple:
    """(delay to the first named hypothesis, its label, whether it is right, labels of wrong ones)."""
    right = _names(hypotheses, fault)
    first: list[tuple[float, str, bool]] = []
    others = []
    for i in range(1, len(hypotheses)):
        named = np.flatnonzero(judged & v.active[:, i])
        if len(named):
            first.append((float(t_s[named[0]]) - fault.start_s, label(hypotheses[i]), i in right))
            if i not in right:
                others.append(label(hypotheses[i]))
    if not first:
        return math.inf, NONE, False, ()
    # Two named at the same sample: a wrong one must not hide behind a right one.
    delay, name, correct = min(first, key=lambda f: (f[0], f[2]))
    return delay, name, correct, tuple(others)


def _estimate(
    t_s: Array, v: Verdict, hypotheses: Sequence[Hypothesis], fault: Fault, judged: Mask, tail_s: float
):
    right = [i for i in _names(hypotheses, fault) if hypotheses[i].mode == fault.mode]
    if not right or not judged.any():
        return math.nan, math.nan
    last = judged & (t_s >= t_s[np.flatnonzero(judged)[-1]] - tail_s)
    value, std = v.estimate[last, right[0]], v.estimate_std[last, right[0]]
    return tuple(
        float(np.median(x[np.isfinite(x)])) if np.isfinite(x).any() else math.nan for x in (value, std)
    )


def _detection(
    t_s: Array, v: Verdict, hypotheses: Sequence[Hypothesis], fault: Fault, ok: Mask, tail_s: float
):
    during = _during(t_s, fault)
    judged = ok & during
    before = np.flatnonzero(ok & (t_s < fault.start_s))
    already = bool(len(before) and v.detected[before[-1]] and fault.start_s - t_s[before[-1]] < 1.0)
    fresh = judged & v.detected
    if already:
        # The alarm that was on at the onset knew nothing of this fault: only one raised anew counts.
        quiet = np.flatnonzero(judged & ~v.detected)
        fresh &= t_s > t_s[quiet[0]] if len(quiet) else False
    hit = np.flatnonzero(fresh)
    delay = float(t_s[hit[0]]) - fault.start_s if len(hit) else math.inf
    named = judged & fresh
    isolation_s, isolated, correct, others = _isolation(t_s, v, hypotheses, fault, named)
    estimate, std = _estimate(t_s, v, hypotheses, fault, judged, tail_s)
    return Detection(
        fault.fault, fault.mode, fault.start_s, fault.value, delay, isolation_s, isolated, correct, others,
        estimate, std, estimate - fault.value, already,
    )  # fmt: skip


def _inherited(healthy: Mask, excused: Mask, detected: Mask) -> Mask:
    """Samples of an alarm that goes on from the time after a fault (`excused`) into a healthy stretch."""
    out = np.zeros(len(healthy), bool)
    starts = np.flatnonzero(healthy & ~np.concatenate(([False], healthy[:-1])))
    for k in starts:
        if k > 0 and excused[k - 1] and detected[k - 1] and detected[k]:
            quiet = np.flatnonzero(~detected[k:])
            out[k : k + (quiet[0] if len(quiet) else len(out))] = True
    return out


def score(
    t_s: Array,
    verdict: Verdict,
    hypotheses: Sequence[Hypothesis] | Diagnoser,
    faults: Iterable[Fault] = (),
    *,
    settle_s: float = 0.0,
    clear_s: float = 10.0,
    merge_s: float = 1.0,
    estimate_s: float = 2.0,
) -> Score:
    """Judge a run against the truth.

    t_s (n,): instants of the run. verdict: with a leading time axis (n, ...). hypotheses: of the diagnoser
    (or the Diagnoser itself). faults: what was really wrong, in any order. settle_s: time after the start
    that is not judged. clear_s: after a fault ends, alarms are neither right nor wrong for this long.
    merge_s: alarms less than this apart are one false alarm. estimate_s: the tail of each fault over which
    estimates are taken.

    Guarantees: an alarm that was on before the onset earns no detection (it is a false alarm); samples whose
    Status is not OK neither detect nor count as healthy time. Not modelled: partial credit for a wrong mode
    of the right surface (`correct` is about the surface; read `isolated` for the mode).
    """
    t_s = np.asarray(t_s, float)
    table = hypotheses.hypotheses if isinstance(hypotheses, Diagnoser) else tuple(hypotheses)
    if len(t_s) != len(verdict.detected) or verdict.active.shape[1:] != (len(table),):
        raise WrongUse(
            f"{len(t_s)} instants and {len(table)} hypotheses were given, but the verdict has "
            f"{len(verdict.detected)} samples of {verdict.active.shape[1:]} hypotheses; pass the run's t_s"
        )
    faults = sorted(faults, key=lambda f: f.start_s)
    settled = t_s >= (t_s[0] + settle_s if len(t_s) else 0.0)
    ok = (verdict.status == Status.OK) & settled
    excused = np.zeros(len(t_s), bool)
    for f in faults:
        excused |= (t_s >= f.start_s) & (t_s < f.end_s + clear_s)
    healthy = ok & ~excused
    healthy &= ~_inherited(healthy, excused, verdict.detected)
    dt = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    alarms = rising_edges(healthy & verdict.detected, t_s, merge_s)
    share = float(np.mean(ok[settled])) if settled.any() else math.nan
    found = tuple(_detection(t_s, verdict, table, f, ok, estimate_s) for f in faults)
    return Score(found, tuple(float(t) for t in alarms), float(np.sum(healthy)) * dt, share)
