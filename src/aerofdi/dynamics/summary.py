"""What `aerofdi info <aircraft>` shows: every number with unit and source, the trim, the modes."""

from __future__ import annotations

from typing import NamedTuple

from ..aircraft import Aircraft, number_rows
from ..aircraft.identified import IdentifiedModel
from ..aircraft.numbers import NumberRow
from ..parts.ops import pi
from .linearise import Mode, modes
from .trim import trim

DEG = pi / 180.0


class Summary(NamedTuple):
    """Rows for three tables: the numbers of the file, the trim as (what, value, unit), the modes."""

    title: str
    numbers: list[NumberRow]
    trim: list[tuple[str, float, str]]
    modes: list[Mode]


def summary(aircraft: Aircraft) -> Summary:
    """Numbers of a full aircraft, and its level flight and modes at the reference airspeed and altitude.

    >>> from aerofdi.aircraft import load_aircraft
    >>> s = summary(load_aircraft("vireo"))
    >>> [round(value, 2) for what, value, unit in s.trim if what == "angle of attack"]
    [3.91]
    """
    t = trim(aircraft)
    rows = [
        ("airspeed", t.airspeed, "m/s"),
        ("altitude", t.altitude, "m"),
        ("angle of attack", t.alpha / DEG, "deg"),
        ("sideslip", t.beta / DEG, "deg"),
        ("bank", t.phi / DEG, "deg"),
        ("throttle", t.throttle, "1"),
    ]
    rows += [(s.name, d / DEG, "deg") for s, d in zip(aircraft.surfaces, t.surfaces, strict=False)]
    return Summary(f"{aircraft.name}: {aircraft.title}", number_rows(aircraft), rows, modes(aircraft, t))


def summary_lines(aircraft: Aircraft) -> list[str]:
    """The summary as text; of an identified aircraft what was found, and how well.

    >>> from aerofdi.aircraft import load_aircraft
    >>> summary_lines(load_aircraft("vireo"))[0]
    'vireo: Vireo, flying wing of 1.28 kg with two elevons'
    """
    if aircraft.identified is not None:
        return _identified_lines(aircraft.identified)
    s = summary(aircraft)
    width = max(len(r.path) for r in s.numbers)
    span = max(len(f"{r.value} {r.unit}") for r in s.numbers)
    out = [s.title, ""]
    for r in s.numbers:
        flag = "assumed" if r.assumed else ""
        text = f"{r.path:<{width}}  {f'{r.value} {r.unit}':<{span}}  {flag:<7}  {r.source}"
        out.append(f"{text} ({r.note})" if r.note else text)
    out += ["", "Trimmed level flight:"]
    out += [f"  {what:<16} {_zero(value, 3)} {unit}" for what, value, unit in s.trim]
    out += ["", "Modes there (throttle and engine held):"]
    for m in s.modes:
        if m.eigenvalue.imag:
            out.append(f"  {m.name:<13} {m.wn:.4g} rad/s, damping {m.zeta:.4g}")
        else:
            kind = "time constant" if m.eigenvalue.real < 0.0 else "unstable, doubles in"
            time = 1.0 / m.wn if m.eigenvalue.real < 0.0 else 0.693147 / m.wn
            out.append(f"  {m.name:<13} {m.eigenvalue.real:.4g} 1/s, {kind} {time:.3g} s")
    return out


def _zero(value: float, places: int) -> str:
    """Rounded, without a minus sign on zero."""
    return f"{round(value, places) + 0.0:.{places}f}"


def _identified_lines(model: IdentifiedModel) -> list[str]:
    out = [
        f"{model.name}: identified from {model.trained_s:.0f} s of flight",
        f"  sample period {model.dt_s:g} s, command delay {model.delay_s:g} s, lag {model.lag_s:g} s",
        "",
        "Surface groups:",
    ]
    for g in model.groups:
        judged = "" if g.identifiable else ", not identifiable"
        out.append(
            f"  {g.name:<14} {', '.join(g.channels)} [{g.unit}] {g.lower:.3g} to {g.upper:.3g}{judged}"
        )
    out += ["", "Axes (value +- standard deviation):"]
    for axis in model.axes:
        out.append(f"  {axis.rate}: R2 {axis.r2:.2f} in training, {axis.r2_held_out:.2f} held out")
        out += [f"    {n:<24} {axis.coefficient(n):.4g} +- {axis.deviation(n):.2g}" for n in axis.names]
    return [*out, *(["", "Notes:"] if model.notes else []), *(f"  {n}" for n in model.notes)]
