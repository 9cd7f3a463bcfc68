"""The five failures in Dryden gusts: Figures 11 and 12, fixed thresholds beside those that follow the
wind.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

import numpy as np

from ...evaluate.metrics import clopper_pearson
from ..claims import Findings, Ours
from .flights import GUSTS, Judged, flown, summary

SEEDS, QUICK_SEEDS = range(1, 11), range(1, 2)
KINDS = ("printed", "fixed", "ordered", "together")


def rates(flights: Sequence[Judged]) -> dict[str, float | list[float] | int]:
    """Shares of failures with their 95 % intervals."""
    episodes = [e for j in flights for e in j.episodes]
    wrong = clopper_pearson(sum(bool(e.wrong) for e in episodes), len(episodes))
    isolated = clopper_pearson(sum(math.isfinite(e.isolated_s) for e in episodes), len(episodes))
    group = clopper_pearson(sum(e.group for e in episodes), len(episodes))
    delays = np.array([e.isolated_s for e in episodes])
    return {
        "flights": len(flights),
        "faults": len(episodes),
        "a_wrong_surface_was_declared": wrong.value,
        "a_wrong_surface_was_declared_ci": [wrong.low, wrong.high],
        "only_the_faulty_group_was_declared": group.value,
        "only_the_faulty_group_was_declared_ci": [group.low, group.high],
        "isolated": isolated.value,
        "isolated_ci": [isolated.low, isolated.high],
        "isolated_s_median": float(np.quantile(delays, 0.5, method="higher")),
        "false_labels": sum(len(j.false_labels) for j in flights),
        "suspicions_per_hour": 3600.0
        * sum(j.suspicions for j in flights)
        / sum(j.healthy_s for j in flights),
    }


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Claims from "fixed" (the paper's case) and "together" (with adaptation), tables of all."""
    seeds = QUICK_SEEDS if quick else SEEDS
    flights: dict[str, list[Judged]] = {}
    for n, kind in enumerate(KINDS):
        flights[kind] = []
        for k, seed in enumerate(seeds):
            progress(f"gusts, {kind}, seed {seed}", (n + k / len(seeds)) / len(KINDS))
            flights[kind].append(flown(kind, GUSTS, seed))
    found = {kind: rates(v) for kind, v in flights.items()}
    fixed, adapted = flights["fixed"], flights["together"]

    def per_flight(some: list[Judged], count: Callable[[Judged], int]) -> Ours:
        return Ours(float(np.mean([count(j) for j in some])))

    ours = {
        "wind_glitches": per_flight(fixed, lambda j: len(j.false_labels)),
        "wind_wrong": per_flight(fixed, lambda j: sum(bool(e.wrong) for e in j.episodes)),
        "wind_group": _share(found["fixed"], "only_the_faulty_group_was_declared"),
        "wind_group_adapted": _share(found["together"], "only_the_faulty_group_was_declared"),
        "wind_wrong_adapted": per_flight(adapted, lambda j: sum(bool(e.wrong) for e in j.episodes)),
        "wind_false_adapted": per_flight(adapted, lambda j: len(j.false_labels)),
    }
    return Findings(ours, {"wind": found, "wind_together": summary(adapted), "wind_fixed": summary(fixed)})


def _share(row: dict[str, float | list[float] | int], name: str) -> Ours:
    low, high = row[f"{name}_ci"]  # type: ignore[misc]
    return Ours(float(row[name]), (low, high))  # type: ignore[arg-type]


def main() -> None:
    """The table of README.md, at two strengths of gusts."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(
        "| gusts m/s | design | faults | a wrong surface declared | only the faulty group | isolated | median s |"
    )
    print("|---|---|---|---|---|---|---|")
    for gusts in (1.0, GUSTS):
        for kind in KINDS[1:]:
            r = rates([flown(kind, gusts, seed) for seed in range(1, count + 1)])
            names = ("a_wrong_surface_was_declared", "only_the_faulty_group_was_declared", "isolated")
            shares = [f"{r[n]:.3f} [{r[n + '_ci'][0]:.3f}, {r[n + '_ci'][1]:.3f}]" for n in names]  # type: ignore[index]
            print(
                f"| {gusts:g} | {kind} | {r['faults']} | {' | '.join(shares)} | {r['isolated_s_median']:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
