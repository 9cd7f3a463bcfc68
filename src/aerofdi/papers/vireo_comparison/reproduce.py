"""What `aerofdi paper vireo_comparison` runs: each item is a module of this folder with `find(quick, progress)`."""

from __future__ import annotations

from collections.abc import Callable

from ..claims import Findings
from ..running import run_items

MODULES = {
    "table4": "table4",
    "states": "states",
    "requirements": "limits",
    "filters": "filters",
    "monte_carlo": "monte_carlo",
    "figures": "figures",
    "filter_figures": "filter_figures",
}
ITEMS = tuple(MODULES)
ONLY_WHEN_ASKED = ("figures", "filter_figures")


def run(item: str | None, quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """One item, or all but those that write files."""
    return run_items(__package__, MODULES, ONLY_WHEN_ASKED, item, quick, progress)
