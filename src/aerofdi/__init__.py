"""aerofdi: find, isolate and measure faults of small unmanned aircraft from the signals they already have.

The rooms of the house are listed in the README; `import aerofdi` loads none of them, so it costs nothing.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "Flight": "core",
    "Series": "core",
    "Verdict": "core",
    "Hypothesis": "core",
    "Diagnoser": "core",
    "Status": "core",
    "bind": "core",
    "run": "core",
    "check_diagnoser": "core",
    "read": "records",
    "identify": "identify",
    "diagnose": "pipeline",
    "fly": "simulate",
    "fly_many": "simulate",
    "load_aircraft": "aircraft",
}
__all__ = ["__version__", *sorted(_PUBLIC)]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(f"aerofdi.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'aerofdi' has no attribute {name!r}; it has {', '.join(sorted(_PUBLIC))}")
