"""Designs as files: x.toml (what was asked, the proof, names and shapes) and x.npz (the arrays) beside it."""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core import Design, UnreadableFile, WrongUse

FORMAT = 1


def _plain(value: Any, where: str) -> Any:
    """Numbers, strings, lists and tables as TOML knows them; anything else is refused by name."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v, f"{where}.{k}") for k, v in value.items() if v is not None}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), where)
    if isinstance(value, list | tuple):
        return [_plain(v, where) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item(), where)
    if isinstance(value, bool | int | float | str):
        return value
    raise WrongUse(
        f"{where} of a design is {type(value).__name__}; accepted: numbers, strings, lists and tables of them"
    )


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 over names, shapes and values, so that a TOML file and a foreign npz are never taken for a
    pair.
    """
    h = hashlib.sha256()
    for name in sorted(arrays):
        a = np.ascontiguousarray(arrays[name])
        h.update(f"{name}{a.dtype.str}{a.shape}".encode())
        h.update(a.tobytes())
    return h.hexdigest()


def _write(path: Path, put: Any) -> None:
    """Written beside and renamed, so that a crash never leaves half a file under the name."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with beside.open("wb") as file:
            put(file)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def save_design(design: Design, path: str | Path) -> Path:
    """Write path (.toml) and the .npz of the same stem; returns the path of the TOML file.

    params must be arrays of numbers; spec and certificate numbers, strings, lists and tables.
    """
    import tomli_w

    target = Path(path)
    if target.suffix != ".toml":
        raise WrongUse(f"a design is saved as .toml (with its .npz beside it); given {target.name!r}")
    arrays = {k: np.asarray(v) for k, v in design.params.items()}
    wrong = [k for k, a in arrays.items() if a.dtype.kind not in "fiub"]
    if wrong:
        raise WrongUse(f"parameters {', '.join(wrong)} of the design are not arrays of numbers")
    table = {
        "format": FORMAT,
        "method": design.method,
        "aircraft_hash": design.aircraft_hash,
        "arrays_sha256": _digest(arrays),
        "spec": _plain(design.spec, "spec"),
        "certificate": _plain(design.certificate, "certificate"),
        "arrays": {k: {"shape": list(a.shape), "dtype": a.dtype.name} for k, a in arrays.items()},
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    _write(target.with_suffix(".npz"), lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    _write(target, lambda file: tomli_w.dump(table, file))
    return target


def load_design(path: str | Path) -> Design:
    """Read what `save_design` wrote; refuses foreign, damaged or mismatched files with the reason."""
    source = Path(path)
    try:
        with source.open("rb") as file:
            table = tomllib.load(file)
        with source.with_suffix(".npz").open("rb") as file, np.load(file, allow_pickle=False) as z:
            arrays = {k: z[k] for k in z.files}
    except Exception as error:
        raise UnreadableFile(
            f"{source}: not a design: {error}; it takes a .toml file and the .npz file of the same name beside it"
        ) from error
    missing = [k for k in ("format", "method", "arrays_sha256", "spec", "certificate") if k not in table]
    if missing or table["format"] != FORMAT:
        raise UnreadableFile(
            f"{source}: not a design of format {FORMAT}"
            f"{' (no ' + ', '.join(missing) + ')' if missing else ''}; make it again with `aerofdi design`"
        )
    if _digest(arrays) != table["arrays_sha256"]:
        raise UnreadableFile(
            f"{source}: its arrays are not those of {source.with_suffix('.npz').name}; "
            f"make both again with `aerofdi design`"
        )
    return Design(
        table["method"], table["spec"], table.get("aircraft_hash", ""), arrays, table["certificate"]
    )
