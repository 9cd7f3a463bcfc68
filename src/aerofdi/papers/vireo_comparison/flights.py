"""The two flights and what the three methods say about them."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core import Array, Diagnoser, Flight, Series, Verdict, bind, run
from ...evaluate.score import Detection, Score, score
from ...evaluate.truth import faults_of, value_at
from ...scenarios import Scenario, load_scenario
from ...simulate import fly
from . import methods

HERE = Path(__file__).parent
NAMES = ("FLT32", "FLT33")
CORNER = math.radians(10.0)
"""Above this bank an injection counts as in a corner."""
METHODS: dict[str, Callable[..., Diagnoser]] = {
    "A": methods.method_a, "B": methods.method_b, "C": methods.method_c,
}  # fmt: skip
READINGS = ("trim", "neutral", "near")
"""What "-5 deg" may mean: about trim (-3.6 deg here); about neutral; about neutral, the aircraft trimmed at -5 deg."""
# Before, filters fill and nothing is judged. After a fault ends, method A's free-running model forgets with the spiral
# mode (8.4 s), so an alarm within half a minute of it is no verdict on healthy flight.
HOW = {"settle_s": 10.0, "clear_s": 30.0}


class Judged(NamedTuple):
    """One flight as one method sees it."""

    flight: Flight
    diagnoser: Diagnoser
    t_s: Array
    verdict: Verdict
    score: Score


class Point(NamedTuple):
    """One test point: paper's name and angle (deg), what the paper's methods took (s, NaN missed), ours."""

    flight: str
    name: str
    angle_deg: float
    paper: dict[str, float]
    corner: bool
    true_deg: float
    ours: dict[str, Detection]


def paper_table() -> list[dict[str, str]]:
    """Table 4 of the paper."""
    with (HERE / "table4.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def scenario(name: str, reading: str = "trim") -> Scenario:
    """FLT32 or FLT33 under one of READINGS."""
    if reading == "near":
        return load_scenario(HERE / f"{name.lower()}_near.toml")
    s = load_scenario(HERE / f"{name.lower()}.toml")
    return replace(s, faults=tuple(f._replace(about=reading) for f in s.faults))


def with_resets(flight: Flight) -> Flight:
    """The operator clears every diagnoser that latches when a test point ends (channel `event.reset`)."""
    t = flight.measured["p"].t_s
    pressed = np.zeros(len(t))
    for f in faults_of(flight):
        pressed[(t >= f.end_s) & (t < f.end_s + 0.5)] = 1.0
    return flight.with_measured(**{"event.reset": Series(t, pressed, "1")})


@cache
def flown(name: str, reading: str = "trim") -> Flight:
    """The flight, resets included."""
    return with_resets(fly(scenario(name, reading)))


def judge(flight: Flight, d: Diagnoser) -> Judged:
    """Run one method over a whole flight and score it."""
    sample = bind(flight, d.inputs, d.dt_s, who=d.name)
    verdict = run(d, sample)[1]
    return Judged(flight, d, sample.t_s, verdict, score(sample.t_s, verdict, d, faults_of(flight), **HOW))


@cache
def judged(name: str, label: str, reading: str = "trim") -> Judged:
    """One of METHODS over one of the flights; method B knows the elevator the aircraft is trimmed with."""
    flight = flown(name, reading)
    if label == "B" and reading == "near":
        shift = flight.meta["trim"]["elevon_left"] - flown(name).meta["trim"]["elevon_left"]
        return judge(flight, METHODS[label](trim_shift=shift))
    return judge(flight, METHODS[label]())


def points(reading: str = "trim") -> list[Point]:
    """The eleven test points in the order of Table 4."""
    ours = {n: {m: judged(n, m, reading).score.detections for m in METHODS} for n in NAMES}
    out = []
    for row in paper_table():
        name, i = row["flight"], int(row["point"][1:]) - 1
        detections = {m: ours[name][m][i] for m in METHODS}
        onset = detections["A"].start_s
        paper = {m: float(row[m]) if row[m] else math.nan for m in METHODS}
        bank = abs(value_at(flown(name, reading), "phi", onset))
        true = math.degrees(detections["A"].value)
        out.append(Point(name, row["point"], float(row["angle_deg"]), paper, bank > CORNER, true, detections))
    return out
