"""Readers and writers of flights: names, units and signs are translated here, once. See README.md of this room."""

from .parquet import read_flight, write_flight
from .profile import ChannelSpec, Profile, load_profile, parse_profile, shipped
from .read import read

__all__ = [
    "ChannelSpec",
    "Profile",
    "load_profile",
    "parse_profile",
    "read",
    "read_flight",
    "shipped",
    "write_flight",
]
