"""Judging verdicts against the truth. See README.md of this room."""

from .campaign import Campaign, load_campaign, load_rows, run_campaign, scores
from .metrics import Interval, bootstrap, clopper_pearson, garwood, median_interval
from .requirements import (
    Allowable,
    Envelope,
    allowable,
    exit_time,
    fly_exits,
    load_envelopes,
    scaled,
    widened,
)
from .score import Detection, Fault, Score, rising_edges, score
from .summary import Summary, confusion, summarise
from .truth import faults_of, value_at

__all__ = [
    "Allowable",
    "Campaign",
    "Detection",
    "Envelope",
    "Fault",
    "Interval",
    "Score",
    "Summary",
    "allowable",
    "bootstrap",
    "clopper_pearson",
    "confusion",
    "exit_time",
    "faults_of",
    "fly_exits",
    "garwood",
    "load_campaign",
    "load_envelopes",
    "load_rows",
    "median_interval",
    "rising_edges",
    "run_campaign",
    "scaled",
    "score",
    "scores",
    "summarise",
    "value_at",
    "widened",
]
