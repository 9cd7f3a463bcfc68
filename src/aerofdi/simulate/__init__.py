"""The loop that flies scenarios. See README.md of this room."""

from .fly import fly
from .many import Normal, Uniform, changed, flights, fly_many
from .ride import Flown, Watched, fly_with

__all__ = ["Flown", "Normal", "Uniform", "Watched", "changed", "flights", "fly", "fly_many", "fly_with"]
