"""Campaigns: a TOML table of aircraft x scenario x diagnoser x seeds -> Parquet -> table and plot.

    name = "vireo_stuck"
    title = "stuck elevons in gusty wind"
    aircraft = ["vireo"]                                  # left out: the aircraft each scenario names
    scenarios = ["vireo_calm", "gusty.toml"]              # shipped names, or files beside this one
    seeds = { first = 1000, count = 1000 }
    chunk = 20                                            # flights in one part file
    score = { settle_s = 10.0, clear_s = 10.0 }           # see `evaluate.score`
    [diagnosers]                                          # label -> function(aircraft name) -> Diagnoser
    A = "aerofdi.papers.vireo_comparison.methods:method_a"

`[draw]` varies the scenario from seed to seed: see `evaluate.draws`. Every flight is flown once and judged by
every diagnoser. The result depends on the seeds alone, not on the number of processes, the order, or whether
the campaign was interrupted: parts that are there are kept, the rest is flown. Before parts are kept, one flight of
theirs is flown again; where it comes out otherwise (the code or a file has changed since) they are refused.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..aircraft.lines import read_toml
from ..core import Diagnoser, Flight, MissingExtra, WrongUse, bind, run
from ..scenarios import load_scenario
from ..scenarios.reader import Table
from .draws import Draw, apply, read_draw
from .score import Detection, Fault, Score, score
from .truth import faults_of, value_at

KEYS = ("name", "title", "aircraft", "scenarios", "seeds", "chunk", "score", "diagnosers", "draw")
SCORE_KEYS = tuple(n for n, p in inspect.signature(score).parameters.items() if p.kind is p.KEYWORD_ONLY)
Progress = Callable[[str, float], None]


class Campaign(NamedTuple):
    """What to fly and who judges; see the top of this file. path: of the TOML, scenario files beside it."""

    name: str
    title: str
    aircraft: tuple[str, ...]
    scenarios: tuple[str, ...]
    first_seed: int
    seeds: int
    chunk: int
    score: dict[str, float]
    diagnosers: dict[str, str]
    draw: Draw
    path: Path


class Unit(NamedTuple):
    """One part: some consecutive seeds of one aircraft and scenario."""

    aircraft: str
    scenario: str
    seeds: tuple[int, ...]


def _words(t: Table, key: str, default: list[str] | None = None) -> tuple[str, ...]:
    """A list of texts, one at least."""
    value = t.values.pop(key, default)
    if not isinstance(value, list) or not value or not all(isinstance(x, str) for x in value):
        raise t.refuse(key, f"{key!r} must be a list of texts, as {key} = ['a', 'b'], got {value!r}")
    return tuple(value)


def load_campaign(path: str | Path, seeds: int | None = None) -> Campaign:
    """Read a campaign; seeds: fly only this many (the first ones). Refusals name file, line and what is accepted."""
    path = Path(path)
    table, lines = read_toml(path)
    t = Table(path, lines, table)
    t.known += KEYS
    for key in (k for k in table if k not in KEYS):
        raise t.refuse(key, f"unknown key {key!r}; known: {', '.join(KEYS)}")
    name, count = t.word("name"), t.table("seeds")
    first, number = count.integer("first"), count.integer("count", low=1)
    count.end()
    how = t.table("score")
    times = {k: how.values.pop(k) for k in SCORE_KEYS if k in how.values}
    how.known += SCORE_KEYS
    how.end()
    for k, x in times.items():
        if isinstance(x, bool) or not isinstance(x, int | float) or not x >= 0:
            raise how.refuse(k, f"{k!r} must be a number of seconds from 0, got {x!r}")
    panel = t.table("diagnosers")
    makers = {label: panel.word(label) for label in panel.names()}
    if not makers:
        raise t.refuse("", "[diagnosers] needs at least one: label = 'package.module:function'")
    if seeds is not None and seeds < 1:
        raise WrongUse(f"{seeds} seeds were asked for; give 1 or more")
    title, chunk = t.word("title", default=name), t.integer("chunk", 20, low=1)
    aircraft = _words(t, "aircraft", [""])
    scenarios = _words(t, "scenarios")
    draw = read_draw(path, lines, t.values.pop("draw", {}))
    return Campaign(
        name,
        title,
        aircraft,
        scenarios,
        first,
        min(seeds or number, number),
        chunk,
        times,
        makers,
        draw,
        path,
    )


def units(c: Campaign) -> list[Unit]:
    """The parts in order."""
    seeds = range(c.first_seed, c.first_seed + c.seeds)
    blocks = [tuple(seeds[i : i + c.chunk]) for i in range(0, len(seeds), c.chunk)]
    return [Unit(a, s, block) for a in c.aircraft for s in c.scenarios for block in blocks]


def _part(c: Campaign, unit: Unit, out: Path) -> Path:
    """The file of a part; its name changes with the campaign, the scenario and the version of this package."""
    what = [__version__, c.score, c.diagnosers, c.draw, *unit, _scenario_text(c, unit.scenario)]
    digest = hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:16]
    return out / f"part-{unit.seeds[0]:08d}-{digest}.parquet"


def _scenario_path(c: Campaign, scenario: str) -> str:
    beside = c.path.parent / scenario
    return str(beside) if beside.suffix == ".toml" and beside.exists() else scenario


def _scenario_text(c: Campaign, scenario: str) -> str:
    path = Path(_scenario_path(c, scenario))
    return path.read_text(encoding="utf-8") if path.exists() else scenario


def maker_of(maker: str) -> Callable[[str], Diagnoser]:
    """ "module:function" -> that function."""
    module, _, function = maker.partition(":")
    try:
        home = import_module(module)
    except (ImportError, ValueError) as error:
        raise WrongUse(
            f"diagnoser {maker!r} cannot be made: {error}; give 'package.module:function' of an aircraft name"
        ) from error
    found = getattr(home, function, None)
    if not callable(found):
        own = [
            n
            for n, x in vars(home).items()
            if inspect.isfunction(x) and x.__module__ == module and n[0] != "_"
        ]
        raise WrongUse(
            f"diagnoser {maker!r} cannot be made: {module} has no function {function!r}; it has {', '.join(own)}"
        )
    return found


def make(maker: str, aircraft: str) -> Diagnoser:
    """ "module:function" -> function(aircraft)."""
    return maker_of(maker)(aircraft)


def rows(
    flight: Flight, d: Diagnoser, label: str, faults: Iterable[Fault], how: dict[str, float]
) -> list[dict]:
    """One row for the flight and one for each of its faults, as judged by one diagnoser."""
    sample = bind(flight, d.inputs, d.dt_s, who=d.name)
    s = score(sample.t_s, run(d, sample)[1], d, faults, **how)
    common = {"diagnoser": label, "seed": int(flight.meta.get("seed", -1))}
    whole = {"healthy_s": s.healthy_s, "ok_share": s.ok_share, "false_alarms_s": list(s.false_alarms_s)}
    out = [common | whole | {"kind": "flight"}]
    for f in s.detections:
        context = {"bank": value_at(flight, "phi", f.start_s), "about_trim": _about_trim(flight, f)}
        out.append(common | context | f._asdict() | {"others": list(f.others), "kind": "fault"})
    return out


def _about_trim(flight: Flight, d: Detection) -> float:
    """Size of the fault about trim where the flight says so, else NaN."""
    for f in flight.meta.get("faults", ()):
        if (f["target"], f["mode"], f["start_s"]) == (d.fault, d.mode, d.start_s):
            return float(f.get("about_trim", math.nan))
    return math.nan


def _schema() -> Any:
    import pyarrow as pa

    text, number, flag = pa.string(), pa.float64(), pa.bool_()
    kinds = {"fault": text, "mode": text, "isolated": text, "correct": flag, "alarmed_before": flag}
    fault = [(n, kinds.get(n, number)) for n in Detection._fields if n != "others"]
    return pa.schema(
        [("kind", text), ("aircraft", text), ("scenario", text), ("seed", pa.int64()), ("diagnoser", text)]
        + [("healthy_s", number), ("ok_share", number), ("false_alarms_s", pa.list_(number))]
        + [("bank", number), ("about_trim", number), *fault, ("others", pa.list_(text))]
    )


def judged(c: Campaign, unit: Unit) -> Iterator[dict[str, Any]]:
    """The rows of a part, flight after flight."""
    from ..simulate import fly

    scenario = load_scenario(_scenario_path(c, unit.scenario))
    scenario = replace(scenario, aircraft=unit.aircraft or scenario.aircraft)
    panel = {label: make(maker, scenario.aircraft) for label, maker in c.diagnosers.items()}
    for seed in unit.seeds:
        flight = fly(apply(c.draw, scenario, seed), seed=seed)
        for label, d in panel.items():
            for row in rows(flight, d, label, faults_of(flight), c.score):
                yield {"aircraft": scenario.aircraft, "scenario": unit.scenario} | row


def fly_part(c: Campaign, unit: Unit, out: Path) -> Path:
    """Fly and judge one part; the file is written beside and renamed, so it is whole or not there."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = _part(c, unit, out)
    table = pa.Table.from_pylist(list(judged(c, unit)), _schema())
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    pq.write_table(table, beside)
    beside.replace(path)
    return path


