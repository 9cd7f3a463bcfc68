"""Which diagnosers can run on a record, and why the others cannot: what `aerofdi info FLIGHT` adds to its list."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.bind import fresh
from ..core.types import Flight
from ..identify.data import RATES, command_channels
from ..records import flown
from .diagnose import DIAGNOSERS
from .spans import split

SHORTEST_TRAINING_S = 10.0
DESIGNED = {
    "lpv_observer": "aerofdi design lpv_observer --aircraft A",
    "mmae": "design.mmae.design_mmae",
    "smac": "aerofdi design smac --aircraft A",
}


def capability(flight: Flight) -> list[dict[str, Any]]:
    """For every diagnoser {"diagnoser", "runs", "why"}; why names what it reads, or what is missing.

    Diagnosers of flight records learn from healthy flight; those of a design need a published aircraft. A diagnoser
    that can run may still find that nothing moved enough: that is known only after learning.
    """
    missing = _missing(flight)
    reads = ", ".join([*(r for r in RATES if r in flight.measured), *command_channels(flight)])
    out = [
        {
            "diagnoser": name,
            "runs": not missing,
            "why": "; ".join(missing) or f"learns from and judges {reads}",
        }
        for name in DIAGNOSERS
    ]
    out += [
        {
            "diagnoser": name,
            "runs": False,
            "why": f"needs a design of this very aircraft ({how}) and rides in simulated flight",
        }
        for name, how in DESIGNED.items()
    ]
    return out


def _missing(flight: Flight) -> list[str]:
    """What stands in the way of learning from this flight and judging it, in words."""
    out = []
    if not any(r in flight.measured and len(fresh(flight.measured[r]).t_s) > 1 for r in RATES):
        out.append("no angular rate (p, q, r) is measured")
    commands = command_channels(flight)
    if not commands:
        hidden = [n for n in flight.output if n.startswith("command.")]
        why = (
            " (those after the injection of faults are logged, which no diagnoser may read)" if hidden else ""
        )
        out.append(f"no surface command (command.<surface>) is logged{why}")
    elif not any(np.ptp(v) > 0 for v in (fresh(flight.measured[c]).value for c in commands) if len(v)):
        out.append("no surface command ever moves")
    if out:
        return out
    spans, _ = flown(flight)
    trained, _ = split(spans)
    seconds = sum(b - a for a, b in trained)
    if seconds < SHORTEST_TRAINING_S:
        flown_s = sum(b - a for a, b in spans)
        out.append(
            f"only {flown_s:.0f} s are flown under autopilot with moving commands, and learning takes 40 % of it, "
            f"at least {SHORTEST_TRAINING_S:.0f} s: give --healthy T0:T1, --healthy-flight F or --aircraft A"
        )
    return out
