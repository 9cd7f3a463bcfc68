"""Diagnoses and models on the command line, as rich renderables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..aircraft.identified import IdentifiedModel, SurfaceGroup
from .model_card import coefficient, fits, summary
from .words import (
    AXES,
    VERDICTS,
    capital,
    detectable,
    event_text,
    headline,
    length,
    ordered,
    plus_minus,
    reason,
    spans_text,
    spoken,
)

if TYPE_CHECKING:
    from ..core.types import Flight
    from ..pipeline.types import FlightDiagnosis

IN_FULL = 4
EVENTS = 12
STYLES = {"fault": "bold white on red", "healthy": "bold green", "cannot_judge": "bold yellow"}


def grid(*widths: int | None) -> Table:
    """A table without lines; a width of None takes what is left and folds."""
    table = Table.grid(padding=(0, 2))
    for w in widths:
        table.add_column(width=w, overflow="fold", no_wrap=w is not None)
    return table


def pairs(rows: Iterable[tuple[str, str]], width: int = 12) -> Padding:
    """Names in one column, what is said of them in the other."""
    table = grid(width, None)
    for name, text in rows:
        table.add_row(Text(name, "dim"), Text(text))
    return Padding(table, (0, 0, 0, 2))


def verdict(which: str) -> Text:
    """A verdict in its colour."""
    return Text(f" {VERDICTS[which]} ", STYLES[which])


def diagnosis(d: FlightDiagnosis) -> RenderableType:
    """One flight: verdict, what was learnt from and judged, each diagnoser, events, what would have been seen."""
    h = headline(d)
    parts: list[RenderableType] = [
        Text.assemble(verdict(h.verdict), " ", (h.title, "bold")),
        Padding(Text(h.detail), (0, 0, 0, 1)),
        Text(),
        pairs(_about(d)),
    ]
    if d.verdict != "cannot_judge" or len({r.reason for r in d.results}) > 1:
        said = grid(13, 14, None)
        for r in ordered(d):
            said.add_row(Text(r.diagnoser), verdict(r.verdict), Text(reason(r, d)))
        parts += [Text(), Padding(said, (0, 0, 0, 1))]
    told = [(e["t_s"], r.diagnoser, event_text(e, d)) for r in ordered(d) for e in r.events]
    events = sorted(told, key=lambda row: row[0])
    if events:
        table = grid(10, 14, None)
        for t, who, text in events[:EVENTS]:
            table.add_row(Text(f"{t:.2f} s", justify="right"), Text(who, "dim"), Text(text))
        if len(events) > EVENTS:
            table.add_row(
                Text(), Text(), Text(f"and {len(events) - EVENTS} more (all in --json and --report)", "dim")
            )
        parts += [Text(), Padding(table, (0, 0, 0, 1))]
    if d.verdict == "fault":
        smallest = "; ".join(text for r in ordered(d) for _, text, _ in detectable(r, d))
        parts += [Text(), pairs([("detectable", smallest or "not known")])]
    assumed = d.flight.meta.get("assumed", ())
    return Group(
        *parts, *notes([*(f"assumed: {a}" for a in assumed), *(n for n in d.notes if n not in assumed)])
    )


def _about(d: FlightDiagnosis) -> list[tuple[str, str]]:
    rows = [
        ("flight", f"{d.flight.name}, {d.flight.duration_s:.0f} s" + _aircraft(d.flight)),
        ("flown", spans_text(d.flown)),
        (
            "trained",
            f"{spans_text(d.trained)} (never counted as healthy)" if d.trained else "not on this flight",
        ),
        (
            "judged",
            f"{spans_text(d.judged)} ({length(d.judged):.0f} of {d.flight.duration_s:.0f} s)"
            if d.judged
            else "nothing",
        ),
    ]
    if d.model is not None:
        fit = ", ".join(f"{AXES.get(a.rate, a.rate)} {a.r2:.2f} ({a.r2_held_out:.2f})" for a in d.model.axes)
        rows.append(("model", f"{summary(d.model)} R² (held out): {fit}"))
    return rows


def _aircraft(flight: Flight) -> str:
    said = [flight.meta.get("aircraft"), "simulated" if flight.meta.get("simulated") else ""]
    return "".join(f", {text}" for text in said if text)


def notes(notes: Iterable[str]) -> list[RenderableType]:
    """Notes, dimmed, each once."""
    table = grid(1, None)
    for n in dict.fromkeys(notes):
        table.add_row(Text("-", "dim"), Text(capital(str(n)), "dim"))
    return [Text(), Padding(table, (0, 0, 0, 2))] if table.row_count else []


def diagnoses(found: Sequence[FlightDiagnosis], files: Sequence[str] = ()) -> RenderableType:
    """Every flight in full, or a row each where there are many; then the files that were written."""
    parts: list[RenderableType] = []
    if len(found) > IN_FULL:
        parts += [totals(found), Text()]
    else:
        for d in found:
            parts += [diagnosis(d), Text()]
    if files:
        parts.append(pairs([("written", files[0]), *(("", f) for f in files[1:])]))
    return Group(*parts)


def totals(found: Sequence[FlightDiagnosis]) -> Table:
    """A row a flight."""
    table = grid(14, None)
    for d in found:
        h = headline(d)
        table.add_row(
            verdict(d.verdict), Text.assemble(d.flight.name, "\n", (h.title, "bold"), f". {h.detail}\n")
        )
    return table


def model(m: IdentifiedModel) -> RenderableType:
    """An identified aircraft: per axis its coefficients with deviations, fit, groups, notes."""
    parts: list[RenderableType] = [Text.assemble((m.name, "bold"), "  ", summary(m))]
    for a in m.axes:
        r2 = ", ".join(f"{text} {value:.2f}" for text, value in fits(a))
        table = grid(24, None)
        for n in a.names:
            what, unit, factor = coefficient(n, m)
            table.add_row(
                Text(what), Text(plus_minus(factor * a.coefficient(n), factor * a.deviation(n), unit))
            )
        parts += [
            Text(),
            Text.assemble((capital(AXES.get(a.rate, a.rate)), "bold"), f"  R²: {r2}"),
            Padding(table, (0, 0, 0, 2)),
        ]
    groups = [
        (spoken(g.name), f"{_members(g)}; {_range(g.lower, g.upper, g.unit)}" + _identified(g))
        for g in m.groups
    ]
    return Group(*parts, Text(), Text("Surfaces judged as one", "bold"), pairs(groups, 16), *notes(m.notes))


def _members(g: SurfaceGroup) -> str:
    return ", ".join(c.removeprefix("command.") for c in g.channels)


def _identified(g: SurfaceGroup) -> str:
    return "" if g.identifiable else "; moved too little to be identified"


def _range(low: float, high: float, unit: str) -> str:
    if unit == "rad":
        return f"{math.degrees(low):.1f} to {math.degrees(high):.1f} deg"
    return f"{100 * low:.0f} to {100 * high:.0f} % of full command"