def _alike(a: Any, b: Any) -> bool:
    """Equal, numbers to a millionth: another machine's last digits are no other result."""
    if isinstance(a, float) and isinstance(b, float):
        return (math.isnan(a) and math.isnan(b)) or a == b or abs(a - b) <= 1e-6 * max(abs(a), abs(b), 1.0)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_alike, a, b))
    return bool(a == b)


def _check_kept(c: Campaign, unit: Unit, path: Path) -> None:
    """Refuse the parts that are there where the first flight of one of them comes out otherwise now."""
    import pyarrow as pa

    stored = [r for r in load_rows([path]) if r["seed"] == unit.seeds[0]]
    now = pa.Table.from_pylist(list(judged(c, unit._replace(seeds=unit.seeds[:1]))), _schema()).to_pylist()
    if len(stored) != len(now) or not all(_alike(a[k], b[k]) for a, b in zip(stored, now) for k in b):
        raise WrongUse(
            f"{path}: seed {unit.seeds[0]} comes out otherwise than stored there: code, aircraft or diagnosers have "
            f"changed since; give another folder, or delete the parts in this one"
        )


def run_campaign(
    c: Campaign, out: str | Path, progress: Progress | None = None, workers: int | None = None
) -> list[Path]:
    """Fly what is not there yet, over `workers` processes (default: all cores); returns the part files in
    order.

    progress(text, share) is called as parts finish. Interrupted, it may be started again with the same
    arguments: parts under way are finished and kept.
    """
    for maker in c.diagnosers.values():
        maker_of(maker)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    say = progress or (lambda text, share: None)
    parts = units(c)
    paths = [_part(c, u, out) for u in parts]
    missing = [u for u, p in zip(parts, paths) if not p.exists()]
    kept = [(u, p) for u, p in zip(parts, paths) if p.exists()]
    if kept:
        _check_kept(c, *kept[0])
    flights = sum(len(u.seeds) for u in parts)
    done = flights - sum(len(u.seeds) for u in missing)
    say(f"{c.name}: {done} of {flights} flights", done / max(flights, 1))

    def stopping() -> None:
        say(f"{c.name}: stopping, {done} of {flights} flights; finishing those under way", done / flights)

    for unit in _finished(c, missing, out, workers or os.cpu_count() or 1, stopping):
        done += len(unit.seeds)
        say(f"{c.name}: {done} of {flights} flights", done / flights)
    return paths


