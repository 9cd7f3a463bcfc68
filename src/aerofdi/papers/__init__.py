"""Reproducing papers: what each states, what we find, judged claim by claim. See README.md of this room."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from ..core import WrongUse
from .claims import Expected, Findings, Ours, judge, load_expected

__all__ = [
    "Expected",
    "Findings",
    "Ours",
    "Progress",
    "folder",
    "items",
    "judge",
    "load_expected",
    "names",
    "reproduce",
]

Progress = Callable[[str, float], None]


def _silent(text: str, share: float) -> None:
    del text, share


def names() -> list[str]:
    """The papers there are, by the names of their folders."""
    return sorted(p.parent.name for p in Path(__file__).parent.glob("*/expected.csv"))


def folder(name: str) -> Path:
    """The folder of a paper; an unknown name is refused with the known ones."""
    if name not in names():
        raise WrongUse(f"no paper is called {name!r}; there are {', '.join(names())}")
    return Path(__file__).parent / name


def items(name: str) -> tuple[str, ...]:
    """What `item` may be for this paper."""
    folder(name)
    return tuple(import_module(f"{__name__}.{name}.reproduce").ITEMS)


def reproduce(
    name: str, item: str | None = None, quick: bool = False, progress: Progress | None = None
) -> dict[str, Any]:
    """Run the experiments of a paper and judge its claims.

    name: a folder of this room. item: one table, figure or group of claims (None: all). quick: a smaller run
    under a minute, the same claims. progress(text, share): called now and then, share from 0 to 1.

    Returns {"paper", "quick", "seconds", "claims": [{"id", "where", "claim", "paper", "ours", "ci", "unit",
    "tolerance", "status", "reason"}], "tables": {...}}; status is reproduced, not_reproduced or
    not_reproducible.
    """
    expected = load_expected(folder(name) / "expected.csv")
    if item is not None and item not in items(name):
        raise WrongUse(f"paper {name} has no item {item!r}; it has {', '.join(items(name))}")
    began = time.perf_counter()
    found: Findings = import_module(f"{__name__}.{name}.reproduce").run(item, quick, progress or _silent)
    unknown = set(found.ours) - {e.id for e in expected}
    if unknown:
        raise WrongUse(
            f"paper {name}: values were found for {', '.join(sorted(unknown))}, not in expected.csv"
        )
    wanted = [e for e in expected if item is None or e.item == item]
    claims = [judge(e, found.ours.get(e.id)) for e in wanted]
    seconds = time.perf_counter() - began
    return {"paper": name, "quick": quick, "seconds": seconds, "claims": claims, "tables": dict(found.tables)}
