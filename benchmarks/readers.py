"""MB/s of every reader on the real logs, next to what the format's own library takes to hand over the same file.

    AEROFDI_DATA=... python -m benchmarks.readers [--json]

Medians of interleaved runs, file cache warm. A peer only parses; ours also translates into a Flight.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from aerofdi import records
from aerofdi.core import Flight, Series

Timed = Callable[[], Any]


def seconds(candidates: dict[str, Timed], rounds: int) -> dict[str, float]:
    """Median time of each candidate, s, the candidates taking turns."""
    taken: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, run in candidates.items():
            start = time.perf_counter()
            with contextlib.redirect_stdout(io.StringIO()):
                run()
            taken[name].append(time.perf_counter() - start)
    return {name: statistics.median(times) for name, times in taken.items()}


def _drain(make: Callable[[], Any], method: str) -> None:
    reader = make()
    while getattr(reader, method)() is not None:
        pass
    reader.close()


def _dfreader(path: Path) -> Timed:
    from pymavlink import DFReader

    return lambda: _drain(lambda: DFReader.DFReader_binary(str(path)), "recv_msg")


def _mavutil(path: Path) -> Timed:
    from pymavlink import mavutil

    return lambda: _drain(lambda: mavutil.mavlink_connection(str(path)), "recv_msg")


def _pyulog(path: Path) -> Timed:
    from pyulog import ULog

    def run() -> None:
        with path.open("rb") as file:
            ULog(file)

    return run


def _rosbags(path: Path) -> Timed:
    from rosbags.highlevel import AnyReader

    def run() -> None:
        with AnyReader([path]) as bag:
            for connection, _, raw in bag.messages():
                bag.deserialize(raw, connection.msgtype)

    return run


def _loadmat(path: Path) -> Timed:
    from scipy.io import loadmat

    return lambda: loadmat(path, squeeze_me=True, struct_as_record=False)


def cases(root: Path, scratch: Path) -> dict[str, tuple[Path, dict[str, Timed]]]:
    """Reader -> (file, peers)."""
    found: dict[str, tuple[Path, dict[str, Timed]]] = {}

    def add(name: str, pattern: str, **peers: Callable[[Path], Timed]) -> None:
        path = next(iter(sorted(root.glob(pattern))), None)
        if path is not None:
            found[name] = (path, {peer: make(path) for peer, make in peers.items()})

    add("dataflash", "arduplane_sitl/right*.BIN", pymavlink=_dfreader)
    add("tlog", "arduplane_sitl/right*.tlog", pymavlink=_mavutil)
    add("ulog", "formats/sample.ulg", pyulog=_pyulog)
    add("rosbag", "alfa/*/*.bag", rosbags=_rosbags)
    add("mat", "umn_thor_flt75/*.mat", scipy=_loadmat)
    add("paparazzi", "enac_elevon_2017/*.data")
    add("csv.gz", "enac_daredevil_2020/*.csv.gz")
    add("alfa", "alfa/*22_2*")
    t = np.arange(0.0, 3600.0, 0.01)
    rng = np.random.default_rng(1)
    hour = Flight({f"reference.{k}": Series(t, rng.normal(size=len(t)).round(4), "rad/s") for k in "pqr"})
    found["flight file (1 h, 100 Hz)"] = (records.write_flight(hour, scratch / "hour.parquet"), {})
    return found


def size_of(path: Path) -> int:
    return sum(f.stat().st_size for f in path.iterdir()) if path.is_dir() else path.stat().st_size


def run(rounds: int = 5) -> dict[str, Any]:
    """{reader: {ours, unit, peers, conditions}} in MB/s."""
    root = Path(os.environ.get("AEROFDI_DATA", "")) / "flights"
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name, (path, peers) in cases(root, Path(scratch)).items():
            size = size_of(path) / 1e6
            took = seconds({"ours": lambda path=path: records.read(path), **peers}, rounds)
            out[f"reader {name}"] = {
                "ours": size / took["ours"],
                "unit": "MB/s",
                "peers": {
                    k: {"value": size / s, "ratio": s / took["ours"]} for k, s in took.items() if k != "ours"
                },
                "conditions": f"{size:.1f} MB, {took['ours']:.3f} s, median of {rounds}, warm cache",
            }
    return out


def main() -> None:
    found = run()
    if "--json" in sys.argv:
        print(json.dumps(found, indent=1))
        return
    for name, row in found.items():
        peers = ", ".join(f"{k} {p['value']:.1f} ({p['ratio']:.1f} x)" for k, p in row["peers"].items())
        print(f"{name:34s} {row['ours']:8.1f} {row['unit']}   {row['conditions']}   {peers}")


if __name__ == "__main__":
    main()
