"""The comparison the paper argues from: banks of Kalman filters on the same flights cannot tell the two
ailerons apart.

lateral    three filters (healthy, left aileron stuck, right aileron stuck) of the lateral model
extended   six filters of the whole linear model: healthy and one a surface, its stuck position as a state; once with
           the model error SMAC has too (torques reduced by 25 %), once with the exact model

They use the textbook posterior and see only p, q, r and phi, with the noise these really have, and as input what
the actuators get: command plus excitation. Each judges a flight without SMAC, as a passive method would
have it, and SMAC's own flight, whose excitation helps the banks too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ...aircraft import load_aircraft
from ...core import Array, Design, Diagnoser, Flight, Verdict, bind, run
from ...design.mmae import Tuning, design_mmae
from ...design.mmae_aircraft import servo_of
from ...design.smac import commanded_surfaces
from ...diagnosers.mmae import TEXTBOOK, from_design
from ...dynamics.linearise import linearise
from ...dynamics.trim import trim
from ...simulate import fly
from ..claims import Findings, Ours
from .flights import flown, labels, scenario
from .methods import AIRCRAFT

DT_S = 0.02
AILERONS = ("aileron_left", "aileron_right")
WHOLE = ("u", "w", "q", "theta", "v", "p", "r", "phi")
LATERAL = ("v", "p", "r", "phi")
# Process noise a sample: small, as the model is the truth but for gusts and servo limits.
STATE_STD = {"u": 0.01, "w": 0.01, "v": 0.01, "p": 0.01, "q": 0.01, "r": 0.01, "phi": 1e-4, "theta": 1e-4}
NOISE = {"p": 0.08, "q": 0.08, "r": 0.08, "phi": math.radians(0.1)}
SEEDS, QUICK_SEEDS = range(101, 111), range(101, 102)
LIGHT = 1.0  # m/s


@cache
def bank(kind: str) -> Design:
    """One of the banks for the aircraft of Table A1 at 30 m/s."""
    aircraft = load_aircraft(AIRCRAFT)
    condition = trim(aircraft)
    surfaces = commanded_surfaces(aircraft)
    states = LATERAL if kind == "lateral" else WHOLE
    suspects = AILERONS if kind == "lateral" else surfaces
    model = linearise(aircraft, condition, states=states, inputs=surfaces)
    error = np.array([0.75 if s in "pqr" and kind != "exact" else 1.0 for s in states])[:, None]
    servos = np.array([servo_of(aircraft.surface(s), DT_S) for s in surfaces])
    seen = {name: std for name, std in NOISE.items() if name in states}
    tuning = Tuning(
        state_std={s: STATE_STD[s] for s in states}, measured=seen, weight=dict.fromkeys(seen, 1.0), rule=TEXTBOOK,
        prior=0.95, settle_s=2.0, stuck_std=1e-3,
    )  # fmt: skip
    at_trim = [float(condition.surfaces[aircraft.surface_index(s)]) for s in surfaces]
    return design_mmae(
        error * model.A,
        error * model.B,
        states,
        surfaces,
        suspects,
        servos,
        DT_S,
        tuning,
        trim=at_trim,
        group="surface",
    )


def diagnoser(kind: str) -> Diagnoser:
    return from_design(bank(kind), f"mmae {kind}")


def with_sums(flight: Flight) -> Flight:
    """The flight as the actuators have it: command plus what was added."""
    out = {}
    for name, series in flight.measured.items():
        added = flight.measured.get(name.replace("command.", "excitation."))
        if name.startswith("command.") and added is not None:
            n = min(len(series.value), len(added.value))
            out[name] = series._replace(t_s=series.t_s[:n], value=series.value[:n] + added.value[:n])
    return flight.with_measured(**out)


def watch(kind: str, flight: Flight) -> tuple[Array, Verdict, tuple[str, ...]]:
    """Times, verdicts and names of the hypotheses of a bank on a flight."""
    d = diagnoser(kind)
    sample = bind(with_sums(flight), d.inputs, d.dt_s, who=d.name)
    return sample.t_s, run(d, sample)[1], tuple(h.fault for h in d.hypotheses)


def named(
    t_s: Array, on: Array, names: tuple[str, ...], flight: Flight, after_s: float = 5.0
) -> list[dict[str, Any]]:
    """For each aileron failure: the share of its time (from 5 s on) each surface is named, and the twin's."""
    out = []
    for f in flight.meta["faults"]:
        if f["target"] in AILERONS:
            at = (t_s >= f["start_s"] + after_s) & (t_s < f["end_s"])
            twin = AILERONS[1 - AILERONS.index(f["target"])]
            out.append(
                {
                    "fault": f["target"],
                    "right_share": float(np.mean(on[at, names.index(f["target"])])),
                    "twin_share": float(np.mean(on[at, names.index(twin)])),
                }
            )
    return out


def told_apart(rows: list[dict[str, Any]]) -> float:
    """Share of aileron failures named right more than nine tenths of their time and never mistaken for the
    twin.
    """
    return float(np.mean([r["right_share"] > 0.9 and r["twin_share"] == 0.0 for r in rows]))


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Aileron failures by the banks and by SMAC, in still air and in light gusts, on flights of the same
    seeds.
    """
    seeds = QUICK_SEEDS if quick else SEEDS
    rows: dict[str, list[dict[str, Any]]] = {}
    for k, seed in enumerate(seeds):
        progress(f"banks of filters, seed {seed}", k / len(seeds))
        for air, gusts, smac in (("still air", 0.0, "ordered"), (f"gusts {LIGHT} m/s", LIGHT, "together")):
            excited = flown(smac, gusts, seed)
            on = labels(excited.verdict)
            surfaces = tuple(
                c.removeprefix("excitation.") for c in excited.flight.measured if "excitation." in c
            )
            rows.setdefault(f"smac, {air}", []).extend(named(excited.t_s, on, surfaces, excited.flight))
            for name, flight in (
                ("", fly(scenario(gusts), seed=seed)),
                (", excited by smac", excited.flight),
            ):
                for kind in ("lateral", "extended", "exact"):
                    t_s, verdict, names = watch(kind, flight)
                    rows.setdefault(f"{kind}, {air}{name}", []).extend(
                        named(t_s, verdict.active, names, flight)
                    )
    table = {
        kind: {
            "aileron_faults": len(found),
            "told_apart": told_apart(found),
            "right_share": float(np.mean([r["right_share"] for r in found])),
            "twin_share": float(np.mean([r["twin_share"] for r in found])),
        }
        for kind, found in rows.items()
    }
    ours = {
        "bank_cannot": Ours(float(table["lateral, still air"]["told_apart"])),
        "extended_bank_cannot": Ours(float(table["extended, still air"]["told_apart"])),
        "extended_bank_cannot_in_gusts": Ours(float(table[f"extended, gusts {LIGHT} m/s"]["told_apart"])),
        "smac_can": Ours(float(table["smac, still air"]["told_apart"])),
    }
    return Findings(ours, {"banks": dict(sorted(table.items()))})
