"""Thousands of flights over all cores, streamed to a Parquet dataset; resumable, and the same in any order.

A flight is named by (scenario, seed, run); what differs from run to run besides its random numbers is drawn
from the same counter-based generator, or given as one value per run. So threads, batches and interruptions
change nothing. Threads share one compiled loop, which does not hold the interpreter.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..core import bind
from ..core.errors import MissingChannel, WrongUse
from ..core.types import Array, Channels, Flight
from ..parts.random import inverse_normal, uniform4
from ..scenarios import Scenario
from .fly import as_scenario, assemble, start
from .loop import advance
from .prepare import Prepared, prepare

DRAW_CHANNEL = 1 << 20
BATCH = 16


class Normal(NamedTuple):
    """A draw from the normal distribution."""

    mean: float
    std: float


class Uniform(NamedTuple):
    """A draw evenly spread over [low, high]."""

    low: float
    high: float


Draw = Normal | Uniform | Sequence[float] | Array


def drawn(draws: Mapping[str, Draw], seed: int, run: int) -> dict[str, float]:
    """What each draw gives in this run; depends on (seed, run, the draw's name and position) only."""
    out = {}
    for i, (path, draw) in enumerate(draws.items()):
        u = uniform4(seed, run, DRAW_CHANNEL + i, 0)[0]
        if isinstance(draw, Normal):
            out[path] = float(draw.mean + draw.std * inverse_normal(u))
        elif isinstance(draw, Uniform):
            out[path] = float(draw.low + (draw.high - draw.low) * u)
        else:
            out[path] = float(draw[run])
    return out


def changed(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """The scenario with numbers replaced by dotted path.

    "start.airspeed", "wind.speed", "wind.turbulence.wind_20ft", "faults.0.value", "noise_factor"; and
    "parameters.<path of an aircraft number>", where the value is a factor.

    >>> from aerofdi.scenarios import load_scenario
    >>> changed(load_scenario("demo"), {"faults.0.start_s": 30.0}).faults[0].start_s
    30.0
    """
    for path, value in values.items():
        if path.startswith("parameters."):
            number = path.removeprefix("parameters.")
            scenario = replace(scenario, parameters={**scenario.parameters, number: (float("nan"), value)})
        else:
            scenario = _put(scenario, path.split("."), value, path)
    return scenario


def _put(node: Any, parts: list[str], value: float, path: str) -> Any:
    head, rest = parts[0], parts[1:]
    if isinstance(node, tuple) and not hasattr(node, "_fields"):
        if not head.isdigit() or int(head) >= len(node):
            raise WrongUse(f"draw {path!r}: there is no entry {head!r}; there are {len(node)}")
        i = int(head)
        return (*node[:i], _put(node[i], rest, value, path) if rest else value, *node[i + 1 :])
    fields: tuple[str, ...] = tuple(getattr(node, "_fields", getattr(node, "__dataclass_fields__", ())))
    if head not in fields:
        raise WrongUse(f"draw {path!r}: {type(node).__name__} has no {head!r}; it has {', '.join(fields)}")
    new = _put(getattr(node, head), rest, value, path) if rest else value
    return replace(node, **{head: new}) if is_dataclass(node) else node._replace(**{head: new})  # type: ignore[type-var]


def _one(prepared: Prepared, seed: int, run: int, truth: bool) -> Flight:
    r, motion = start(prepared, seed, run, truth)
    motion = advance(r.params, r.memory, r.record, motion, seed, run, prepared.steps, 0)
    return assemble(r, motion.k)


def flights(
    scenario: str | os.PathLike[str] | Scenario,
    runs: int | Sequence[int],
    draws: Mapping[str, Draw] | None = None,
    seed: int | None = None,
    jobs: int | None = None,
    truth: bool = True,
) -> Iterator[tuple[int, Flight]]:
    """(run, Flight) of each run in order, flown by `jobs` threads; at most two flights a thread are held at
    once.

    runs: how many (0, 1, ...), or which. draws: path (see `changed`) -> Normal, Uniform or one value per run.
    truth: whether to record it.
    """
    s = as_scenario(scenario)
    numbers = list(range(runs)) if isinstance(runs, int) else [int(r) for r in runs]
    base = s.seed if seed is None else seed
    work = _worker(s, draws or {}, base, truth)
    yield from _ahead(work, numbers, jobs or os.cpu_count() or 1)


def _worker(s: Scenario, draws: Mapping[str, Draw], seed: int, truth: bool) -> Callable[[int], Flight]:
    shared = prepare(s) if not draws else None

    def work(run: int) -> Flight:
        values = drawn(draws, seed, run)
        prepared = shared or prepare(changed(s, values))
        flight = _one(prepared, seed, run, truth)
        if values:
            flight.meta["draws"] = values
        return flight

    return work


def _ahead(work: Callable[[int], Any], numbers: Sequence[int], jobs: int) -> Iterator[tuple[int, Any]]:
    """Results in order, computed up to two a job ahead."""
    if jobs <= 1:
        for run in numbers:
            yield run, work(run)
        return
    with ThreadPoolExecutor(jobs) as pool:
        waiting: list[tuple[int, Any]] = []
        rest = iter(numbers)
        try:
            for run in rest:
                waiting.append((run, pool.submit(work, run)))
                if len(waiting) >= 2 * jobs:
                    first, future = waiting.pop(0)
                    yield first, future.result()
            for first, future in waiting:
                yield first, future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def fly_many(
    scenario: str | os.PathLike[str] | Scenario,
    runs: int,
    draws: Mapping[str, Draw] | None = None,
    channels: Sequence[str] = (),
    dt_s: float = 0.1,
    out: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
    seed: int | None = None,
    progress: Callable[[int, int], None] | bool = True,
) -> Path:
    """Fly `runs` flights of a scenario into the folder `out`, and return it.

    out/runs-*.parquet has one row a run: run, seed, every draw, flown_s, diverged. out/data-*.parquet has,
    where channels are given, run, t_s and a column a channel, on one clock of period dt_s as `core.bind`
    gives it (means over dt_s of faster channels); "truth.<name>" is a true value. out/dataset.json says
    what was asked.

    Parts of 16 runs are written beside and renamed: started again with the same arguments after an
    interruption, only the missing parts are flown. jobs: threads, all cores unless given. progress: True
    for a bar on the terminal, or a function of (done, total). The numbers do not depend on jobs. Raises
    WrongUse where the folder holds another dataset.
    """
    s = as_scenario(scenario)
    base = s.seed if seed is None else seed
    folder = Path(out) if out is not None else Path(f"{s.name}_{runs}")
    asked = _description(s, runs, draws or {}, channels, dt_s, base)
    _claim(folder, asked)
    parts = [range(i, min(i + BATCH, runs)) for i in range(0, runs, BATCH)]
    missing = [p for p in parts if not _part(folder, "runs", p.start).exists()]
    truth = any(c.startswith("truth.") for c in channels)
    work = _worker(s, draws or {}, base, truth)
    say = _progress(progress, runs)
    done = runs - sum(len(p) for p in missing)
    say(done)

    def one(run: int) -> tuple[dict[str, float], dict[str, Array]]:
        flight = work(run)
        row = {"run": run, "seed": base, **flight.meta.get("draws", {})}
        row |= {"flown_s": flight.duration_s, "diverged": bool(flight.meta["diverged"])}
        return row, _columns(flight, channels, dt_s)

    try:
        runner = _ahead(one, [r for p in missing for r in p], jobs or os.cpu_count() or 1)
        for part in missing:
            found = []
            for _ in part:
                found.append(next(runner)[1])
                done += 1
                say(done)
            _write(folder, part.start, found)
    finally:
        say(-1)
    return folder


def _columns(flight: Flight, channels: Sequence[str], dt_s: float) -> dict[str, Array]:
    """Channels on one clock."""
    if not channels:
        return {}
    table = dict(flight.measured)
    table |= {f"truth.{n}": v for n, v in flight.truth.items()}
    missing = [c for c in channels if c not in table]
    if missing:
        raise MissingChannel(
            f"channels {', '.join(missing)} are not in this flight; it has {', '.join(sorted(table))}"
        )
    units = tuple(table[c].unit for c in channels)
    sample = bind(Flight(table), Channels(tuple(channels), units), dt_s, 0.0, who="fly_many")
    return {"t_s": sample.t_s, **{c: sample.z[:, i] for i, c in enumerate(channels)}}


def _description(
    s: Scenario, runs: int, draws: Mapping[str, Draw], channels: Sequence[str], dt_s: float, seed: int
) -> dict[str, Any]:
    said = {
        k: {"kind": type(d).__name__, **d._asdict()}
        if isinstance(d, Normal | Uniform)
        else [float(x) for x in d]
        for k, d in draws.items()
    }
    for path, d in said.items():
        if isinstance(d, list) and len(d) != runs:
            raise WrongUse(f"draw {path!r} has {len(d)} values for {runs} runs")
    return {
        "scenario": s.name,
        "scenario_hash": hashlib.sha256(repr(replace(s, path=None)).encode()).hexdigest(),
        "seed": seed,
        "runs": runs,
        "draws": said,
        "channels": list(channels),
        "dt_s": dt_s,
        "version": __version__,
    }


def _claim(folder: Path, asked: dict[str, Any]) -> None:
    """The folder is new, or holds the same dataset (then it goes on)."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "dataset.json"
    if path.exists():
        held = json.loads(path.read_text(encoding="utf-8"))
        differs = [k for k in asked if held.get(k) != json.loads(json.dumps(asked[k]))]
        if differs:
            raise WrongUse(
                f"{folder} holds another dataset (differs in {', '.join(differs)}); choose another folder"
            )
        return
    if any(folder.glob("*.parquet")):
        raise WrongUse(f"{folder} holds Parquet files of something else; choose another folder")
    _replace(path, lambda p: p.write_text(json.dumps(asked, indent=1), encoding="utf-8"))


def _part(folder: Path, kind: str, first: int) -> Path:
    return folder / f"{kind}-{first:08d}.parquet"


def _replace(path: Path, write: Callable[[Path], Any]) -> None:
    """Write beside, then rename: whole or not there."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write(beside)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def _write(folder: Path, first: int, found: list[tuple[dict[str, float], dict[str, Array]]]) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    if found[0][1]:
        names = list(found[0][1])
        lengths = [len(columns["t_s"]) for _, columns in found]
        data = {"run": np.repeat([row["run"] for row, _ in found], lengths).astype(np.int64)}
        data |= {n: np.concatenate([columns[n] for _, columns in found]) for n in names}
        table = pa.table(data)
        _replace(_part(folder, "data", first), lambda p: parquet.write_table(table, p, compression="zstd"))
    # The summary comes last: a part counts as flown when it is there.
    summary = pa.Table.from_pylist([row for row, _ in found])
    _replace(_part(folder, "runs", first), lambda p: parquet.write_table(summary, p))


def _progress(progress: Callable[[int, int], None] | bool, total: int) -> Callable[[int], None]:
    """say(done), say(-1) at the end."""
    if callable(progress):
        return lambda done: progress(done, total) if done >= 0 else None
    if not progress:
        return lambda done: None
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    bar = Progress("flying", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), transient=True)
    bar.start()
    task = bar.add_task("flying", total=total)
    return lambda done: bar.stop() if done < 0 else bar.update(task, completed=done)
