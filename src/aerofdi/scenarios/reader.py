"""Taking keys with units out of a TOML table; what is left over, or in a wrong unit, is refused with its
line.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from ..aircraft.lines import Path_
from ..aircraft.units import ACCEPTED
from ..core.errors import WrongUse
from ..core.types import Array

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_PER_TIME = {"/s": 1.0, "/min": 1.0 / 60.0, "/sqrt(s)": 1.0}
_ALIAS = {"m/s2": "m/s^2"}


def factor(given: str, si_unit: str) -> float | None:
    """What turns a number in unit `given` into `si_unit`; None where it cannot.

    A unit per time ("deg/s/s", "m/min", "rad/sqrt(s)") is accepted where si_unit ends so.

    >>> factor("deg", "rad"), factor("kg", "rad")
    (0.017453292519943295, None)
    """
    base = _ALIAS.get(si_unit, si_unit)
    if base in ACCEPTED:
        return ACCEPTED[base].get(_ALIAS.get(given, given))
    for ending, scale in _PER_TIME.items():
        for own, own_scale in _PER_TIME.items():
            same_kind = (ending == "/sqrt(s)") == (own == "/sqrt(s)")
            if si_unit.endswith(own) and given.endswith(ending) and same_kind:
                inner = factor(given.removesuffix(ending), si_unit.removesuffix(own))
                if inner is not None:
                    return inner * scale / own_scale
    return None


def accepted(si_unit: str) -> str:
    """The spellings of a unit, for messages."""
    return ", ".join(ACCEPTED.get(_ALIAS.get(si_unit, si_unit), {si_unit: 1.0}))


class Table:
    """One table of the file: take what is known, then `end()` refuses what is left."""

    def __init__(self, path: Path, lines: dict[Path_, int], values: Any, at: Path_ = ()):
        self.path, self.lines, self.at = path, lines, at
        if not isinstance(values, dict):
            raise self.refuse("", f"[{self.name}] must be a table, got {values!r}")
        self.values = dict(values)
        self.known: list[str] = []

    @property
    def name(self) -> str:
        return ".".join(str(p) for p in self.at)

    def refuse(self, key: str, message: str) -> WrongUse:
        """The error, with file and line of the key or of what holds it."""
        at = (*self.at, key) if key else self.at
        while at and at not in self.lines:
            at = at[:-1]
        return WrongUse(f"{self.path}, line {self.lines.get(at, 1)}: {message}")

    def has(self, key: str) -> bool:
        return key in self.values

    def _take(self, key: str, default: Any, form: str) -> Any:
        self.known.append(key)
        if key in self.values:
            return self.values.pop(key)
        if default is None:
            where = f"[{self.name}]" if self.at else "the file"
            raise self.refuse("", f"{where} misses {key!r}, which is {form}")
        return default

    def number(
        self,
        key: str,
        unit: str,
        default: float | None = None,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float:
        """A number in SI: "15.4 m/s", { v = 15.4, unit = "m/s" }, or bare where the unit is 1."""
        example = '"0.5" or 0.5' if unit == "1" else f'"<number> {accepted(unit).split(", ")[0]}"'
        entry = self._take(key, default, f"a number with unit, as {example}")
        if default is not None and entry is default:
            return default
        value = self._convert(key, entry, unit)
        if np.ndim(value) != 0:
            raise self.refuse(key, f"{key!r} must be one number, got {entry!r}")
        if not low <= value <= high:
            raise self.refuse(key, f"{key!r} must be within {low:g} and {high:g} {unit}, got {entry!r}")
        return float(value)

    def numbers(self, key: str, unit: str, default: Any = None, rank: int = 1, size: int = 0) -> Array:
        """A list (rank 1) or table (rank 2) of numbers in SI: { v = [...], unit = "m" }."""
        entry = self._take(key, default, f'{{ v = [...], unit = "{unit}" }}')
        if entry is default:
            return np.asarray(entry, float)
        value = np.asarray(self._convert(key, entry, unit), float)
        if value.ndim != rank or (size and value.shape[-1] != size):
            shape = (
                "",
                f"a list{f' of {size}' if size else ''}",
                f"a list of lists{f' of {size}' if size else ''}",
            )
            raise self.refuse(key, f"{key!r} must be {shape[rank]} numbers, got {entry!r}")
        return value

    def _convert(self, key: str, entry: Any, unit: str) -> Any:
        if isinstance(entry, dict) and set(entry) == {"v", "unit"}:
            value, given = entry["v"], entry["unit"]
        elif isinstance(entry, str) and (match := _QUANTITY.fullmatch(entry)):
            value, given = float(match.group(1)), match.group(2) or "1"
        elif unit == "1" and isinstance(entry, int | float | list) and not isinstance(entry, bool):
            value, given = entry, "1"
        else:
            raise self.refuse(
                key,
                f"{key!r} needs a number and its unit, "
                f'as "3 {unit}" or {{ v = 3, unit = "{unit}" }}, got {entry!r}',
            )
        scale = factor(str(given), unit)
        if scale is None:
            raise self.refuse(key, f"{key!r} is in {given!r}; accepted: {accepted(unit)}")
        try:
            array = np.asarray(value, float) * scale
        except (TypeError, ValueError):
            raise self.refuse(key, f"{key!r} must hold numbers, got {value!r}") from None
        if not np.isfinite(array).all():
            raise self.refuse(key, f"{key!r} must be finite, got {value!r}")
        return array

    def integer(self, key: str, default: int | None = None, low: int = 0) -> int:
        value = self._take(key, default, "a whole number")
        if isinstance(value, bool) or not isinstance(value, int) or value < low:
            raise self.refuse(key, f"{key!r} must be a whole number from {low}, got {value!r}")
        return value

    def flag(self, key: str, default: bool | None = None) -> bool:
        value = self._take(key, default, "true or false")
        if not isinstance(value, bool):
            raise self.refuse(key, f"{key!r} must be true or false, got {value!r}")
        return value

    def word(self, key: str, choices: tuple[str, ...] = (), default: str | None = None) -> str:
        """A text, one of `choices` where given."""
        value = self._take(key, default, f"one of {', '.join(choices)}" if choices else "a text")
        if not isinstance(value, str) or (choices and value not in choices and value != default):
            known = f"; accepted: {', '.join(choices)}" if choices else ""
            raise self.refuse(key, f"{key!r} is {value!r}{known}")
        return value

    def table(self, key: str) -> Table:
        """The table below `key`, empty where there is none."""
        return Table(self.path, self.lines, self._take(key, {}, "a table"), (*self.at, key))

    def rows(self, key: str) -> list[Table]:
        """The entries of [[key]]."""
        entries = self._take(key, [], "a list of tables")
        if not isinstance(entries, list):
            raise self.refuse(key, f"write [[{key}]], there may be several")
        return [Table(self.path, self.lines, e, (*self.at, key, i)) for i, e in enumerate(entries)]

    def names(self) -> list[str]:
        """The keys that are left, in the order of the file."""
        return list(self.values)

    def end(self) -> None:
        """Refuse what nobody took."""
        for key in self.values:
            where = f" in [{self.name}]" if self.at else ""
            raise self.refuse(key, f"unknown key {key!r}{where}; known: {', '.join(sorted(set(self.known)))}")
