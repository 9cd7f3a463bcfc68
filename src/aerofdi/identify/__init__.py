"""Healthy flight in, an identified aircraft out. See README.md of this room."""

from .fit import identify
from .published import from_aircraft

__all__ = ["from_aircraft", "identify"]
