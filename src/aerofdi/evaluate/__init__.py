"""Judging verdicts against the truth. See README.md of this room."""

from .metrics import Interval, bootstrap, clopper_pearson, garwood, median_interval
from .score import Detection, Fault, Score, rising_edges, score
from .summary import Summary, confusion, summarise

__all__ = [
    "Detection",
    "Fault",
    "Interval",
    "Score",
    "Summary",
    "bootstrap",
    "clopper_pearson",
    "confusion",
    "garwood",
    "median_interval",
    "rising_edges",
    "score",
    "summarise",
]
