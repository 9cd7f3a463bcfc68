"""What a word on the command line stands for: an aircraft, a scenario, a design or a flight record."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

from ..aircraft import Aircraft, aircraft_names, load_aircraft
from ..core.errors import UnreadableFile, WrongUse
from ..core.types import Design, Flight
from ..records import describe, read
from ..scenarios import Scenario, load_scenario, scenario_names
from .capability import capability


def find(target: str, profile: str | None = None) -> Aircraft | Scenario | Design | Flight:
    """Load what `target` names: a file, else an aircraft or scenario of the package.

    Raises UnreadableFile or WrongUse, for a name that is neither with what there is.
    """
    path = Path(target)
    if path.exists():
        return _toml(path) if path.suffix == ".toml" else read(path, profile)
    if target in aircraft_names():
        return load_aircraft(target)
    if target in scenario_names():
        return load_scenario(target)
    raise WrongUse(
        f"{target!r} is no file, aircraft or scenario; aircraft are {', '.join(aircraft_names())}; "
        f"scenarios are {', '.join(scenario_names())}"
    )


def _toml(path: Path) -> Aircraft | Scenario | Design:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UnreadableFile(
            f"{path}: not valid TOML ({error}); give an aircraft, a scenario or a design"
        ) from None
    if document.get("kind") in ("full", "identified"):
        return load_aircraft(path)
    if "method" in document:
        from ..design.io import load_design

        return load_design(path)
    if "aircraft" in document:
        return load_scenario(path)
    raise WrongUse(
        f"{path}: neither an aircraft (kind = ...), nor a scenario (aircraft = ...), nor a design (method = ...); "
        f"it has {', '.join(document) or 'nothing'}"
    )


def told(thing: Aircraft | Scenario | Design | Flight) -> dict[str, Any]:
    """The machine-readable form of what was found: {"kind": "flight" | "aircraft" | "scenario" | "design", ...}."""
    if isinstance(thing, Flight):
        return {"kind": "flight", **describe(thing), "diagnosers": capability(thing)}
    if isinstance(thing, Aircraft):
        if thing.identified is not None:
            return {"kind": "aircraft", **thing.identified._asdict()}
        return {
            "kind": "aircraft",
            "name": thing.name,
            "title": thing.title,
            "surfaces": [s._asdict() for s in thing.surfaces],
            "sensors": [s._asdict() for s in thing.sensors.values()],
            "numbers": {path: n._asdict() for path, n in thing.numbers.items()},
            "sources": dict(thing.sources),
        }
    if isinstance(thing, Scenario):
        return {"kind": "scenario", **{f.name: getattr(thing, f.name) for f in dataclasses.fields(thing)}}
    return {"kind": "design", **thing._asdict()}
