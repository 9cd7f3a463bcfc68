"""The one front door for flight records: `diagnose`. See README.md of this room."""

from .diagnose import default_model_path, diagnose, exit_code
from .types import FlightDiagnosis, Result, Run

__all__ = ["FlightDiagnosis", "Result", "Run", "default_model_path", "diagnose", "exit_code"]
