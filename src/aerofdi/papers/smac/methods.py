"""The SMAC designs compared here, and their diagnosers.

printed    every number the paper prints, the rest as in `design.smac.PAPER`
ordered    the paper's order (one surface at a time, 1 Hz, 2 deg); thresholds from (12), evaluator with both witnesses
fixed      the same with thresholds that do not follow the wind
together   the twins of a group at once at 1 and 2 Hz
sweeping   the same, and a sweep over all surfaces every 12 s without suspicion (finds lost effectiveness)

All have the paper's model error: torques of the filter reduced by 25 %.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from ...aircraft import hash as aircraft_hash
from ...aircraft import load_aircraft
from ...core import Design, Diagnoser
from ...design.io import load_design, save_design
from ...design.smac import PAPER, Spec, design_smac
from ...diagnosers.smac import from_design

AIRCRAFT = "ducard"
LONG = {"seconds": 400.0}  # of excitation: the five faults alone last 150 s
SPECS: dict[str, Spec | dict[str, Any]] = {
    "printed": PAPER,
    "ordered": {"torque_scale": 0.75, "together": False, **LONG},
    "fixed": {"torque_scale": 0.75, "together": False, "follow_wind": False, **LONG},
    "together": {"torque_scale": 0.75, "odds": 10.0, **LONG},
    "sweeping": {"torque_scale": 0.75, "odds": 10.0, "sweep_every_s": 12.0, **LONG},
}
DESIGNS = Path(__file__).parent / "designs"


@cache
def design(kind: str) -> Design:
    """The stored design where the aircraft file is still the one it was made for, else a fresh one."""
    aircraft, path = load_aircraft(AIRCRAFT), DESIGNS / f"{kind}.toml"
    if path.exists():
        stored = load_design(path)
        if stored.aircraft_hash == aircraft_hash(aircraft):
            return stored
    return design_smac(aircraft, SPECS[kind])


def diagnoser(kind: str) -> Diagnoser:
    """The diagnoser of one of SPECS."""
    return from_design(design(kind), f"smac {kind}")


def main() -> None:
    """Make and store every design: `python -m aerofdi.papers.smac.methods`."""
    for kind, spec in SPECS.items():
        save_design(design_smac(load_aircraft(AIRCRAFT), spec), DESIGNS / f"{kind}.toml")


if __name__ == "__main__":
    main()
