"""Controllers as pure scalar steps, and the guidance that feeds them. See README.md of this room."""

from .gains import CONTROLLERS, controller, load_gains
from .signals import BANK, COURSE, HEADING, TRACK, Measured, Reference

__all__ = [
    "BANK",
    "CONTROLLERS",
    "COURSE",
    "HEADING",
    "TRACK",
    "Measured",
    "Reference",
    "controller",
    "load_gains",
]
