"""What a loaded aircraft is: numbers with their origin, surfaces, sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ..core.errors import WrongUse
from ..core.types import Array
from .identified import IdentifiedModel


class Number(NamedTuple):
    """One number of the file. value: float or array, in `si_unit`. given, unit: as the file has it."""

    value: Any
    si_unit: str
    given: Any
    unit: str
    source: str
    assumed: bool
    note: str
    line: int


# States of the actuator models an aircraft file may name.
ACTUATOR_ORDER = {"none": 0, "first_order": 1, "second_order": 2}


class Surface(NamedTuple):
    """One control surface.

    name, group as in the architecture of channel names. positive: what a positive deflection is, in words.
    lower, upper: rad. rate_limit: rad/s (inf for none). actuator: "none", "first_order" or "second_order" with
    bandwidth in rad/s (pole or natural frequency) and damping; delay: s. feeds: aerodynamic input -> weight.
    command: classic command (elevator, aileron, rudder, flap) -> deflection per unit of it.
    """

    name: str
    group: str
    positive: str
    lower: float
    upper: float
    rate_limit: float
    actuator: str
    bandwidth: float
    damping: float
    delay: float
    feeds: dict[str, float]
    command: dict[str, float]


class Sensor(NamedTuple):
    """noise: standard deviation in the SI unit of the channel. rate: Hz."""

    channel: str
    unit: str
    noise: float
    rate: float


@dataclass(frozen=True)
class Aircraft:
    """An aircraft file, read and checked.

    numbers: dotted path ("mass.Ixx", "surface.elevon_left.max") -> Number. settings: dotted path -> text.
    surfaces: in the file's order, which is the order of deflections everywhere. sensors: by channel.
    tables: the wind-tunnel file, where there is one. autopilot: the [autopilot] table as written.
    identified: the model of a file of kind "identified"; then everything else is empty.
    """

    name: str
    title: str
    kind: str
    path: Path
    sources: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, Number] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    surfaces: tuple[Surface, ...] = ()
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    tables: Mapping[str, Array] = field(default_factory=dict)
    autopilot: Mapping[str, Any] = field(default_factory=dict)
    identified: IdentifiedModel | None = None

    def number(self, path: str, default: float | None = None) -> float:
        """The SI value at a dotted path; the default where the file may leave it out."""
        if path in self.numbers:
            return float(self.numbers[path].value)
        if default is None:
            raise WrongUse(f"aircraft {self.name!r} ({self.path}) has no number {path!r}")
        return default

    def surface(self, name: str) -> Surface:
        """A surface by name."""
        return self.surfaces[self.surface_index(name)]

    def surface_index(self, name: str) -> int:
        """Its place among the deflections."""
        for i, s in enumerate(self.surfaces):
            if s.name == name:
                return i
        known = ", ".join(s.name for s in self.surfaces) or "no surfaces"
        raise WrongUse(f"aircraft {self.name!r} has no surface {name!r}; it has {known}")

    @property
    def has_icing(self) -> bool:
        """Whether the file says how ice changes its coefficients."""
        return any(path.startswith("aero.icing.") for path in self.numbers)

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Group -> names of its surfaces."""
        out: dict[str, tuple[str, ...]] = {}
        for s in self.surfaces:
            out[s.group] = (*out.get(s.group, ()), s.name)
        return out
