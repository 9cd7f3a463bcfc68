"""What `aerofdi paper smac` runs: each item is a module of this folder with `find(quick, progress)`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..claims import Findings, Ours

ITEMS = ("still_air", "wind", "tuning", "banks", "load", "figures")
ONLY_WHEN_ASKED = ("figures",)


def run(item: str | None, quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """One item, or all but the one that writes files."""
    wanted = [item] if item else [i for i in ITEMS if i not in ONLY_WHEN_ASKED]
    ours: dict[str, Ours] = {}
    tables: dict[str, Any] = {}
    for k, name in enumerate(wanted):

        def say(text: str, share: float, done: int = k) -> None:
            progress(text, (done + share) / len(wanted))

        found = import_module(f"{__package__}.{name}").find(quick, say)
        ours |= found.ours
        tables |= found.tables
    return Findings(ours, tables)
