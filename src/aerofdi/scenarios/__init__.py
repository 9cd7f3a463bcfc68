"""What shall happen in a flight, as data: `load("demo")`. See README.md of this room."""

from .load import load, scenario_names
from .types import (
    Guidance,
    Gust,
    Point,
    Rates,
    Scenario,
    Start,
    Track,
    Turbulence,
    WindSpec,
)

__all__ = [
    "Guidance",
    "Gust",
    "Point",
    "Rates",
    "Scenario",
    "Start",
    "Track",
    "Turbulence",
    "WindSpec",
    "load",
    "scenario_names",
]
