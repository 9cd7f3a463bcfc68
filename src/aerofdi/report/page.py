"""`write_html`: diagnosed flights as one page that opens anywhere, offline, at once."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..core.errors import WrongUse
from ..core.types import Series
from ..pipeline.types import FlightDiagnosis
from .model_card import model_card
from .panels import panels
from .timeline import marks, modes, timeline, unjudged, windows
from .traces import Packer, Panel, line
from .words import (
    VERDICTS,
    capital,
    detectable,
    event_text,
    evidence,
    headline,
    length,
    ordered,
    spans_text,
)

POINTS_A_PAGE = 200_000
FEWEST, MOST = 150, 5000
WINDOW_S = 20.0
STANDING_M = 5.0
SLIVER_S = 1.0
COUNTS = {"fault": "with a fault", "healthy": "without", "cannot_judge": "not judged"}


def write_html(diagnoses: Sequence[FlightDiagnosis], path: str | os.PathLike[str]) -> Path:
    """Write the page of one or many diagnosed flights; returns its path.

    One file without anything outside it: style, script and data are inside, and its own policy forbids it to load
    more. Written beside and renamed, so it is whole or not there. Signals are thinned to envelopes that keep every
    extreme; around each alarm every sample is kept. The words need no script.

    Raises WrongUse where there is no flight or the folder cannot be written.

    >>> from aerofdi import diagnose, fly
    >>> write_html(diagnose([fly("demo")]), "demo.html").name  # doctest: +SKIP
    'demo.html'
    """
    if not diagnoses:
        raise WrongUse("a report needs at least one diagnosed flight, got none")
    path = Path(path)
    beside = path.with_name(path.name + ".part")
    try:
        beside.write_text(page(diagnoses), encoding="utf-8")
        os.replace(beside, path)
    except OSError as error:
        raise WrongUse(
            f"the report cannot be written to {path} ({error.strerror}); give a file in a folder that exists"
        ) from None
    return path


def page(diagnoses: Sequence[FlightDiagnosis]) -> str:
    """The whole page as text."""
    shown = [panels(d) for d in diagnoses]
    curves = sum(len(p.traces) for each in shown for p in each) + 1
    points = min(max(POINTS_A_PAGE // curves, FEWEST), MOST)
    data = [_data(d, each, points, len(diagnoses)) for d, each in zip(diagnoses, shown, strict=True)]
    sections = "".join(_section(d, i) for i, d in enumerate(diagnoses))
    title = headline(diagnoses[0]).title if len(diagnoses) == 1 else f"{len(diagnoses)} flights"
    here = files(__package__)
    # In a script element only "</" and "<!--" could end the data; no "<" is left at all.
    packed = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">
<title>{escape(title)} - aerofdi</title>
<style>{(here / "page.css").read_text(encoding="utf-8")}</style></head><body>
{_index(diagnoses) if len(diagnoses) > 1 else ""}{sections}
<footer>Made by aerofdi {escape(__version__)}. Angles in degrees, times in seconds on the clock of the log.</footer>
<script type="application/json" id="flights">{packed}</script>
<script>{(here / "page.js").read_text(encoding="utf-8")}</script></body></html>
"""


def _data(d: FlightDiagnosis, shown: list[Panel], points: int, flights: int) -> dict[str, Any]:
    """What the script draws of one flight."""
    span = d.flight.span_s
    near = windows(d, WINDOW_S) if flights <= 10 else []
    packer = Packer(span, points, near)
    drawn = [
        {
            "title": p.title,
            "unit": p.unit,
            "note": p.note,
            "levels": [list(x) for x in p.levels],
            "low": _finite(p.low),
            "high": _finite(p.high),
            "traces": [packer.pack(t) for t in p.traces],
        }
        for p in shown
    ]
    return {
        "t0": span[0],
        "t1": span[1],
        "rows": timeline(d),
        "marks": marks(d),
        "panels": drawn,
        "track": _track(d, packer),
        "clocks": packer.clocks,
    }


def _track(d: FlightDiagnosis, packer: Packer) -> list[dict[str, Any]] | None:
    """East and north of the flight on one clock, where it knows its position."""
    m = d.flight.measured
    if "north" not in m or "east" not in m or len(m["north"].t_s) < 2 or len(m["east"].t_s) < 2:
        return None
    north, east = m["north"], m["east"]
    if max(np.ptp(north.value), np.ptp(east.value)) < STANDING_M:
        return None
    t = north.t_s[np.unique(np.linspace(0, len(north.t_s) - 1, 2 * packer.points).astype(int))]
    whole = Packer(packer.span, len(t))
    out = [whole.pack(line(n, t, _at(s, t), "1")) for n, s in (("east", east), ("north", north))]
    for trace in out:
        packer.clocks.append(whole.clocks[trace["clock"]])
        trace["clock"] = len(packer.clocks) - 1
    return out


def _at(s: Series, t: np.ndarray) -> np.ndarray:
    return np.asarray(np.interp(t, s.t_s, s.value))


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _pill(verdict: str) -> str:
    return f'<span class="pill {escape(verdict)}">{escape(VERDICTS[verdict])}</span>'


