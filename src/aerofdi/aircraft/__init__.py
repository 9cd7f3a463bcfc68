"""Aircraft as data: `load_aircraft("vireo")`. See README.md of this room."""

from .load import aircraft_names, hash, load_aircraft
from .numbers import number_rows
from .types import Aircraft, Number, Sensor, Surface

__all__ = [
    "Aircraft",
    "Number",
    "Sensor",
    "Surface",
    "aircraft_names",
    "hash",
    "load_aircraft",
    "number_rows",
]
