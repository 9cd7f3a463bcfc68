"""Core nouns and verbs; numpy only. See README.md of this room."""

from .bind import bind, default_max_age, fresh
from .check import check_diagnoser
from .errors import (
    AerofdiError,
    CannotJudge,
    ContractError,
    MissingChannel,
    MissingExtra,
    UnreadableFile,
    WrongUse,
)
from .run import copy_state, empty_verdict, run, step
from .types import (
    HEALTHY,
    Array,
    Channels,
    Design,
    Diagnoser,
    Event,
    Flight,
    Hypothesis,
    Request,
    Sample,
    Series,
    Status,
    Verdict,
)

__all__ = [
    "HEALTHY",
    "AerofdiError",
    "Array",
    "CannotJudge",
    "Channels",
    "ContractError",
    "Design",
    "Diagnoser",
    "Event",
    "Flight",
    "Hypothesis",
    "MissingChannel",
    "MissingExtra",
    "Request",
    "Sample",
    "Series",
    "Status",
    "UnreadableFile",
    "Verdict",
    "WrongUse",
    "bind",
    "check_diagnoser",
    "copy_state",
    "default_max_age",
    "empty_verdict",
    "fresh",
    "run",
    "step",
]
