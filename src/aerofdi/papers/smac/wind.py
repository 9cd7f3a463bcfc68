"""The five failures in Dryden gusts: Figures 11 and 12, fixed thresholds beside those that follow the
wind.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from ...evaluate.metrics import Interval, clopper_pearson, garwood, median_interval
from ..claims import Findings, Ours
from .flights import GUSTS, Episode, Judged, flown, summary

SEEDS, QUICK_SEEDS = range(101, 111), range(101, 102)  # the design listens to 1 and 2
KINDS = ("printed", "fixed", "ordered", "together")


def rates(flights: Iterable[Judged]) -> dict[str, float | list[float] | int]:
    """Shares of failures and rates an hour with their 95 % intervals, median delays (inf: more than half
    never). Takes the flights one after the other: a hundred whole ones would fill the memory.
    """
    episodes: list[Episode] = []
    count, hours, alarms, labels, excited = 0, 0.0, 0, 0, 0.0
    for j in flights:
        episodes += j.episodes
        count, hours, excited = count + 1, hours + j.healthy_s / 3600.0, excited + j.excited
        alarms, labels = alarms + j.false_alarms, labels + len(j.false_labels)

    def share(count: int) -> Interval:
        return clopper_pearson(count, len(episodes))

    found = {
        "a_wrong_surface_was_declared": share(sum(bool(e.wrong) for e in episodes)),
        "only_the_faulty_group_was_declared": share(sum(e.group for e in episodes)),
        "isolated": share(sum(math.isfinite(e.isolated_s) for e in episodes)),
        "isolated_s_median": median_interval(np.array([e.isolated_s for e in episodes])),
        "recovered_s_median": median_interval(np.array([e.recovered_s for e in episodes])),
        "false_alarms_per_hour": garwood(alarms, hours),
        "false_labels_per_hour": garwood(labels, hours),
    }
    out: dict[str, float | list[float] | int] = {
        "flights": count, "faults": len(episodes), "healthy_hours": hours,
        "excited_share": excited / count,
    }  # fmt: skip
    for name, x in found.items():
        out |= {name: x.value, f"{name}_ci": [x.low, x.high]}
    return out


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


def _flights(kind: str, gusts: float, seeds: Iterable[int]) -> Iterator[Judged]:
    """Flown when asked for, and not kept."""
    for seed in seeds:
        print(f"\r{kind} at {gusts} m/s: seed {seed}  ", end="", file=sys.stderr, flush=True)
        yield flown.__wrapped__(kind, gusts, seed)


COLUMNS = {
    "a wrong surface, share of faults": "a_wrong_surface_was_declared",
    "only the faulty group": "only_the_faulty_group_was_declared",
    "isolated": "isolated",
    "isolated after s, median": "isolated_s_median",
    "recovery noticed after s, median": "recovered_s_median",
    "false alarms per hour": "false_alarms_per_hour",
}


def main() -> None:
    """[COUNT]: the table of README.md over COUNT (100) seeds, at two strengths of gusts."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    head = ["gusts m/s", "design", "faults", *COLUMNS, "under excitation"]
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for gusts in (1.0, GUSTS):
        for kind in KINDS[1:]:
            r = rates(_flights(kind, gusts, range(SEEDS[0], SEEDS[0] + count)))
            cells = [f"{r[n]:.3g} [{r[n + '_ci'][0]:.3g}, {r[n + '_ci'][1]:.3g}]" for n in COLUMNS.values()]  # type: ignore[index]
            print(
                f"| {gusts:g} | {kind} | {r['faults']} | {' | '.join(cells)} | {r['excited_share']:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
