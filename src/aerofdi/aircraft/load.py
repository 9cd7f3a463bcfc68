"""Read an aircraft file: every number checked against the schema, every refusal with its line."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import WrongUse
from .identified import parse_identified
from .lines import Path_, read_toml
from .physics import physical_fault
from .schema import (
    AERO,
    COMMANDS,
    CONTROL,
    ICING_CONTROL,
    OPTIONAL_AERO,
    OPTIONAL_SECTIONS,
    PROPULSION,
    SECTIONS,
    SENSOR_UNITS,
    SURFACE,
    TABLE_INPUTS,
    Choice,
    Item,
    Section,
)
from .types import Aircraft, Number, Sensor, Surface
from .units import ACCEPTED
from .windtunnel import read_tables

FORMAT = 1
HOME = Path(__file__).parent
MAX_SURFACES = 8


def aircraft_names() -> tuple[str, ...]:
    """The aircraft that come with the package."""
    return tuple(sorted(p.stem for p in HOME.glob("*.toml") if not p.stem.endswith("_windtunnel")))


def load_aircraft(name_or_path: str | os.PathLike[str]) -> Aircraft:
    """The aircraft of that name, or in that file.

    Raises UnreadableFile (missing, not TOML) or WrongUse (unknown key, wrong unit, missing number, non-physical
    value), with file and line.

    >>> load_aircraft("vireo").number("mass.mass")
    1.28
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        if str(name_or_path) not in aircraft_names():
            raise WrongUse(
                f"aircraft {str(name_or_path)!r} is not known; known are {', '.join(aircraft_names())}; "
                f"or give the path of a .toml file"
            )
        path = HOME / f"{name_or_path}.toml"
    document, lines = read_toml(path)
    return _Reader(path, document, lines).aircraft()


def hash(aircraft: Aircraft) -> str:
    """A digest of everything in the file that decides how it flies; notes and sources do not count."""
    if aircraft.identified is not None:
        return hashlib.sha256(aircraft.path.read_bytes()).hexdigest()
    text = [f"{k}={v}" for k, v in sorted(aircraft.settings.items()) if k != "title"]
    text += [f"{k}={np.asarray(n.value).tolist()!r}" for k, n in sorted(aircraft.numbers.items())]
    text += [f"{k}={v.tolist()!r}" for k, v in sorted(aircraft.tables.items())]
    text += sorted(_values("autopilot", aircraft.autopilot))
    return hashlib.sha256("\n".join(text).encode()).hexdigest()


def _values(at: str, entry: Any) -> Iterator[str]:
    """Every value below an entry of the autopilot table, without notes and sources."""
    if isinstance(entry, Mapping) and "v" not in entry:
        for key, value in entry.items():
            yield from _values(f"{at}.{key}", value)
    else:
        yield f"{at}={(entry['v'], entry.get('unit')) if isinstance(entry, Mapping) else entry!r}"


