"""Reader of the ALFA folder layout: one CSV per ROS topic, named after the sequence and the topic."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .log import Log, Table, Topics, ordered, read_bytes, unreadable, wants
from .table_files import parse_csv

CLOCK = "0 at the earliest stamp of all topics"


def topic_of(file: Path, folder: Path) -> str:
    """'<sequence>-mavros-imu-data_raw.csv' -> 'mavros/imu/data_raw'."""
    stem = file.name.removesuffix(".csv").removeprefix(f"{folder.name}-")
    for known in ("mavros-", "mavctrl-", "failure_status-", "diagnostics"):
        at = stem.find(known)
        if at >= 0:
            stem = stem[at:]
            break
    # mavros names its topics rc/out and nav_info/roll; ROS itself writes no dash in a name.
    return stem.replace("-", "/")


def field_of(column: str) -> str:
    return re.sub(r"^field\.", "", column)


def is_alfa(folder: Path) -> bool:
    return any(folder.glob("*-mavros-*.csv"))


def read_alfa(path: Path, topics: Topics) -> Log:
    """An ALFA sequence folder. Stamps are the recorder's (%time), 0 at the earliest one of all topics."""
    files = {topic_of(file, path): file for file in sorted(path.glob("*.csv"))}
    if not any(topic.startswith("mavros/") for topic in files):
        raise unreadable(path, "holds no '<sequence>-mavros-<topic>.csv' files, so it is not an ALFA folder")
    raw: dict[str, tuple[NDArray[np.int64], dict[str, NDArray[Any]]]] = {}
    notes: list[str] = []
    for topic, file in files.items():
        columns = {k: v for k, v in parse_csv(file, read_bytes(file)).items()}
        stamps = columns.pop("%time", None)
        if stamps is None:
            notes.append(f"{file.name} has no %time column and is left out")
            continue
        if len(stamps):
            keep = (
                np.isfinite(stamps.astype(float))
                if stamps.dtype.kind in "fi"
                else np.zeros(len(stamps), bool)
            )
            raw[topic] = (stamps[keep].astype(np.int64), {field_of(k): v[keep] for k, v in columns.items()})
    start = min((int(s.min()) for s, _ in raw.values() if len(s)), default=None)
    if start is None:
        raise unreadable(path, "not one of its files has stamped rows")
    tables: dict[str, Table] = {}
    for topic, (stamps, columns) in raw.items():
        if wants(topics, topic):
            tables[topic] = ordered((stamps - start).astype(float) * 1e-9, columns)
    info = {"start_unix_s": start * 1e-9}
    seen = {topic: len(stamps) for topic, (stamps, _) in raw.items()}
    return Log("alfa", tables, CLOCK, info=info, seen=seen, notes=notes)
