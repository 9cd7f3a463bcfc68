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
the campaign was interrupted: parts that are there are kept, the rest is flown.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
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
from .draws import Draw, apply, read_draw
from .score import Detection, Fault, Score, score
from .truth import faults_of, value_at

KEYS = {"name", "title", "aircraft", "scenarios", "seeds", "chunk", "score", "diagnosers", "draw"}
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


def load_campaign(path: str | Path, seeds: int | None = None) -> Campaign:
    """Read a campaign; seeds: fly only this many (the first ones)."""
    path = Path(path)
    table, lines = read_toml(path)
    unknown = sorted(set(table) - KEYS)
    missing = sorted({"name", "scenarios", "seeds", "diagnosers"} - set(table))
    if unknown or missing:
        said = [f"unknown {', '.join(unknown)}"] if unknown else []
        said += [f"no {', '.join(missing)}"] if missing else []
        raise WrongUse(f"{path}: the campaign has {' and '.join(said)}; it takes {', '.join(sorted(KEYS))}")
    count = int(table["seeds"]["count"])
    return Campaign(
        table["name"], table.get("title", table["name"]), tuple(table.get("aircraft", [""])),
        tuple(table["scenarios"]), int(table["seeds"]["first"]), min(seeds or count, count),
        int(table.get("chunk", 20)), dict(table.get("score", {})), dict(table["diagnosers"]),
        read_draw(path, lines, table.get("draw", {})), path,
    )  # fmt: skip


def units(c: Campaign) -> list[Unit]:
    """The parts in order."""
    seeds = range(c.first_seed, c.first_seed + c.seeds)
    blocks = [tuple(seeds[i : i + c.chunk]) for i in range(0, len(seeds), c.chunk)]
    return [Unit(a, s, block) for a in c.aircraft for s in c.scenarios for block in blocks]


def _part(c: Campaign, unit: Unit, out: Path) -> Path:
    """The file of a part; its name changes with everything its content depends on."""
    what = [__version__, c.score, c.diagnosers, c.draw, *unit, _scenario_text(c, unit.scenario)]
    digest = hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:16]
    return out / f"part-{unit.seeds[0]:08d}-{digest}.parquet"


def _scenario_path(c: Campaign, scenario: str) -> str:
    beside = c.path.parent / scenario
    return str(beside) if beside.suffix == ".toml" and beside.exists() else scenario


def _scenario_text(c: Campaign, scenario: str) -> str:
    path = Path(_scenario_path(c, scenario))
    return path.read_text(encoding="utf-8") if path.exists() else scenario


def make(maker: str, aircraft: str) -> Diagnoser:
    """ "module:function" -> function(aircraft)."""
    module, _, function = maker.partition(":")
    try:
        return getattr(import_module(module), function)(aircraft)
    except (ImportError, AttributeError) as error:
        raise WrongUse(
            f"diagnoser {maker!r} cannot be made: {error}; give 'package.module:function' of an aircraft name"
        ) from error


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


def fly_part(c: Campaign, unit: Unit, out: Path) -> Path:
    """Fly and judge one part; the file is written beside and renamed, so it is whole or not there."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from ..simulate import fly

    path = _part(c, unit, out)
    scenario = load_scenario(_scenario_path(c, unit.scenario))
    scenario = replace(scenario, aircraft=unit.aircraft or scenario.aircraft)
    aircraft = scenario.aircraft
    panel = {label: make(maker, aircraft) for label, maker in c.diagnosers.items()}
    found: list[dict] = []
    for seed in unit.seeds:
        flight = fly(apply(c.draw, scenario, seed), seed=seed)
        for label, d in panel.items():
            found += rows(flight, d, label, faults_of(flight), c.score)
    table = pa.Table.from_pylist(
        [{"aircraft": aircraft, "scenario": unit.scenario} | r for r in found], _schema()
    )
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    pq.write_table(table, beside)
    beside.replace(path)
    return path


def run_campaign(
    c: Campaign, out: str | Path, progress: Progress | None = None, workers: int | None = None
) -> list[Path]:
    """Fly what is not there yet, over `workers` processes (default: all cores); returns the part files in
    order.

    progress(text, share) is called as parts finish. Interrupted, it may be started again with the same
    arguments.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    say = progress or (lambda text, share: None)
    todo = units(c)
    paths = [_part(c, u, out) for u in todo]
    missing = [u for u, p in zip(todo, paths) if not p.exists()]
    flights = sum(len(u.seeds) for u in todo)
    done = flights - sum(len(u.seeds) for u in missing)
    say(f"{c.name}: {done} of {flights} flights", done / max(flights, 1))
    for unit in _finished(c, missing, out, workers or os.cpu_count() or 1):
        done += len(unit.seeds)
        say(f"{c.name}: {done} of {flights} flights", done / flights)
    return paths


def _finished(c: Campaign, todo: list[Unit], out: Path, workers: int) -> Iterator[Unit]:
    """Units as they finish. One worker flies here; more fly in processes of their own."""
    if workers == 1 or len(todo) <= 1:
        for unit in todo:
            fly_part(c, unit, out)
            yield unit
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(fly_part, c, unit, out): unit for unit in todo}
        try:
            for future in as_completed(waiting):
                future.result()
                yield waiting[future]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
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
