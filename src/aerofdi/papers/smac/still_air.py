"""The five failures in still air: claims of section 4 and Figures 7 to 10, and the printed numbers beside
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..claims import Findings, Ours
from .flights import Judged, flown, summary

SEEDS, QUICK_SEEDS = range(101, 111), range(101, 104)  # the design listens to 1 and 2
OTHERS = ("aileron_left", "aileron_right", "elevator_left", "elevator_right")


def worst(flights: list[Judged], field: str, targets: tuple[str, ...]) -> float:
    """The median over the flights of the worst delay in each."""
    found = [max(getattr(e, field) for e in j.episodes if e.target in targets) for j in flights]
    return float(np.quantile(found, 0.5, method="higher"))


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Claims from the design "ordered" (the paper's order of tests), tables of all three."""
    seeds = QUICK_SEEDS if quick else SEEDS
    flights: dict[str, list[Judged]] = {}
    for n, kind in enumerate(("ordered", "together", "printed")):
        flights[kind] = []
        for k, seed in enumerate(seeds):
            progress(f"still air, {kind}, seed {seed}", (n + k / len(seeds)) / 3.0)
            flights[kind].append(flown(kind, 0.0, seed))
    ours = flights["ordered"]
    angles = np.array([e.estimate - e.truth for j in ours for e in j.episodes])
    values = {
        "detected": worst(ours, "detected_s", OTHERS),
        "detected_rudder": worst(ours, "detected_s", ("rudder",)),
        "isolated": worst(ours, "isolated_s", OTHERS),
        "isolated_rudder": worst(ours, "isolated_s", ("rudder",)),
        "removed": worst(ours, "recovered_s", OTHERS),
        "removed_rudder": worst(ours, "recovered_s", ("rudder",)),
        "right_surface": float(
            np.mean([not e.wrong and math.isfinite(e.isolated_s) for j in ours for e in j.episodes])
        ),
        "false_declared": float(sum(len(j.false_labels) for j in ours)),
        "false_alarms": float(sum(j.false_alarms for j in ours)),
        "lambda_dead": _lambda_of_a_stuck_surface(ours[0]),
    }
    tables: dict[str, Any] = {f"still_air_{kind}": summary(found) for kind, found in flights.items()}
    tables["still_air"] = {
        "flights": len(seeds),
        "healthy_hours": sum(j.healthy_s for j in ours) / 3600.0,
        "false_alarms": {k: sum(j.false_alarms for j in v) for k, v in flights.items()},
        "false_labels": {k: sum(len(j.false_labels) for j in v) for k, v in flights.items()},
        "mean_angle_error_deg": float(np.degrees(np.nanmean(np.abs(angles)))),
    }
    return Findings({k: Ours(v) for k, v in values.items()}, tables)


def _lambda_of_a_stuck_surface(j: Judged) -> float:
    """Median Lambda of the stuck left aileron while it is tracked, rad; (20) says 2A/pi."""
    first = j.episodes[0]
    start = j.flight.meta["faults"][0]["start_s"]
    at = (j.t_s > start + first.isolated_s + 3.0) & (j.t_s < j.flight.meta["faults"][0]["end_s"])
    return float(np.nanmedian(j.verdict.score[at, 1]))
