"""The loop that flies scenarios. See README.md of this room."""

from .fly import fly

__all__ = ["fly"]
