"""Many scores in one row: the numbers people compare diagnosers by, each with its interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from .metrics import Interval, bootstrap, clopper_pearson, garwood, median_interval
from .score import NONE, Detection, Score


class Summary(NamedTuple):
    """One diagnoser over many flights.

    faults, flights: counts. delay_s: median with its exact order-statistic interval, a missed fault counting
    as infinitely late. missed, isolated, detected_in_time: probabilities (Clopper-Pearson); isolated is the
    share of detected faults whose first named hypothesis is right (NaN where none was ever named: a method that
    only detects), detected_in_time the share within the
    allowable time (NaN where none was given). false_alarms_per_hour: Garwood. healthy_hours: judged healthy
    time. estimate_error: median |error| in the unit of the estimate (bootstrap). ok_share: mean share of
    Status OK.
    """

    flights: int
    faults: int
    delay_s: Interval
    missed: Interval
    isolated: Interval
    detected_in_time: Interval
    false_alarms: int
    false_alarms_per_hour: Interval
    healthy_hours: float
    estimate_error: Interval
    ok_share: float


def confusion(detections: Iterable[Detection]) -> dict[str, dict[str, int]]:
    """True "surface/mode" -> first named hypothesis -> count; "missed" where no alarm, "none" where none was
    named.
    """
    table: dict[str, Counter[str]] = {}
    for d in detections:
        row = table.setdefault(f"{d.fault}/{d.mode}", Counter())
        row["missed" if d.missed else d.isolated or NONE] += 1
    return {true: dict(sorted(row.items())) for true, row in sorted(table.items())}


def summarise(
    scores: Iterable[Score], allowed_s: Iterable[float] | None = None, confidence: float = 0.95
) -> Summary:
    """Pool the scores of one diagnoser. allowed_s: allowable detection time of each fault, in the order of
    the scores.

    Faults of one flight are pooled as if independent; intervals are then a little too narrow where they are
    not.
    """
    scores = list(scores)
    found = [d for s in scores for d in s.detections]
    delay = np.array([d.delay_s for d in found])
    hit = [d for d in found if not d.missed]
    hours = sum(s.healthy_s for s in scores) / 3600.0
    alarms = sum(s.false_alarms for s in scores)
    named = [d for d in hit if d.isolated not in ("", NONE)]
    in_time = Interval(float("nan"), float("nan"), float("nan"))
    if allowed_s is not None and found:
        in_time = clopper_pearson(
            int(np.sum(delay <= np.asarray(list(allowed_s), float))), len(found), confidence
        )
    return Summary(
        flights=len(scores),
        faults=len(found),
        delay_s=median_interval(delay, confidence),
        missed=clopper_pearson(len(found) - len(hit), len(found), confidence),
        isolated=clopper_pearson(sum(d.correct for d in hit), len(hit) if named else 0, confidence),
        detected_in_time=in_time,
        false_alarms=alarms,
        false_alarms_per_hour=garwood(alarms, hours, confidence),
        healthy_hours=hours,
        estimate_error=bootstrap(np.array([abs(d.error) for d in hit]), confidence=confidence),
        ok_share=float(np.mean([s.ok_share for s in scores])) if scores else float("nan"),
    )


def table(rows: Mapping[str, Summary], unit: float = 180.0 / np.pi) -> str:
    """A Markdown table, one row a diagnoser; estimate errors times `unit` (default: rad shown in deg)."""
    head = (
        "| | faults | median delay (s) | missed | right surface | false alarms / h | healthy hours | "
        "median estimate error (deg) | status OK |"
    )
    lines = [head, "|" + "---|" * 9]
    for label, s in rows.items():
        error = Interval(*(unit * x for x in s.estimate_error))
        lines.append(
            f"| {label} | {s.faults} | {s.delay_s} | {s.missed} | {s.isolated} | {s.false_alarms_per_hour} | "
            f"{s.healthy_hours:.1f} | {error} | {s.ok_share:.4f} |"
        )
    return "\n".join(lines)
