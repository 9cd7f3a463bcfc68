"""Beyond the paper: 500 flights of one minute, each with its own wind, fault and size; `python -m
aerofdi.papers.smac.beyond`.

A flight draws (by counter-based random numbers of its seed) the gusts, 0 to 2.5 m/s in steps of 0.5, one of
the kinds below, surfaces, and sizes. The failure lasts from 15 to 22 s (drawn) to the end. The diagnoser is
"sweeping": twins at once at 1 and 2 Hz, thresholds that follow the wind, a sweep over all surfaces every 12
s.

stuck       0.5 to 10 deg about trim, either sign, logarithmic
floating    trails with the air: angle 0.5 to 1.5 of -alpha (rudder: -beta)
loss        20 to 100 % of the effectiveness about trim lost
pair        two surfaces stuck at once at 1 to 6 deg: twins or not
healthy     nothing
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...dynamics.faults import Fault
from ...evaluate.metrics import clopper_pearson
from ...parts.random import uniform4
from ...scenarios import Scenario
from ...simulate import fly_with
from .flights import judge, labels, scenario
from .methods import design, diagnoser

KINDS = ("stuck", "floating", "loss", "pair", "healthy")
GUSTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5)
FLIGHT_S, STREAM = 60.0, 77
FIRST_SEED = 20001  # those below were looked at while the method was made
Row = dict[str, Any]


def draw(seed: int) -> tuple[str, Scenario]:
    """The kind of fault and the scenario of this seed."""
    surfaces = design("sweeping").spec["surfaces"]
    a, b, c, d = uniform4(seed, 0, STREAM, 0)
    e, f, g, h = uniform4(seed, 0, STREAM, 1)
    kind, gusts = KINDS[int(a * len(KINDS))], GUSTS[int(b * len(GUSTS))]
    start, i = 15.0 + 7.0 * c, int(d * len(surfaces))
    sign = 1.0 if f < 0.5 else -1.0
    if kind == "stuck":
        faults = [_stuck(surfaces[i], start, sign * 0.5 * 20.0**e)]
    elif kind == "floating":
        rudder = surfaces[i] == "rudder"
        faults = [Fault(surfaces[i], "floating", start, value=-(0.5 + e), rudder=rudder)]
    elif kind == "loss":
        faults = [Fault(surfaces[i], "loss_of_effectiveness", start, value=0.2 + 0.8 * e, about="trim")]
    elif kind == "pair":
        j = (i + 1 + int(g * (len(surfaces) - 1))) % len(surfaces)
        other = 1.0 if h < 0.5 else -1.0
        faults = [
            _stuck(surfaces[i], start, sign * 6.0**e),
            _stuck(surfaces[j], start, other * 6.0 ** (1.0 - e)),
        ]
    else:
        faults = []
    return kind, replace(scenario(gusts), duration_s=FLIGHT_S, faults=tuple(faults))


def _stuck(surface: str, start: float, angle_deg: float) -> Fault:
    return Fault(surface, "stuck", start, value=math.radians(angle_deg), about="trim")


def fly_one(seed: int) -> list[Row]:
    """One row a failure (one with empty target for a healthy flight)."""
    kind, s = draw(seed)
    found = fly_with(s, [diagnoser("sweeping")], seed=seed)
    watched, flight = found.verdicts[0], found.flight
    flight.meta["faults"] = [{**f, "end_s": min(f["end_s"], FLIGHT_S)} for f in flight.meta["faults"]]
    j = judge(flight, watched.t_s, watched.verdict, "sweeping")
    sigma = s.wind.turbulence.sigma[0] if s.wind.turbulence and s.wind.turbulence.sigma else 0.0
    base = {"seed": seed, "kind": kind, "gusts": sigma, "diverged": int(bool(flight.meta["diverged"]))}
    base |= {"false_labels": len(j.false_labels), "wrong": sum(len(e.wrong) for e in j.episodes)}
    surfaces = list(design("sweeping").spec["surfaces"])
    out = []
    for e, f in zip(j.episodes, flight.meta["faults"], strict=True):
        lost = watched.verdict.score[:, 2 + 2 * surfaces.index(e.target)]
        at = labels(watched.verdict)[:, surfaces.index(e.target)] & np.isfinite(lost)
        size = f["value"] if kind in ("loss", "floating") else math.degrees(f["about_trim"])
        out.append(
            base | {
                "target": e.target, "size": size, "detected_s": e.detected_s, "isolated_s": e.isolated_s,
                "angle_error_deg": math.degrees(e.estimate - e.truth) if kind in ("stuck", "pair") else math.nan,
                "lost_share": float(np.median(lost[at][-100:])) if at.any() else math.nan,
            }
        )  # fmt: skip
    empty = {"target": "", "size": math.nan, "detected_s": math.nan, "isolated_s": math.nan}
    return out or [base | empty | {"angle_error_deg": math.nan, "lost_share": math.nan}]


def fly_all(seeds: Iterable[int], progress: Callable[[str, float], None]) -> list[Row]:
    """Every row of every seed, in order."""
    wanted, rows = list(seeds), []
    for k, seed in enumerate(wanted):
        progress(f"seed {seed}", k / len(wanted))
        rows += fly_one(seed)
    return rows


def _group(rows: Sequence[Row], title: str) -> Row:
    """One line of the table: how many failures were isolated, how fast, and how often a wrong surface was
    declared.
    """
    n = len({r["seed"] for r in rows})
    wrong = clopper_pearson(len({r["seed"] for r in rows if r["wrong"] or r["false_labels"]}), n)
    faults = [r for r in rows if r["target"]]
    isolated = clopper_pearson(sum(math.isfinite(r["isolated_s"]) for r in faults), len(faults))
    delays = np.array([r["isolated_s"] for r in faults])
    quantiles = [
        float(np.quantile(delays, q, method="higher")) if len(delays) else math.nan for q in (0.5, 0.9)
    ]
    angle = np.array([abs(r["angle_error_deg"]) for r in faults])
    share = np.array([r["lost_share"] - r["size"] for r in faults if r["kind"] == "loss"])
    return {
        "what": title, "flights": n, "faults": len(faults), "isolated": isolated, "median_s": quantiles[0],
        "ninety_s": quantiles[1], "wrong": wrong,
        "angle_error_deg": float(np.nanmedian(angle)) if np.isfinite(angle).any() else math.nan,
        "loss_error": float(np.nanmedian(np.abs(share))) if np.isfinite(share).any() else math.nan,
    }  # fmt: skip


def table(rows: Sequence[Row]) -> list[Row]:
    """By kind of fault, by size of a stuck surface or a loss, by wind."""
    out = [_group([r for r in rows if r["kind"] == k], k) for k in KINDS]
    for low, high in ((0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.01)):
        some = [r for r in rows if r["kind"] == "stuck" and low <= abs(r["size"]) < high]
        out.append(_group(some, f"stuck {low:g} to {high:.3g} deg"))
    for low, high in ((0.2, 0.5), (0.5, 0.8), (0.8, 1.01)):
        some = [r for r in rows if r["kind"] == "loss" and low <= r["size"] < high]
        out.append(_group(some, f"loss of {100 * low:.0f} to {100 * min(high, 1.0):.0f} %"))
    out += [_group([r for r in rows if r["gusts"] == g], f"gusts {g:g} m/s") for g in GUSTS]
    return [r for r in out if r["flights"]]


def markdown(lines: Sequence[Row]) -> str:
    """The table as it stands in README.md."""
    head = (
        "| | flights | faults | isolated | median s | 90 % s | wrong surface | angle error deg | loss error |"
    )
    text = [head, "|---|---|---|---|---|---|---|---|---|"]
    for r in lines:
        cells = [r["what"], str(r["flights"]), str(r["faults"]), str(r["isolated"]) if r["faults"] else ""]
        cells += [f"{r['median_s']:.1f}", f"{r['ninety_s']:.1f}", str(r["wrong"])]
        cells += [f"{r['angle_error_deg']:.2f}", f"{r['loss_error']:.2f}"]
        text.append("| " + " | ".join("" if c in ("nan",) else c for c in cells) + " |")
    return "\n".join(text)


def main() -> None:
    """[COUNT] [FILE.csv]: fly COUNT (500) seeds from FIRST_SEED on, write every row, print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    target = Path(sys.argv[2] if len(sys.argv) > 2 else "smac_beyond.csv")

    def say(text: str, share: float) -> None:
        print(f"\r{100 * share:5.1f} % {text}   ", end="", file=sys.stderr, flush=True)

    rows = fly_all(range(FIRST_SEED, FIRST_SEED + count), say)
    beside = target.with_name(f".{target.name}.part")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    beside.replace(target)
    print(f"\n{markdown(table(rows))}")


if __name__ == "__main__":
    main()
