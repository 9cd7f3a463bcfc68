"""Flight dynamics: the plant, trim and linear models. See README.md of this room."""

from .build import fuel_capacity, plant_params, surfaces_tuple
from .linearise import LinearModel, LPVGrid, Mode, linearise, lpv_grid, modes
from .plant import PlantParams, derivative, outputs, rk4_step, step, thrust
from .stuck_range import StuckRange, trimmable_range
from .summary import Summary, summary, summary_lines
from .trim import NoTrim, Trim, trim
from .types import HEALTHY_EFFECTS, STILL_AIR, Effects, Outputs, State, Wind

__all__ = [
    "HEALTHY_EFFECTS",
    "STILL_AIR",
    "Effects",
    "LPVGrid",
    "LinearModel",
    "Mode",
    "NoTrim",
    "Outputs",
    "PlantParams",
    "State",
    "StuckRange",
    "Summary",
    "Trim",
    "Wind",
    "derivative",
    "fuel_capacity",
    "linearise",
    "lpv_grid",
    "modes",
    "outputs",
    "plant_params",
    "rk4_step",
    "step",
    "summary",
    "summary_lines",
    "surfaces_tuple",
    "thrust",
    "trim",
    "trimmable_range",
]