class _Reader:
    """Walks one document; collects numbers and settings."""

    def __init__(self, path: Path, document: dict[str, Any], lines: dict[Path_, int]):
        self.path, self.document, self.lines = path, document, lines
        self.numbers: dict[str, Number] = {}
        self.settings: dict[str, str] = {}
        self.sources: dict[str, str] = {}

    def refuse(self, at: Path_, message: str) -> WrongUse:
        """The error, with the line of the nearest key that is there."""
        while at and at not in self.lines:
            at = at[:-1]
        return WrongUse(f"{self.path}, line {self.lines.get(at, 1)}: {message}")

    def aircraft(self) -> Aircraft:
        kind = self.document.get("kind")
        if kind == "identified":
            return self._identified()
        if kind != "full":
            raise self.refuse(("kind",), f"kind is {kind!r}; accepted: 'full', 'identified'")
        if self.document.get("format") != FORMAT:
            raise self.refuse(
                ("format",), f"format is {self.document.get('format')!r}; this version reads {FORMAT}"
            )
        allowed = {
            "format",
            "kind",
            "name",
            "title",
            "sources",
            "aero",
            "propulsion",
            "surface",
            "sensor",
            "autopilot",
        }
        self.only(self.document, (), allowed | {s for s in SECTIONS if "." not in s})
        name, title = (self.word(self.document, (), k, Choice()) for k in ("name", "title"))
        self._sources()
        for section, spec in SECTIONS.items():
            self.section(section, spec, section not in OPTIONAL_SECTIONS, subtables=("full",))
        inputs = self._aero()
        self._propulsion()
        surfaces = tuple(self._surfaces(inputs))
        fault = physical_fault(self.numbers, self.settings)
        if fault:
            raise self.refuse(*fault)
        tables = {}
        if self.settings["aero.kind"] == "tables":
            tables = read_tables(self.path.parent / self.settings["aero.file"])
        return Aircraft(
            name,
            title,
            "full",
            self.path,
            self.sources,
            self.numbers,
            self.settings,
            surfaces,
            self._sensors(),
            tables,
            self._autopilot(),
        )

    def _identified(self) -> Aircraft:
        try:
            model = parse_identified(self.document)
        except (KeyError, TypeError, ValueError) as error:
            raise WrongUse(
                f"{self.path}: not a complete identified aircraft ({type(error).__name__}: {error}); "
                f"make it again with `aerofdi identify`"
            ) from None
        return Aircraft(
            model.name, f"identified from flights: {model.name}", "identified", self.path, identified=model
        )

    def only(self, table: dict[str, Any], at: Path_, allowed: Iterable[str]) -> None:
        """Refuse keys the schema does not know."""
        known = sorted(allowed)
        for key in table:
            if key not in known:
                where = ".".join(str(p) for p in at)
                raise self.refuse(
                    (*at, key),
                    f"unknown key {key!r}{f' in [{where}]' if where else ''}; known: {', '.join(known)}",
                )

    def _sources(self) -> None:
        sources = self.table("sources")
        for key, text in sources.items():
            if not isinstance(text, str) or not text:
                raise self.refuse(
                    ("sources", key), f"source {key!r} must be a text that names where numbers come from"
                )
        self.sources = sources

    def table(self, dotted: str, required: bool = True) -> dict[str, Any]:
        """The table at a dotted path, empty where it may be missing."""
        found: Any = self.document
        at: Path_ = ()
        for part in dotted.split("."):
            at = (*at, part)
            found = found.get(part) if isinstance(found, dict) else None
            if found is None:
                if required:
                    raise self.refuse(at[:-1], f"the section [{dotted}] is missing")
                return {}
        if not isinstance(found, dict):
            raise self.refuse(at, f"[{dotted}] must be a table")
        return found

    def section(
        self, dotted: str, spec: Section, required: bool = True, subtables: tuple[str, ...] = ()
    ) -> None:
        """Read every key of a section into numbers and settings."""
        table = self.table(dotted, required)
        if table or required:
            self.entries(table, tuple(dotted.split(".")), spec, dotted, subtables)

    def entries(
        self, table: dict[str, Any], at: Path_, spec: Section, prefix: str, subtables: tuple[str, ...] = ()
    ) -> None:
        """Read the entries of one table; `prefix` is where they go in numbers and settings."""
        self.only(table, at, (*spec, *subtables))
        for key, item in spec.items():
            if key not in table:
                if item.required:
                    unit = f" ({item.unit})" if isinstance(item, Item) else ""
                    raise self.refuse(at, f"[{'.'.join(str(p) for p in at)}] misses {key!r}{unit}")
                continue
            if isinstance(item, Choice):
                self.settings[f"{prefix}.{key}"] = self.word(table, at, key, item)
            else:
                self.numbers[f"{prefix}.{key}"] = self.read_number(table[key], (*at, key), item)

    def word(self, table: dict[str, Any], at: Path_, key: str, item: Choice) -> str:
        value = table.get(key)
        if not isinstance(value, str) or not value or (item.choices and value not in item.choices):
            accepted = ", ".join(repr(c) for c in item.choices) or "a text"
            raise self.refuse((*at, key), f"{key!r} is {value!r}; accepted: {accepted}")
        return value

    def read_number(self, entry: Any, at: Path_, item: Item) -> Number:
        """One `{ v, unit, src, assumed, note }` in SI."""
        name = ".".join(str(p) for p in at)
        form = f"{{ v = number, unit = {item.unit!r}, src = a key of [sources] }}"
        if not isinstance(entry, dict):
            raise self.refuse(at, f"{name} must be {form}, got {entry!r}")
        self.only(entry, at, ("v", "unit", "src", "assumed", "note"))
        for key in ("v", "unit", "src"):
            if key not in entry:
                raise self.refuse(at, f"{name} has no {key!r}; it must be {form}")
        factor = ACCEPTED[item.unit].get(entry["unit"])
        if factor is None:
            raise self.refuse(
                at, f"{name} is in {entry['unit']!r}; accepted: {', '.join(ACCEPTED[item.unit])}"
            )
        if entry["src"] not in self.sources:
            raise self.refuse(at, f"{name} has the source {entry['src']!r}, which [sources] does not list")
        assumed = entry.get("assumed", False)
        if not isinstance(assumed, bool):
            raise self.refuse(at, f"{name}: assumed must be true or false, got {assumed!r}")
        value = self.checked(entry["v"], at, name, item, factor)
        return Number(
            value,
            item.unit,
            entry["v"],
            entry["unit"],
            entry["src"],
            assumed,
            str(entry.get("note", "")),
            self.lines.get(at, 0),
        )

    def checked(self, v: Any, at: Path_, name: str, item: Item, factor: float) -> Any:
        shape = ("a number", "a list of numbers", "a table of numbers")[item.rank]
        try:
            array = np.array(v, dtype=float) * factor
        except (TypeError, ValueError):
            raise self.refuse(at, f"{name} must be {shape}, got {v!r}") from None
        if array.ndim != item.rank or isinstance(v, bool | str) or not np.isfinite(array).all():
            raise self.refuse(at, f"{name} must be {shape}, all finite, got {v!r}")
        if item.size and len(array) != item.size:
            raise self.refuse(at, f"{name} must have {item.size} values, got {len(array)}")
        low = array >= item.low if item.closed else array > item.low
        high = array <= item.high if item.closed else array < item.high
        if not (low & high).all():
            sign = "=" if item.closed else ""
            bounds = [f">{sign} {item.low:g}"] if math.isfinite(item.low) else []
            bounds += [f"<{sign} {item.high:g}"] if math.isfinite(item.high) else []
            raise self.refuse(at, f"{name} must be {' and '.join(bounds)} {item.unit}, got {v!r}")
        return float(array) if item.rank == 0 else array

    def _aero(self) -> tuple[str, ...]:
        """Aerodynamic sections; returns the inputs surfaces may feed."""
        kind = self.word(self.table("aero"), ("aero",), "kind", Choice(tuple(AERO)))
        names = {s.split(".")[1] for s in AERO[kind] if "." in s}
        if kind == "derivatives":
            names.add("control")
        for section, spec in AERO[kind].items():
            subtables = tuple(names) if section == "aero" else ("control",) if section == "aero.icing" else ()
            self.section(section, spec, section not in OPTIONAL_AERO, subtables)
        if kind == "tables":
            return TABLE_INPUTS
        inputs = tuple(self.table("aero.control"))
        for name in inputs:
            self.section(f"aero.control.{name}", CONTROL)
        for name in self.table("aero.icing.control", required=False):
            if name not in inputs:
                raise self.refuse(
                    ("aero", "icing", "control", name), f"icing of {name!r}, which is not in [aero.control]"
                )
            self.section(f"aero.icing.control.{name}", ICING_CONTROL)
        return inputs

    def _propulsion(self) -> None:
        kind = self.word(self.table("propulsion"), ("propulsion",), "kind", Choice(tuple(PROPULSION)))
        self.section("propulsion", {"kind": Choice(tuple(PROPULSION)), **PROPULSION[kind]})

    def _surfaces(self, inputs: tuple[str, ...]) -> Iterable[Surface]:
        entries = self.document.get("surface", [])
        if not isinstance(entries, list) or not 1 <= len(entries) <= MAX_SURFACES:
            raise self.refuse(("surface",), f"there must be one to {MAX_SURFACES} [[surface]] entries")
        seen: set[str] = set()
        for i, entry in enumerate(entries):
            at: Path_ = ("surface", i)
            name = self.word(entry, at, "name", SURFACE["name"])  # type: ignore[arg-type]
            if name in seen:
                raise self.refuse((*at, "name"), f"the surface {name!r} is there twice")
            seen.add(name)
            yield self._surface(entry, at, f"surface.{name}", name, inputs)

    def _surface(
        self, entry: dict[str, Any], at: Path_, prefix: str, name: str, inputs: tuple[str, ...]
    ) -> Surface:
        self.entries(entry, at, SURFACE, prefix, ("feeds", "command"))
        weights = {}
        for key, allowed in (("feeds", inputs), ("command", COMMANDS)):
            table = entry.get(key)
            if not isinstance(table, dict) or not table:
                raise self.refuse((*at, key), f"surface {name!r} needs {key}.<one of {', '.join(allowed)}>")
            self.only(table, (*at, key), allowed)
            for target, number in table.items():
                self.numbers[f"{prefix}.{key}.{target}"] = self.read_number(
                    number, (*at, key, target), Item("1")
                )
            weights[key] = {t: float(self.numbers[f"{prefix}.{key}.{t}"].value) for t in table}
        number = {
            k: float(self.numbers[f"{prefix}.{k}"].value) for k in SURFACE if f"{prefix}.{k}" in self.numbers
        }
        order = self.settings[f"{prefix}.actuator"]
        needs = {"none": (), "first_order": ("bandwidth",), "second_order": ("bandwidth", "damping")}[order]
        for key in needs:
            if key not in number:
                raise self.refuse(at, f"surface {name!r} with a {order} actuator misses {key!r}")
        if not number["min"] < number["max"]:
            raise self.refuse((*at, "min"), f"surface {name!r}: min must be below max")
        return Surface(
            name,
            self.settings[f"{prefix}.group"],
            self.settings[f"{prefix}.positive"],
            number["min"],
            number["max"],
            number.get("rate_limit", math.inf),
            order,
            number.get("bandwidth", math.inf),
            number.get("damping", 1.0),
            number.get("delay", 0.0),
            weights["feeds"],
            weights["command"],
        )

    def _sensors(self) -> dict[str, Sensor]:
        out = {}
        table = self.table("sensor", required=False)
        self.only(table, ("sensor",), SENSOR_UNITS)
        for channel in table:
            unit = SENSOR_UNITS[channel]
            self.section(
                f"sensor.{channel}", {"noise": Item(unit, low=0.0, closed=True), "rate": Item("Hz", low=0.0)}
            )
            noise, rate = (self.numbers[f"sensor.{channel}.{k}"].value for k in ("noise", "rate"))
            out[channel] = Sensor(channel, unit, noise, rate)
        return out

    def _autopilot(self) -> dict[str, Any]:
        """Kept as written; the autopilot room knows its gains. Sources are checked here."""
        table = self.table("autopilot", required=False)

        def check(entry: Any, at: Path_) -> None:
            if isinstance(entry, dict) and "v" in entry:
                if entry.get("src") not in self.sources:
                    raise self.refuse(
                        at, f"{'.'.join(map(str, at))}: src {entry.get('src')!r} is not in [sources]"
                    )
            elif isinstance(entry, dict):
                for key, value in entry.items():
                    check(value, (*at, key))

        check(table, ("autopilot",))
        return table
