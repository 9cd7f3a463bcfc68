"""What `aerofdi paper vireo_comparison` runs: each item is a module of this folder with `find(quick, progress)`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..claims import Findings, Ours

ITEMS = ("table4", "states", "requirements", "filters", "monte_carlo", "figures", "filter_figures")
MODULES = {"requirements": "limits"}
ONLY_WHEN_ASKED = ("figures", "filter_figures")


def run(item: str | None, quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """One item, or all but those that write files."""
    wanted = [item] if item else [i for i in ITEMS if i not in ONLY_WHEN_ASKED]
    ours: dict[str, Ours] = {}
    tables: dict[str, Any] = {}
    for k, name in enumerate(wanted):

        def say(text: str, share: float, done: int = k) -> None:
            progress(text, (done + share) / len(wanted))

        found = import_module(f"{__package__}.{MODULES.get(name, name)}").find(quick, say)
        ours |= found.ours
        tables |= found.tables
    return Findings(ours, tables)