def _index(diagnoses: Sequence[FlightDiagnosis]) -> str:
    """The list of flights, and how many had what verdict."""
    counts = ", ".join(
        f"{n} {words}" for v, words in COUNTS.items() if (n := sum(d.verdict == v for d in diagnoses))
    )
    rows = "".join(
        f'<a href="#flight{i}">{_pill(d.verdict)}<b>{escape(headline(d).title)}</b>'
        f"<span>{escape(d.flight.name)}</span></a>"
        for i, d in enumerate(diagnoses)
    )
    return f'<nav><h1>{len(diagnoses)} flights: {counts}</h1><div class="index">{rows}</div></nav>'


def _section(d: FlightDiagnosis, i: int) -> str:
    """One flight: verdict, picture, words."""
    h = headline(d)
    said = "".join(_said(names, which, texts) for names, which, texts in _reasons(d))
    return f"""<section class="flight" id="flight{i}" data-flight="{i}">
<header class="{escape(h.verdict)}"><div>{_pill(h.verdict)}<h2>{escape(h.title)}</h2><p>{escape(h.detail)}</p>
<p class="file">{escape(d.flight.name)}{_aircraft(d)}</p></div><canvas class="track" hidden></canvas></header>
<div class="figures"><noscript><p>The pictures need JavaScript; the words below do not.</p></noscript></div>
<div class="cards">{said}{_visible(d)}{_spans(d)}{_events(d)}{model_card(d)}{_provenance(d)}</div></section>
"""


def _aircraft(d: FlightDiagnosis) -> str:
    said = [d.flight.meta.get("aircraft"), "simulated flight" if d.flight.meta.get("simulated") else ""]
    return "".join(f" &middot; {escape(str(text))}" for text in said if text)


def _reasons(d: FlightDiagnosis) -> list[tuple[str, str, list[str]]]:
    """(diagnosers, verdict, evidence), those that say the very same together."""
    out: dict[tuple[str, ...], list[str]] = {}
    for r in ordered(d):
        out.setdefault((r.verdict, *evidence(r, d)), []).append(r.diagnoser)
    return [(", ".join(names), said[0], list(said[1:])) for said, names in out.items()]


def _said(names: str, which: str, texts: list[str]) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<div class="card"><h3>{escape(names)} {_pill(which)}</h3><ul>{items}</ul></div>'


def _events(d: FlightDiagnosis) -> str:
    rows = [(e["t_s"], r.diagnoser, event_text(e, d)) for r in ordered(d) for e in r.events]
    if not rows:
        return ""
    body = "".join(
        f'<tr><td class="n">{t:.2f} s</td><td>{escape(who)}</td><td>{escape(text)}</td></tr>'
        for t, who, text in sorted(rows, key=lambda row: row[0])
    )
    return f'<div class="card wide"><h3>Events</h3><div class="scroll"><table class="events">{body}</table></div></div>'


def _visible(d: FlightDiagnosis) -> str:
    """Bars: the smallest fault of every surface that would have been seen."""
    parts = []
    for r in ordered(d):
        rows = "".join(
            f'<div class="bar{" blind" if share >= 1 else ""}"><i style="width:{100 * min(share, 1.0):.1f}%"></i>'
            f"<span>{escape(text)}</span></div>"
            for _, text, share in detectable(r, d)
        )
        if rows:
            parts.append(f"<h4>{escape(r.diagnoser)}</h4>{rows}")
    if not parts:
        return ""
    return f'<div class="card"><h3>Smallest fault that would have been seen</h3>{"".join(parts)}</div>'


def _list(texts: Iterable[str]) -> str:
    return "".join(f"<li>{escape(capital(str(t)))}</li>" for t in texts)


def _spans(d: FlightDiagnosis) -> str:
    """Where it was flown, learnt from, judged; and what was not, with why."""
    rows = [
        ("flown under autopilot", spans_text(d.flown)),
        ("learnt from", spans_text(d.trained)),
        ("judged", f"{spans_text(d.judged)} ({length(d.judged):.0f} s)"),
    ]
    rows += [("neither", f"{a:.1f}-{b:.1f} s: {why}") for a, b, why in unjudged(d) if b - a >= SLIVER_S]
    body = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
    return f'<div class="card"><h3>What was judged</h3><table>{body}</table></div>'


def _provenance(d: FlightDiagnosis) -> str:
    """File, profile, clock, versions, and everything that was assumed or noticed."""
    meta = d.flight.meta
    rows = [("file", d.file)] + [
        (k, str(meta[k]))
        for k in ("format", "profile", "clock", "signs", "scenario", "seed")
        if meta.get(k) not in (None, "")
    ]
    rows.append(("duration", f"{d.flight.duration_s:.1f} s"))
    names = list(dict.fromkeys(str(m[3]) for m in modes(d.flight)))
    if names:
        rows.append(("modes", ", ".join(names)))
    body = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
    assumed = [f"assumed: {text}" for text in meta.get("assumed", ())]
    notes = [n for n in dict.fromkeys(d.notes) if n not in meta.get("assumed", ())]
    return (
        f'<div class="card wide"><h3>Where this comes from</h3><table>{body}</table>'
        f"<ul>{_list(assumed)}{_list(notes)}</ul></div>"
    )
