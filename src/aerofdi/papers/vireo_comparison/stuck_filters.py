"""What section 3.2 overlooks: its synthesis does not bound the open loop, and a stuck elevon opens the loop.

`stuck_lpv` has the fault as an input of the synthesis. Every saved filter flies the same healthy and faulty flights
over the airspeed range; detection at the paper's 5 deg and at a threshold of 1.5 times its own largest healthy
residual.

Wf (20 deg below 3 rad/s for the aileron, 4 deg for the elevator) was chosen among twenty settings on flights at 13,
15.4 and 18 m/s with angles of -5, -2 and 3 deg and seed 1; the flights here have other airspeeds, angles, banks and
seeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ...core import Diagnoser
from ...design.stuck_study import stuck_study, summary
from .methods import PAIR, method_b
from .worst_case import KINDS

Progress = Callable[[str, float], None]
DEG = math.pi / 180.0
ALL = (*KINDS, "stuck_lpv")
PAPER_THRESHOLD_DEG = 5.0


def banks(threshold_deg: dict[str, float]) -> dict[str, Diagnoser]:
    """Method B with each saved design and its threshold, deg."""
    return {k: method_b(design=k, threshold=threshold_deg[k] * DEG, name=k) for k in ALL}


def compare(quick: bool, progress: Progress) -> list[dict[str, Any]]:
    """One row for each filter and threshold: share detected and isolated, false alarms, delay, error of the
    estimate.
    """
    speeds, angles = (
        ((14.5, 17.0), (-4.0, 2.5)) if quick else ((13.5, 15.0, 17.0, 19.0), (-6.0, -4.0, -1.5, 2.5))
    )
    seeds = (31,) if quick else (31, 32)
    paper = dict.fromkeys(ALL, PAPER_THRESHOLD_DEG)
    healthy = stuck_study(
        "vireo", banks(paper), speeds, (math.nan,), PAIR[1:], (0.0, 30.0, -30.0), seeds,
        progress=lambda text, share: progress(f"healthy, {text}", 0.3 * share),
    )  # fmt: skip
    own = {k: 1.5 * v["largest_healthy_deg"] for k, v in summary(healthy).items()}
    rows = []
    for n, (label, threshold) in enumerate((("paper", paper), ("own", own))):

        def say(text: str, share: float, done: int = n) -> None:
            progress(f"stuck, {text}", 0.3 + 0.35 * (done + share))

        flown = stuck_study("vireo", banks(threshold), speeds, angles, PAIR, (0.0, 25.0), (11,), progress=say)
        for k, s in summary(flown).items():
            plain = {key: v if math.isfinite(v) else None for key, v in s.items()}
            rows.append({"filter": k, "threshold": label, "threshold_deg": threshold[k], **plain})
    return rows
