"""Figures 16 to 23 of the paper, drawn from our flights, into the folder `vireo_comparison_figures` where one
stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core import MissingExtra
from ..claims import Findings
from .flights import METHODS, NAMES, Judged, judged
from .table4 import sweep

DEG = 180.0 / math.pi
BEFORE_S, AFTER_S = 10.0, 15.0
FOLDER = "vireo_comparison_figures"


def _axes(rows: int, columns: int, title: str, share: bool = False) -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra("figures need matplotlib; pip install 'aerofdi[design]'") from error
    figure = Figure(figsize=(3.2 * columns, 2.3 * rows + 0.5), layout="constrained")
    figure.suptitle(title, fontsize=11)
    return figure, np.atleast_2d(figure.subplots(rows, columns, squeeze=False, sharex=share, sharey=share))


def _windows(j: Judged) -> list[tuple[str, np.ndarray, np.ndarray, int]]:
    """Per test point: its name, time since the onset, rows of the run around it, column of the true elevon."""
    out = []
    for i, f in enumerate(j.flight.meta["faults"]):
        end = min(f["end_s"], f["start_s"] + AFTER_S)
        at = np.flatnonzero((j.t_s >= f["start_s"] - BEFORE_S) & (j.t_s < end))
        out.append((f"T{i + 1}, {f['about_trim'] * DEG:.0f} deg", j.t_s[at] - f["start_s"], at, i))
    return out


def _grid(
    name: str, label: str, title: str, unit: str, draw: Callable[[Any, Judged, np.ndarray, np.ndarray], None]
) -> Any:
    """One panel a test point on common axes, one legend; dotted where the method raises its alarm."""
    j = judged(name, label)
    panels = _windows(j)
    figure, axes = _axes(2, -(-len(panels) // 2), title, share=True)
    for axis, (text, t, at, i) in zip(axes.ravel(), panels):
        draw(axis, j, t, at)
        axis.axvline(0.0, color="0.6", lw=0.8, label="fault")
        delay = j.score.detections[i].delay_s
        if math.isfinite(delay):
            axis.axvline(delay, color="k", ls=":", lw=1.0, label="alarm")
        axis.set_title(text, fontsize=9)
        axis.set_xlim(-BEFORE_S, AFTER_S)
        axis.tick_params(labelsize=8, labelbottom=True, labelleft=True)
    for axis in axes.ravel()[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("time since the fault (s)", fontsize=9)
    figure.supylabel(unit, fontsize=9)
    lines, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside lower center", ncols=len(lines), fontsize=8)
    return figure


def _residuals(names: Sequence[str]) -> Callable[[Any, Judged, np.ndarray, np.ndarray], None]:
    def draw(axis: Any, j: Judged, t: np.ndarray, at: np.ndarray) -> None:
        for k, name in enumerate(names):
            axis.plot(t, j.verdict.residual[at, k] * DEG, lw=1.0, label=name)
        limit = float(j.verdict.threshold[at[0], 0]) * DEG
        for y, text in ((-limit, None), (limit, "threshold")):
            axis.axhline(y, color="0.4", ls="--", lw=0.8, label=text)

    return draw


def _probabilities(axis: Any, j: Judged, t: np.ndarray, at: np.ndarray) -> None:
    for k, name in enumerate(("nominal", "left stuck", "right stuck")):
        axis.plot(t, j.verdict.score[at, k], lw=1.0, label=name)
    axis.set_ylim(-0.02, 1.02)


def _selected(axis: Any, j: Judged, t: np.ndarray, at: np.ndarray) -> None:
    valid = j.verdict.active[at]
    chosen = np.where(valid.any(axis=1), valid.argmax(axis=1) + 1.0, np.nan)
    axis.plot(t, chosen, lw=1.6, label="selected model")
    axis.set_yticks([1, 2, 3], ["nominal", "left", "right"])
    axis.set_ylim(0.7, 3.3)


def _position(axis: Any, j: Judged, t: np.ndarray, at: np.ndarray) -> None:
    estimate, std = j.verdict.estimate[at, 2] * DEG, j.verdict.estimate_std[at, 2] * DEG
    true = j.flight.truth["surface.elevon_right"]
    axis.fill_between(t, estimate - 2 * std, estimate + 2 * std, color="C1", alpha=0.2, lw=0, label="2 std")
    axis.plot(t, np.interp(j.t_s[at], true.t_s, true.value) * DEG, lw=1.0, label="true")
    axis.plot(t, estimate, lw=1.0, label="estimated")


def _delays() -> Any:
    """Not in the paper: detection time over the distance of the stuck angle from trim."""
    figure, axes = _axes(1, 1, "Detection time on a leg over the stuck angle about trim")
    figure.set_size_inches(5.0, 3.4)
    rows = sweep()
    for m in METHODS:
        axes[0, 0].plot([r["about_trim_deg"] for r in rows], [r[f"{m}_s"] for r in rows], "o-", label=m)
    axes[0, 0].set(xlabel="stuck angle about trim (deg)", ylabel="detection time (s)")
    axes[0, 0].legend()
    axes[0, 0].grid(alpha=0.3)
    return figure


FIGURES: tuple[tuple[str, str, str, str, str, Any], ...] = (
    ("figure16", "A", "Figure 16: residual of method A", "roll rate (deg/s)", "", _residuals(("e_p",))),
    ("figure17", "B", "Figure 17: residuals of method B", "elevon (deg)", "", _residuals(("left", "right"))),
    ("figure18", "C", "Figure 18: fault probabilities of method C", "probability", "FLT32", _probabilities),
    ("figure19", "C", "Figure 19: model selected by method C", "", "FLT32", _selected),
    ("figure20", "C", "Figure 20: fault probabilities of method C", "probability", "FLT33", _probabilities),
    ("figure21", "C", "Figure 21: model selected by method C", "", "FLT33", _selected),
    ("figure22", "C", "Figure 22: right elevon, true and estimated by method C", "deg", "FLT32", _position),
    ("figure23", "C", "Figure 23: right elevon, true and estimated by method C", "deg", "FLT33", _position),
)


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Draw and save all; the table `figures` lists the files."""
    folder = Path.cwd() / FOLDER
    folder.mkdir(exist_ok=True)
    files = []
    for k, (stem, label, title, unit, flight, draw) in enumerate(FIGURES):
        progress(title, k / (len(FIGURES) + 1))
        for name in (flight,) if flight else NAMES:
            path = folder / (f"{stem}.png" if flight else f"{stem}_{name.lower()}.png")
            _grid(name, label, f"{title}, {name}", unit, draw).savefig(path, dpi=110)
            files.append(str(path))
    path = folder / "delay_over_angle.png"
    _delays().savefig(path, dpi=110)
    progress(f"{len(files) + 1} figures in {folder}", 1.0)
    return Findings({}, {"figures": [*files, str(path)]})
