"""The sequence of five failures in still air and in gusts, flown with SMAC on board, and what became of
each failure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core import Array, Flight, Verdict
from ...design.smac import dryden
from ...scenarios import Scenario, load_scenario
from ...simulate import fly_with
from .methods import design, diagnoser

SCENARIO = "ducard_sequence"
GUSTS = 2.5  # m/s: three standard deviations are the paper's 25 % of 30 m/s
GRACE_S = 2.0  # a label that rises this soon after its fault has ended began with it


class Episode(NamedTuple):
    """One failure: delays in s (inf: never), surfaces first declared during it without being faulty, angles
    in rad.

    recovered_s counts from the end of the failure, NaN where it was never declared. group: whether every
    label that rose during it belongs to the group of the faulty surface.
    """

    target: str
    detected_s: float
    isolated_s: float
    recovered_s: float
    wrong: tuple[str, ...]
    group: bool
    estimate: float
    truth: float


class Judged(NamedTuple):
    """A flight with SMAC. false_labels: surfaces declared while nothing was wrong. false_alarms: times
    ThereIsaFault rose while nothing was wrong and nothing declared. healthy_s: how long nothing was
    wrong. excited: share of the flight under excitation."""

    flight: Flight
    t_s: Array
    verdict: Verdict
    episodes: tuple[Episode, ...]
    false_labels: tuple[str, ...]
    false_alarms: int
    healthy_s: float
    excited: float


def scenario(gusts: float) -> Scenario:
    """The five failures, in Dryden gusts of this standard deviation (m/s)."""
    s = load_scenario(SCENARIO)
    return s if gusts == 0.0 else replace(s, wind=dryden(s.start.altitude, gusts))


def labels(verdict: Verdict) -> NDArray[np.bool_]:
    """(n, nu): which surfaces are declared, whatever the mode."""
    return np.asarray(verdict.active[:, 1::2] | verdict.active[:, 2::2])


def _first(t_s: Array, on: NDArray[np.bool_], since: float) -> float:
    at = np.flatnonzero(on)
    return float(t_s[at[0]] - since) if len(at) else math.inf


def judge(flight: Flight, t_s: Array, verdict: Verdict, kind: str) -> Judged:
    """What became of every failure in meta["faults"]."""
    names, groups = list(design(kind).spec["surfaces"]), list(design(kind).spec["groups"])
    on, faults = labels(verdict), flight.meta["faults"]
    rises = [
        (float(t_s[k + 1]), j)
        for j in range(len(names))
        for k in np.flatnonzero(np.diff(on[:, j].astype(int)) > 0)
    ]

    def guilty(t: float, j: int) -> bool:
        return any(f["target"] == names[j] and f["start_s"] <= t < f["end_s"] + GRACE_S for f in faults)

    false = [(t, j) for t, j in rises if not guilty(t, j)]
    episodes, healthy = [], np.ones(len(t_s), dtype=bool)
    for f in faults:
        start, end, i = f["start_s"], f["end_s"], names.index(f["target"])
        during = (t_s >= start - 1e-9) & (t_s < end)
        healthy &= ~((t_s >= start) & (t_s < end + 10.0))
        mine = [(t, j) for t, j in rises if start <= t < end]
        isolated = _first(t_s, during & on[:, i], start)
        angle = verdict.estimate[during, 1 + 2 * i]
        episodes.append(
            Episode(
                f["target"], _first(t_s, during & verdict.detected, start), isolated,
                _first(t_s, (t_s >= end) & ~on[:, i], end) if math.isfinite(isolated) else math.nan,
                tuple(names[j] for t, j in false if start <= t < end),
                all(groups[j] == groups[i] for _, j in mine),
                float(np.nanmedian(angle)) if np.isfinite(angle).any() else math.nan, float(f["value"]),
            )
        )  # fmt: skip
    quiet = healthy & ~on.any(axis=1)
    rose = int(np.sum(np.diff((verdict.detected & quiet).astype(int)) > 0))
    outside = tuple(names[j] for t, j in false if not any(f["start_s"] <= t < f["end_s"] for f in faults))
    return Judged(
        flight,
        t_s,
        verdict,
        tuple(episodes),
        outside,
        rose,
        float(np.sum(healthy)) * float(t_s[1] - t_s[0]),
        float(np.mean(verdict.excitation.any(axis=1))),
    )


@lru_cache(maxsize=8)
def flown(kind: str, gusts: float = 0.0, seed: int = 101) -> Judged:
    """One flight of the sequence with that design on board."""
    found = fly_with(scenario(gusts), [diagnoser(kind)], seed=seed)
    return judge(found.flight, found.verdicts[0].t_s, found.verdicts[0].verdict, kind)


def summary(flights: Iterable[Judged]) -> list[dict[str, float | str | int]]:
    """Per surface over several flights: median and worst delays, misses, wrong labels."""
    rows: dict[str, list[Episode]] = {}
    for flight in flights:
        for e in flight.episodes:
            rows.setdefault(e.target, []).append(e)
    out: list[dict[str, float | str | int]] = []
    for target, episodes in rows.items():
        row: dict[str, float | str | int] = {"surface": target, "faults": len(episodes)}
        for name in ("detected_s", "isolated_s", "recovered_s"):
            values = np.array([getattr(e, name) for e in episodes])
            values = values[~np.isnan(values)]
            row[f"{name}_median"] = (
                float(np.quantile(values, 0.5, method="higher")) if len(values) else math.nan
            )
            row[f"{name}_worst"] = float(values.max()) if len(values) else math.nan
        row["not_isolated"] = sum(not math.isfinite(e.isolated_s) for e in episodes)
        row["wrong_labels"] = sum(len(e.wrong) for e in episodes)
        error = np.array([e.estimate - e.truth for e in episodes])
        row["angle_error_deg"] = (
            float(np.degrees(np.nanmean(np.abs(error)))) if np.isfinite(error).any() else math.nan
        )
        out.append(row)
    return out
