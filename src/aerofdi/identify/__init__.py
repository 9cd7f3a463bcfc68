"""Healthy flight in, an identified aircraft out. See README.md of this room."""

from .fit import identify

__all__ = ["identify"]
