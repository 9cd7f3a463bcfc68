"""The one front door for flight records: `diagnose`. See README.md of this room."""

from .capability import capability
from .diagnose import default_model_path, diagnose, exit_code
from .inspect import find
from .keep import save_models
from .learn import learn
from .types import FlightDiagnosis, Result, Run

__all__ = [
    "FlightDiagnosis",
    "Result",
    "Run",
    "capability",
    "default_model_path",
    "diagnose",
    "exit_code",
    "find",
    "learn",
    "save_models",
]
