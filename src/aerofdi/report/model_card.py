"""The identified model on a page: coefficients with their intervals, and how well they explain the flight."""

from __future__ import annotations

import math
from html import escape

from ..aircraft.identified import AxisModel, IdentifiedModel
from ..pipeline.types import FlightDiagnosis
from .words import AXES, capital, plus_minus, spoken

BAND = 1.96
WIDTH, HEIGHT = 150.0, 16.0


def model_card(d: FlightDiagnosis) -> str:
    """A card, or nothing where no model was had."""
    model = d.model
    if model is None:
        return ""
    axes = "".join(_axis(a, model) for a in model.axes)
    return (
        f'<div class="card wide"><h3>The model these verdicts rest on</h3><p>{escape(summary(model))}</p>'
        f'<div class="axes">{axes}</div></div>'
    )


def summary(model: IdentifiedModel) -> str:
    """Training, delay, lag and airspeed in a sentence."""
    speed = f" at {model.airspeed:.1f} m/s on average" if math.isfinite(model.airspeed) else ""
    return (
        f"Identified from {model.trained_s:.0f} s of flight{speed}: rates answer commands after "
        f"{1000 * model.delay_s:.0f} ms, with a lag of {1000 * model.lag_s:.0f} ms."
    )


def coefficient(name: str, model: IdentifiedModel) -> tuple[str, str, float]:
    """(what it is, unit, factor from the file's unit) of one coefficient of an axis."""
    if name.startswith("command."):
        surface = name.removeprefix("command.")
        unit = next((g.unit for g in model.groups if g.name == surface), "1")
        return (
            (spoken(surface), "1/s²", 1.0)
            if unit == "rad"
            else (spoken(surface), "deg/s² at full command", 180.0 / math.pi)
        )
    if name in AXES:
        return f"{AXES[name]} rate", "1/s", 1.0
    if name == "trim":
        return "trim moment", "deg/s²", 180.0 / math.pi
    return {"alpha": "angle of attack", "beta": "sideslip"}.get(name, name), "1/s²", 1.0


def fits(a: AxisModel) -> list[tuple[str, float]]:
    """The three R2 of an axis with what each means."""
    return [("commands alone", a.r2), ("held out", a.r2_held_out), ("acceleration", a.r2_acceleration)]


def _axis(a: AxisModel, model: IdentifiedModel) -> str:
    rows = []
    # The bars of coefficients in one unit share a scale.
    reach: dict[str, float] = {}
    for n in a.names:
        _, unit, factor = coefficient(n, model)
        reach[unit] = max(reach.get(unit, 0.0), factor * (abs(a.coefficient(n)) + BAND * a.deviation(n)))
    for n in a.names:
        what, unit, factor = coefficient(n, model)
        value, std = factor * a.coefficient(n), factor * a.deviation(n)
        rows.append(
            f'<tr><th>{escape(what)}</th><td class="n">{escape(plus_minus(value, std, unit))}</td>'
            f"<td>{_whisker(value, BAND * std, reach[unit])}</td></tr>"
        )
    bars = "".join(_fit(text, r2) for text, r2 in fits(a))
    head = f"<h4>{escape(capital(AXES.get(a.rate, a.rate)))}</h4>"
    return f'<div>{head}{bars}<table class="coefficients">{"".join(rows)}</table></div>'


def _fit(text: str, r2: float) -> str:
    share = min(max(r2, 0.0), 1.0) if math.isfinite(r2) else 0.0
    return f'<div class="bar fit"><i style="width:{100 * share:.1f}%"></i><span>R² {r2:.2f} {escape(text)}</span></div>'


def _whisker(value: float, half: float, reach: float) -> str:
    """A dot with its 95 % interval on a scale of +-reach, zero in the middle."""
    if not (math.isfinite(value) and math.isfinite(half) and reach > 0):
        return ""
    x = lambda v: WIDTH / 2 * (1 + 0.96 * v / reach)
    return (
        f'<svg class="whisker" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" aria-hidden="true">'
        f'<path class="zero" d="M{WIDTH / 2:g} 0v{HEIGHT:g}"/>'
        f'<path d="M{x(value - half):.1f} 8H{x(value + half):.1f}"/><circle cx="{x(value):.1f}" cy="8" r="3"/></svg>'
    )
