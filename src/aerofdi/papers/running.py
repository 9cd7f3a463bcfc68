"""Running the items of a paper: each is a module of its folder with `find(quick, progress) -> Findings`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from .claims import Findings, Ours


def run_items(
    package: str | None,
    modules: Mapping[str, str],
    only_when_asked: Sequence[str],
    item: str | None,
    quick: bool,
    progress: Callable[[str, float], None],
) -> Findings:
    """One item, or all but those that write files.

    package: the folder of the paper. modules: item -> module in it. progress(text, share): share from 0 to 1.
    """
    wanted = [item] if item else [i for i in modules if i not in only_when_asked]
    ours: dict[str, Ours] = {}
    tables: dict[str, Any] = {}
    for k, name in enumerate(wanted):

        def say(text: str, share: float, done: int = k) -> None:
            progress(text, (done + share) / len(wanted))

        found = import_module(f"{package}.{modules[name]}").find(quick, say)
        ours |= found.ours
        tables |= found.tables
    return Findings(ours, tables)
