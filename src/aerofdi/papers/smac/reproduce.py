"""What `aerofdi paper smac` runs: each item is a module of this folder with `find(quick, progress)`."""

from __future__ import annotations

from collections.abc import Callable

from ..claims import Findings
from ..running import run_items

MODULES = {
    "still_air": "still_air",
    "wind": "wind",
    "tuning": "tuning",
    "banks": "banks",
    "load": "load",
    "figures": "figures",
}
ITEMS = tuple(MODULES)
ONLY_WHEN_ASKED = ("figures",)


def run(item: str | None, quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """One item, or all but those that write files."""
    return run_items(__package__, MODULES, ONLY_WHEN_ASKED, item, quick, progress)
