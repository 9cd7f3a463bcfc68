"""Figures 7 to 12 of the paper, drawn from our flights, into the folder `smac_figures` where one stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...core import MissingExtra
from ..claims import Findings
from .flights import GUSTS, Judged, flown, labels
from .methods import design

FOLDER = "smac_figures"
DEG = 180.0 / math.pi


def _axes(rows: int, title: str) -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra("figures need matplotlib; pip install 'aerofdi[design]'") from error
    figure = Figure(figsize=(7.0, 1.2 + 1.3 * rows), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
    axes[-1].set_xlabel("time (s)")
    return figure, axes


def _shade(axis: Any, j: Judged, target: str | None = None) -> None:
    for f in j.flight.meta["faults"]:
        if target in (None, f["target"]):
            axis.axvspan(f["start_s"], f["end_s"], color="0.9", lw=0)


def _detector(j: Judged) -> Any:
    figure, axes = _axes(1, "Figure 7: fault detector")
    gamma, threshold = j.verdict.residual[:, 3], j.verdict.threshold[:, 3]
    _shade(axes[0], j)
    axes[0].plot(j.t_s, gamma / threshold, color="0.6", lw=0.8, label="Gamma2 / Gamma2_thresh")
    axes[0].plot(j.t_s, j.verdict.detected, "k", lw=0.8, label="ThereIsaFault or a declared surface")
    axes[0].set_ylabel("Gamma2 / threshold")
    axes[0].legend(fontsize=7)
    return figure


def _per_surface(
    title: str, unit: str, value: Callable[[Judged, int, str], Any], limits: tuple[float, float] | None = None,
    line: float | None = None,
) -> Callable[[Judged], Any]:  # fmt: skip
    """A picture with one row a surface; its failure is shaded, `line` is a threshold."""

    def draw(j: Judged) -> Any:
        names = design("ordered").spec["surfaces"]
        figure, axes = _axes(len(names), title)
        for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
            _shade(axis, j, name)
            t, y = value(j, i, name)
            axis.plot(t, y, "k", lw=0.7)
            if line is not None:
                axis.axhline(line, color="0.4", lw=0.8, ls="--")
            axis.set_ylabel(f"{name.replace('_', chr(10))}\n({unit})", fontsize=7)
            if limits:
                axis.set_ylim(*limits)
                axis.set_yticks([0, 1], ["sound", "failed"], fontsize=7)
                axis.set_ylabel(name.replace("_", "\n"), fontsize=7)
        return figure

    return draw


def _command(j: Judged, i: int, name: str) -> Any:
    s = j.flight.measured[f"command.{name}"]
    return s.t_s, s.value * DEG


def _gusts(j: Judged) -> Any:
    names = ("wind_north", "wind_east", "wind_down")
    figure, axes = _axes(len(names), "Figure 11: gusts")
    for axis, name in zip(axes, names, strict=True):
        s = j.flight.truth[name]
        axis.plot(s.t_s, s.value, "k", lw=0.7)
        axis.set_ylabel(f"{name}\n(m/s)", fontsize=7)
    return figure


COMMANDS = _per_surface("Figure 8: commands of the autopilot", "deg", _command)
LAMBDAS = _per_surface(
    "Figure 9: Lambda of the surface under test", "rad", lambda j, i, _: (j.t_s, j.verdict.score[:, 1 + 2 * i]),
    line=0.01,
)  # fmt: skip


def _labels(j: Judged, title: str) -> Any:
    draw = _per_surface(
        title, "", lambda k, i, _: (k.t_s, labels(k.verdict)[:, i].astype(float)), (-0.15, 1.15)
    )
    return draw(j)


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Writes the figures; returns their paths."""
    del quick
    progress("drawing", 0.0)
    still, windy, adapted = flown("ordered"), flown("fixed", GUSTS), flown("together", GUSTS)
    drawn = {
        "figure07_detector": _detector(still),
        "figure08_commands": COMMANDS(still),
        "figure09_lambda": LAMBDAS(still),
        "figure10_declared": _labels(still, "Figure 10: declared surfaces, still air"),
        "figure11_gusts": _gusts(windy),
        "figure12_declared_in_wind": _labels(
            windy, "Figure 12: declared surfaces in gusts, fixed thresholds"
        ),
        "beyond_declared_in_wind_adapted": _labels(
            adapted,
            "Beyond the paper: the same gusts, thresholds that follow the wind, twins tested together",
        ),
    }
    folder = Path(FOLDER)
    folder.mkdir(exist_ok=True)
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=130)
    peak = float(
        np.max(np.hypot(windy.flight.truth["wind_north"].value, windy.flight.truth["wind_east"].value))
    )
    return Findings(
        {},
        {"figures": {"folder": FOLDER, "files": sorted(f"{n}.png" for n in drawn), "largest_gust_m_s": peak}},
    )
