"""`python -m aerofdi.papers.vireo_comparison.place`: put the injections where the scenario files say they are.

Each fault of flt32.toml, flt33.toml and their `_near` versions says "on a straight leg" or "in a corner" in the comment
above it. When the aircraft, its autopilot or the track changes, the times of legs and corners change too; this flies
each flight fault after fault and rewrites `start`, `end` and `duration`. The length of each fault stays.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core import Array
from ...scenarios import load_scenario
from ...simulate import fly

HERE = Path(__file__).parent
FILES = ("flt32.toml", "flt33.toml", "flt32_near.toml", "flt33_near.toml")
# A leg: bank below 6 deg for 9 s ahead (the other legs are shorter) and below 10 deg for 1.5 s before. A corner: in the
# banked turn, above 30 deg for the last second. From one fault to the next: 45 s to settle.
LEG_AHEAD_S, LEG_BEFORE_S, CORNER_S, SETTLE_S, FIRST_S = 9.0, 1.5, 1.0, 45.0, 70.0


def next_time(t: Array, bank_deg: Array, after_s: float, corner: bool) -> float:
    """First instant after `after_s` on a leg or in a corner, rounded to 0.1 s."""
    dt = t[1] - t[0]
    for k in range(int(np.searchsorted(t, after_s)), len(t) - int(LEG_AHEAD_S / dt)):
        if corner:
            held = bank_deg[k - int(CORNER_S / dt) : k].min() > 30
            good = held and bank_deg[k - int(CORNER_S / dt) - 10] < 30
        else:
            level = bank_deg[k : k + int(LEG_AHEAD_S / dt)].max() < 6
            good = level and bank_deg[k - int(LEG_BEFORE_S / dt) : k].max() < 10
        if good:
            return round(float(t[k]), 1)
    raise RuntimeError(f"no {'corner' if corner else 'leg'} within the flight after {after_s} s")


def place(path: Path) -> list[float]:
    """Rewrite one scenario file; returns the onsets, s."""
    text = path.read_text(encoding="utf-8")
    corners = ["corner" in line for line in text.splitlines() if re.match(r"# T\d", line)]
    scenario = load_scenario(path)
    done: list = []
    last = FIRST_S - SETTLE_S
    for fault, corner in zip(scenario.faults, corners, strict=True):
        flight = fly(replace(scenario, faults=tuple(done), duration_s=last + SETTLE_S + 80.0))
        phi = flight.truth["phi"]
        start = next_time(phi.t_s, np.abs(np.degrees(phi.value)), last + SETTLE_S, corner)
        last = round(start + fault.end_s - fault.start_s, 1)
        done.append(fault._replace(start_s=start, end_s=last))
    for f in done:
        # The first line still as it was; what is rewritten is marked, so that the next pass finds the next one.
        text = re.sub(r'^start = ".* s"$', f'start= "{f.start_s:g} s"', text, count=1, flags=re.M)
        text = re.sub(r'^end = ".* s"$', f'end= "{f.end_s:g} s"', text, count=1, flags=re.M)
    text = text.replace("start= ", "start = ").replace("end= ", "end = ")
    text = re.sub(r'^duration = ".*"$', f'duration = "{10 * round((last + 40) / 10)} s"', text, flags=re.M)
    path.write_text(text, encoding="utf-8")
    return [f.start_s for f in done]


if __name__ == "__main__":
    for name in FILES:
        print(name, place(HERE / name))
