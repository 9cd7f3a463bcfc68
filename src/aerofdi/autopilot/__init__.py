"""Controllers as pure scalar steps, and the guidance that feeds them. See README.md of this room."""

from .gains import CONTROLLERS, Autopilot, autopilot_of, controller, load_gains
from .loops import control
from .signals import BANK, COURSE, HEADING, TRACK, Measured, Reference

__all__ = [
    "BANK",
    "CONTROLLERS",
    "COURSE",
    "HEADING",
    "TRACK",
    "Autopilot",
    "Measured",
    "Reference",
    "autopilot_of",
    "control",
    "controller",
    "load_gains",
]
