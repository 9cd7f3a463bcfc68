"""What `aerofdi info`, `paper` and `design` print: records, aircraft, scenarios, claims, designs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..aircraft import Aircraft
from ..core.types import Design, Flight
from ..pipeline.capability import capability
from ..records import describe
from ..scenarios import Scenario
from .terminal import grid, model, notes, pairs
from .words import spans_text, spoken

STATUS_STYLES = {"reproduced": "green", "not_reproduced": "red", "not_reproducible": "yellow"}


def columns(*names: str, right: Sequence[str] = (), whole: Sequence[str] = ()) -> Table:
    """A table with a dim head; columns in `right` are numbers, those in `whole` are never folded."""
    table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 1))
    for name in names:
        side = "right" if name in right else "left"
        table.add_column(name, justify=side, overflow="fold", no_wrap=name in right or name in whole)  # type: ignore[arg-type]
    return table


def thing(found: Aircraft | Scenario | Design | Flight) -> RenderableType:
    """What `aerofdi info` shows of whatever was found."""
    if isinstance(found, Flight):
        return flight(describe(found), capability(found))
    if isinstance(found, Aircraft):
        return aircraft(found)
    return scenario(found) if isinstance(found, Scenario) else design(found)


def flown(f: Flight, path: Path) -> RenderableType:
    """A simulated flight, as written."""
    rows = [
        ("duration", f"{f.duration_s:.1f} s, seed {f.meta['seed']}"),
        ("channels", f"{len(f.measured)} measured, {len(f.truth)} of truth"),
        ("events", "; ".join(f"{e.t_s:.1f} s {e.text}" for e in f.events) or "none"),
        ("written", str(path)),
    ]
    return Group(Text.assemble((f.name, "bold"), f"  {f.meta.get('title', '')}"), pairs(rows))


def flight(told: Mapping[str, Any], abilities: Sequence[Mapping[str, Any]]) -> RenderableType:
    """What a record holds (see `records.describe`) and which diagnosers can run on it."""
    rows = [(k, str(told[k])) for k in ("format", "profile", "aircraft", "clock", "signs") if told[k]]
    rows.append(
        ("time", f"{told['span_s'][0]:.1f} to {told['span_s'][1]:.1f} s ({told['duration_s']:.1f} s)")
    )
    rows.append(("flown", spans_text([(a, b) for a, b in told["flown"]])))
    rows.append(("known by", "; ".join(told["flown_known_by"])))
    modes = [f"{m['mode']} {m['t0_s']:.0f}-{m['t1_s']:.0f} s" for m in told["modes"]]
    if modes:
        more = f", and {len(modes) - 12} more" if len(modes) > 12 else ""
        rows.append(("modes", ", ".join(modes[:12]) + more))
    if told["aliases"]:
        rows.append(("called", ", ".join(f"{k}: {v}" for k, v in told["aliases"].items())))
    can = grid(14, 4, None)
    for a in abilities:
        can.add_row(
            Text(a["diagnoser"]), Text("yes", "green") if a["runs"] else Text("no", "yellow"), Text(a["why"])
        )
    said = [*(f"assumed: {a}" for a in told["assumed"]), *told["notes"]]
    return Group(
        Text(str(told["source"]), "bold"), pairs(rows), Text(), _channels(told["channels"]), Text(),
        Text("Which diagnosers can run", "bold"), Padding(can, (0, 0, 0, 2)), *notes(said),
    )  # fmt: skip


def _channels(channels: Sequence[Mapping[str, Any]]) -> Table:
    table = columns(
        "channel",
        "unit",
        "Hz",
        "samples",
        "gaps",
        "range or values",
        right=("Hz", "samples"),
        whole=("unit",),
    )
    for c in channels:
        hidden = "" if c["table"] == "measured" else f" ({c['table']})"
        gaps = c["gaps"]
        wide = f"{gaps['count']}, {gaps['longest_s']:.1f} s" if gaps["count"] else ""
        low, high = c["range"] or (None, None)
        values = ", ".join(c["values"] or ()) if low is None else f"{low:.4g} to {high:.4g}"
        rate = f"{c['rate_hz']:.3g}" if c["rate_hz"] else ""
        style = "dim" if hidden else ""
        table.add_row(
            Text(c["name"] + hidden, style), c["unit"], rate, str(c["count"]), wide, Text(values, style)
        )
    return table


def aircraft(a: Aircraft) -> RenderableType:
    """An aircraft file: surfaces, sensors, every number with its source; an identified one as its model."""
    if a.identified is not None:
        return model(a.identified)
    surfaces = columns("surface", "limits deg", "deg/s", "actuator", "delay", "positive", right=("deg/s",))
    for s in a.surfaces:
        rate = f"{math.degrees(s.rate_limit):.0f}" if math.isfinite(s.rate_limit) else "none"
        servo = s.actuator.replace("_", " ") + (f" {s.bandwidth:.3g} rad/s" if s.actuator != "none" else "")
        limits = f"{math.degrees(s.lower):.0f} to {math.degrees(s.upper):.0f}"
        surfaces.add_row(spoken(s.name), limits, rate, servo, f"{1000 * s.delay:.0f} ms", s.positive)
    sensors = columns("sensor", "noise", "unit", "Hz", right=("noise", "Hz"))
    for c in a.sensors.values():
        sensors.add_row(c.channel, f"{c.noise:.3g}", c.unit, f"{c.rate:.3g}")
    numbers = columns("number", "value", "unit", "source", right=("value",))
    for path, n in a.numbers.items():
        value = n.given if isinstance(n.given, int | float) else "table"
        mark = Text("assumed", "yellow") if n.assumed else Text(n.source, "dim")
        numbers.add_row(path, f"{value:.5g}" if isinstance(value, int | float) else value, n.unit, mark)
    sources = pairs([(k, str(v)) for k, v in a.sources.items()], max((len(k) for k in a.sources), default=1))
    return Group(
        Text.assemble((a.name, "bold"), f"  {a.title}"), Text(str(a.path), "dim"), Text(), surfaces, Text(), sensors,
        Text(), numbers, Text(), Text("Sources", "bold"), sources,
    )  # fmt: skip


def scenario(s: Scenario) -> RenderableType:
    """A scenario: in a few words, then the file itself, which has every number with its unit."""
    faults = [f"{f.target} {f.mode.replace('_', ' ')} from {f.start_s:g} s" for f in s.faults]
    rows = [
        ("aircraft", s.aircraft),
        ("duration", f"{s.duration_s:g} s, seed {s.seed}"),
        ("faults", "; ".join(faults) or "none"),
    ]
    text = s.path.read_text(encoding="utf-8") if s.path else ""
    return Group(
        Text.assemble((s.name, "bold"), f"  {s.title}"),
        pairs(rows),
        Text(),
        Text(str(s.path or ""), "dim"),
        Text(text),
    )


def claims(told: Mapping[str, Any]) -> RenderableType:
    """The claims of a paper, judged."""
    table = columns("claim", "where", "paper", "ours", "unit", "", right=("paper", "ours"))
    for c in told["claims"]:
        table.add_row(Text(c["claim"]), Text(c["where"]), _number(c["paper"]), _number(c["ours"]), Text(c["unit"]),
                      Text(c["status"].replace("_", " "), STATUS_STYLES[c["status"]]))  # fmt: skip
    counts = {s: sum(c["status"] == s for c in told["claims"]) for s in STATUS_STYLES}
    line = ", ".join(f"{n} {s.replace('_', ' ')}" for s, n in counts.items() if n)
    quick = ", quick run" if told["quick"] else ""
    more = [f"tables, in --json: {', '.join(told['tables'])}"] if told["tables"] else []
    return Group(Text.assemble((told["paper"], "bold"), f"  {line} in {told['seconds']:.1f} s{quick}"), Text(), table,
                 *notes([*(f"{c['id']}: {c['reason']}" for c in told["claims"] if c["reason"]), *more]))  # fmt: skip


def _number(x: float | None) -> str:
    return "" if x is None else f"{x:.4g}"


def facts(title: str, told: Mapping[str, Any]) -> RenderableType:
    """Nested plain values as an indented outline: certificates, specifications."""
    return Group(Text(title, "bold"), *_outline(told, 1))


def _outline(told: Mapping[str, Any], depth: int) -> list[RenderableType]:
    out: list[RenderableType] = []
    for key, value in told.items():
        if isinstance(value, Mapping):
            out += [Text("  " * depth + str(key), "dim"), *_outline(value, depth + 1)]
        else:
            out.append(Text.assemble("  " * depth, (f"{key}  ", "dim"), _plain(value)))
    return out


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, (list, tuple)):
        shown = ", ".join(_plain(v) for v in value[:8])
        return f"{shown}, ... ({len(value)})" if len(value) > 8 else shown
    return str(value)


def design(d: Design) -> RenderableType:
    """A design: what was asked and the certificate."""
    asked = {k: v for k, v in d.spec.items() if not isinstance(v, (dict, Mapping))}
    return Group(facts(f"{d.method}: asked", asked), facts("certificate", d.certificate))