def _deaf() -> None:
    """In a worker: Ctrl-C is for the parent, which lets the part under way be finished."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _finished(
    c: Campaign, parts: list[Unit], out: Path, workers: int, stopping: Callable[[], None]
) -> Iterator[Unit]:
    """Units as they finish. One worker flies here; more fly in processes of their own, and stopping() is called
    before the parts under way are waited for."""
    if workers == 1 or len(parts) <= 1:
        for unit in parts:
            fly_part(c, unit, out)
            yield unit
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_deaf) as pool:
        waiting = {pool.submit(fly_part, c, unit, out): unit for unit in parts}
        try:
            for future in as_completed(waiting):
                future.result()
                yield waiting[future]
        except BaseException:
            stopping()
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def load_rows(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """All rows of the parts, in the order given."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(p) for p in paths]
    return pa.concat_tables(tables).to_pylist() if tables else []


def scores(found: Iterable[dict[str, Any]]) -> dict[str, list[tuple[dict[str, Any], Score]]]:
    """Diagnoser -> its flights in order of the rows, each as (flight row, Score)."""
    flights: dict[tuple, tuple[dict, list[Detection]]] = {}
    for row in found:
        key = (row["diagnoser"], row["aircraft"], row["scenario"], row["seed"])
        if row["kind"] == "flight":
            flights[key] = (row, [])
        else:
            fields = {n: row[n] for n in Detection._fields} | {"others": tuple(row["others"])}
            flights[key][1].append(Detection(**fields))
    out: dict[str, list[tuple[dict, Score]]] = {}
    for (label, *_), (row, detections) in flights.items():
        s = Score(tuple(detections), tuple(row["false_alarms_s"]), row["healthy_s"], row["ok_share"])
        out.setdefault(label, []).append((row, s))
    return out


def delays(
    found: Iterable[dict[str, Any]], label: str, where: Callable[[dict], bool] = lambda row: True
) -> Any:
    """Detection delays (s, inf where missed) of one diagnoser over the fault rows that satisfy `where`."""
    picked = [r["delay_s"] for r in found if r["kind"] == "fault" and r["diagnoser"] == label and where(r)]
    return np.array([math.inf if d is None else d for d in picked])


def plot(found: list[dict[str, Any]], path: str | Path, title: str = "") -> Path:
    """Share of faults detected over time since onset, one line a diagnoser, as a picture file."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra("plots need matplotlib; pip install 'aerofdi[design]'") from error
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    for label in dict.fromkeys(r["diagnoser"] for r in found):
        d = np.sort(delays(found, label))
        if len(d):
            share = np.arange(1, len(d) + 1) / len(d)
            axes.step(d[np.isfinite(d)], share[np.isfinite(d)], where="post", label=label)
    axes.set(xlabel="time since onset (s)", ylabel="share of faults detected", ylim=(0, 1), title=title)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path)
    return Path(path)
