"""Figures 2, 8, 9, 11, 12, 13 and 14 of the paper with our filters, as PNG files in a folder of the caller's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...core import MissingExtra
from ...design.lpv import gridded, response
from ...design.lpv_observer_models import AXES
from ..claims import Findings
from .figures import FOLDER
from .filters import DEG, LABELS, SENSITIVITY_W, db, modes, sensitivity, step_response, worst_speed
from .worst_case import KINDS, NORMS, SPEEDS, axes, bounds, lower_bounds

COLOURS = dict(
    zip((*KINDS, "stuck_lpv"), ("tab:gray", "tab:orange", "tab:blue", "tab:green", "tab:red"), strict=True)
)
# Stated in the text: upper bounds at one, worst airspeeds.
PAPER_UPPER = {"nominal_lti": 2.1, "robust_lti": 2.1, "nominal_lpv": 1.6, "robust_lpv": 1.2}
PAPER_SPEED = {"nominal_lti": 20.0, "robust_lti": 20.0, "nominal_lpv": 20.0, "robust_lpv": 15.78}


def _figure(columns: int, title: str, rows: int = 1) -> tuple[Any, Any]:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra("figures need matplotlib; pip install 'aerofdi[design]'") from error
    figure = Figure(figsize=(min(4.6, 15.0 / columns) * columns, 3.2 * rows), layout="constrained")
    figure.suptitle(title, fontsize=10)
    return figure, np.atleast_1d(figure.subplots(rows, columns)).ravel()


def _bode_axis(axis: Any, title: str) -> None:
    axis.set(xscale="log", xlabel="frequency (rad/s)", ylabel="magnitude (dB)")
    axis.set_title(title, fontsize=9)
    axis.grid(alpha=0.3, which="both")


def figure2() -> Any:
    """Aileron to roll rate and elevator to pitch rate at every airspeed."""
    figure, panels = _figure(2, "Figure 2: lateral (left) and short-period (right) models over airspeed")
    w = np.logspace(-1, 2, 300)
    frequency = modes()
    for panel, name, mode in zip(panels, AXES, ("dutch_roll", "short_period"), strict=True):
        A, B = axes()[name].model(SPEEDS)
        C = np.eye(A.shape[1])[[1]] if name == "lat" else np.eye(2)[[0]]
        g = gridded(SPEEDS, A, B, C, [[0.0]], ("delta",), ("rate",))
        size = db(response(g, w)[:, :, 0, 0])
        for k, V in enumerate(SPEEDS):
            panel.plot(w, size[k], color=str(0.75 * (20.0 - V) / 8.0), lw=0.8)
        what = "aileron to p" if name == "lat" else "elevator to q"
        now = frequency[mode]
        _bode_axis(
            panel, f"{what}; {mode.replace('_', ' ')} {now[0]:.1f} to {now[-2]:.1f} rad/s, dark: 20 m/s"
        )
    return figure


def figure8_11() -> Any:
    """The uncertainty weights."""
    figure, panels = _figure(2, "Figures 8 (lateral) and 11 (longitudinal): uncertainty weights W_Delta")
    w = np.logspace(-2, 4, 400)
    marks = {"lat": (("dutch roll", 4.1), ("roll", 11.6), ("actuator", 62.8)),
             "lon": (("phugoid", 0.87), ("short period", 14.5), ("actuator", 62.8))}  # fmt: skip
    for panel, name in zip(panels, AXES, strict=True):
        weight = axes()[name].weights.uncertainty
        panel.plot(w, db([weight.gain_at(x) for x in w]), color="k")
        for text, x in marks[name]:
            y = weight.gain_at(x)
            panel.plot(x, db(y), "o", color="tab:red", ms=4)
            panel.annotate(
                f"{text} ({100 * y:.3g} %)",
                (x, db(y)),
                textcoords="offset points",
                xytext=(6, -10),
                fontsize=7,
            )
        _bode_axis(panel, {"lat": "lateral", "lon": "longitudinal"}[name])
    return figure


def figure9_12() -> Any:
    """Sensitivities of the robust LPV filter, and of the one with the fault as an input, against their bound."""
    figure, panels = _figure(
        2, "Figures 9 (lateral, above) and 12 (longitudinal): |e/f| at every airspeed, loop closed", 2
    )
    for i, name in enumerate(AXES):
        for j, kind in enumerate(("robust_lpv", "stuck_lpv")):
            panel, s = panels[2 * i + j], sensitivity(kind, name)
            panel.plot(SENSITIVITY_W, db(s.closed).T, color=COLOURS[kind], lw=0.7)
            panel.plot(SENSITIVITY_W, db(s.opened).T, color="0.75", lw=0.5, zorder=0)
            panel.plot(SENSITIVITY_W, db(s.bound), "k--", lw=1.2)
            _bode_axis(panel, f"{LABELS[kind]}: largest S/Sbar {(s.closed / s.bound).max():.2f}")
            panel.set_ylim(-60, 20)
    panels[0].plot([], [], color="0.75", label="|e/delta|, loop open")
    panels[0].plot([], [], "k--", label="bound Sbar")
    panels[0].legend(fontsize=7, loc="upper left")
    return figure


def figure13() -> Any:
    """Worst-case gains of the lateral filters: over the size of Delta, and frozen over airspeed."""
    figure, (left, right) = _figure(
        2, "Figure 13: worst-case gain from -delta_a to e_a; crosses: the paper, as stated"
    )
    upper = bounds()
    for k in (*KINDS, "stuck_lpv"):
        got = [(n, upper[k, n].gain) for n in NORMS if (k, n) in upper]
        if got:
            left.plot(*zip(*got, strict=True), "o-", color=COLOURS[k], label=LABELS[k], ms=3)
        if k in PAPER_UPPER:
            left.plot(1.02, PAPER_UPPER[k], "x", color=COLOURS[k], ms=7)
        low = [x.gain for x in lower_bounds(k)]
        right.plot(SPEEDS, low, color=COLOURS[k], label=LABELS[k])
        right.plot(SPEEDS[int(np.argmax(low))], max(low), "s", mfc="none", color=COLOURS[k], ms=8)
        if k in PAPER_SPEED:
            right.axvline(PAPER_SPEED[k], color=COLOURS[k], lw=0.5, ls=":")
    left.set(xlabel="bound on ||Delta||", ylabel="upper bound, all trajectories")
    right.set(xlabel="airspeed (m/s)", ylabel="exact frozen gain, ||Delta|| <= 1")
    for panel in (left, right):
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7)
    return figure


def figure14() -> Any:
    """An aileron that steps by 10 deg and stays, as each filter sees it at its worst airspeed and at 20 m/s."""
    kinds = (*KINDS, "stuck_lpv")
    figure, panels = _figure(
        5, "Figure 14: estimates of an aileron stuck at 10 deg (dashed), Delta at its worst"
    )
    for panel, k in zip(panels, kinds, strict=True):
        for V, shade in zip(dict.fromkeys((worst_speed(k), 20.0)), (COLOURS[k], "0.5"), strict=False):
            s = step_response(k, V)
            panel.plot(s.t_s, s.estimate / DEG, color=shade, label=f"{V:.1f} m/s", lw=1.2)
        panel.axhline(10.0, color="k", ls="--", lw=0.8)
        panel.set(xlabel="time (s)", ylabel="aileron (deg)", ylim=(-7.0, 14.0))
        panel.set_title(LABELS[k], fontsize=9)
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7)
    return figure


FIGURES: dict[str, Callable[[], Any]] = {
    "figure02": figure2,
    "figure08_11": figure8_11,
    "figure09_12": figure9_12,
    "figure13": figure13,
    "figure14": figure14,
}


def draw(folder: str | Path, progress: Callable[[str, float], None] | None = None) -> list[Path]:
    """Write every figure as PNG into the folder; returns the paths."""
    out = []
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    for k, (name, make) in enumerate(FIGURES.items()):
        if progress:
            progress(name, k / len(FIGURES))
        path = place / f"{name}.png"
        make().savefig(path, dpi=120)
        out.append(path)
    return out


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Draw into the folder of the other figures, where one stands; the table `filter_figures` lists the files."""
    del quick
    return Findings({}, {"filter_figures": [str(p) for p in draw(Path.cwd() / FOLDER, progress)]})
