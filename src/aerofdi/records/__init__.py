"""Readers and writers of flights: names, units and signs are translated here, once. See README.md."""

from .describe import describe
from .parquet import read_flight, write_flight
from .profile import ChannelSpec, Profile, load_profile, parse_profile, shipped
from .read import read, read_log
from .sniff import format_of
from .spans import flown
from .truth import attach_truth

__all__ = [
    "ChannelSpec",
    "Profile",
    "attach_truth",
    "describe",
    "flown",
    "format_of",
    "load_profile",
    "parse_profile",
    "read",
    "read_flight",
    "read_log",
    "shipped",
    "write_flight",
]
