"""Beyond the paper: the methods over random faults, sides, times and winds, on straight legs and in turns."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ...evaluate.campaign import Campaign, load_campaign, load_rows, run_campaign, scores
from ...evaluate.score import Score
from ...evaluate.summary import Summary, confusion, summarise
from ..claims import Findings
from .flights import CORNER, HERE
from .limits import allowed

QUICK_SEEDS = 6
DEG = 180.0 / math.pi


def store(c: Campaign) -> Path:
    """Where the parts of the full campaign are kept between runs: AEROFDI_CACHE, else ~/.cache/aerofdi."""
    home = os.environ.get("AEROFDI_CACHE") or Path.home() / ".cache" / "aerofdi"
    return Path(home) / "campaigns" / c.name


def rows(quick: bool, progress: Callable[[str, float], None]) -> list[dict[str, Any]]:
    """Rows of the campaign: all its seeds over all cores, or the first few here and now."""
    if not quick:
        c = load_campaign(HERE / "monte_carlo.toml")
        return load_rows(run_campaign(c, store(c), progress))
    c = load_campaign(HERE / "monte_carlo.toml", QUICK_SEEDS)
    with tempfile.TemporaryDirectory() as folder:
        return load_rows(run_campaign(c, folder, progress, workers=1))


def _interval(x: tuple[float, float, float], unit: float = 1.0) -> list[float | None]:
    return [round(unit * v, 4) if math.isfinite(v) else None for v in x]


def _plain(label: str, where: str, s: Summary) -> dict[str, Any]:
    # Healthy flight is no leg and no turn: its numbers stand in the row of all.
    healthy = {
        "false_alarms": s.false_alarms,
        "false_alarms_per_hour": _interval(s.false_alarms_per_hour),
        "healthy_hours": round(s.healthy_hours, 2),
        "status_ok": round(s.ok_share, 4),
    }
    return {
        "method": label,
        "where": where,
        "faults": s.faults,
        "median_delay_s": _interval(s.delay_s),
        "missed": _interval(s.missed),
        "in_allowable_time": _interval(s.detected_in_time),
        "right_elevon_first": None if math.isnan(s.isolated.value) else _interval(s.isolated),
        "estimate_error_deg": None
        if math.isnan(s.estimate_error.value)
        else _interval(s.estimate_error, DEG),
    } | (healthy if where == "all" else dict.fromkeys(healthy))


def summaries(found: list[dict[str, Any]], quick: bool) -> list[dict[str, Any]]:
    """One row per method, over all faults and split into legs and turns."""
    limit = allowed(quick)
    bank = {(r["seed"], r["start_s"]): abs(r["bank"]) for r in found if r["kind"] == "fault"}
    trim = {(r["seed"], r["start_s"]): r["about_trim"] for r in found if r["kind"] == "fault"}
    out = []
    for label, flights in scores(found).items():
        for where, keep in (
            ("all", lambda b: True),
            ("legs", lambda b: b <= CORNER),
            ("turns", lambda b: b > CORNER),
        ):
            picked: list[Score] = []
            seconds: list[float] = []
            for row, s in flights:
                kept = tuple(d for d in s.detections if keep(bank[row["seed"], d.start_s]))
                picked.append(s._replace(detections=kept))
                seconds += [limit.at(trim[row["seed"], d.start_s]) for d in kept]
            out.append(_plain(label, where, summarise(picked, seconds)))
    return out


def quantiles(found: Iterable[dict[str, Any]], label: str) -> dict[str, Any]:
    """Deciles of the detection delay of one method, s; null where that share is not detected."""
    delays = sorted(r["delay_s"] for r in found if r["kind"] == "fault" and r["diagnoser"] == label)
    picks = {f"p{q}": delays[min(int(q / 100 * len(delays)), len(delays) - 1)] for q in (10, 50, 90, 95, 99)}
    return {"method": label} | {k: round(v, 3) if math.isfinite(v) else None for k, v in picks.items()}


def _covered(found: Iterable[dict[str, Any]], label: str) -> float | None:
    """Share of the estimated angles that lie within twice their standard deviation of the truth; null without one."""
    mine = [r for r in found if r["kind"] == "fault" and r["diagnoser"] == label]
    sure = [r for r in mine if math.isfinite(r["error"]) and math.isfinite(r["estimate_std"])]
    inside = [abs(r["error"]) <= 2.0 * r["estimate_std"] for r in sure]
    return round(sum(inside) / len(inside), 4) if inside else None


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Tables only: the paper claims nothing about these flights."""
    found = rows(quick, progress)
    by_method = scores(found)
    tables = {
        "monte_carlo": summaries(found, quick),
        "monte_carlo_delays": [quantiles(found, label) for label in by_method],
        "monte_carlo_angle_within_two_std": {label: _covered(found, label) for label in by_method},
        "monte_carlo_isolation": {
            label: confusion(d for _, s in flights for d in s.detections)
            for label, flights in by_method.items()
        },
    }
    return Findings({}, tables)
