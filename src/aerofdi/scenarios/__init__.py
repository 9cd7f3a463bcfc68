"""What shall happen in a flight, as data: `load_scenario("demo")`. See README.md of this room."""

from .load import load_scenario, scenario_names
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

load = load_scenario

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
    "load_scenario",
    "scenario_names",
]
