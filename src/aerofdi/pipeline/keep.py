"""Models kept beside a report, so that the next flight can be judged without learning again."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from ..aircraft.identified import save_identified
from .diagnose import default_model_path
from .types import FlightDiagnosis


def save_models(found: Sequence[FlightDiagnosis], report: str | os.PathLike[str]) -> list[Path]:
    """Save every different model of these diagnoses, thresholds included; returns the files.

    One model goes to `default_model_path(report)`; of several each carries the name of its flight.
    """
    models = {id(d.model): d for d in found if d.model is not None}
    out: list[Path] = []
    for d in models.values():
        assert d.model is not None
        path = default_model_path(report)
        if len(models) > 1:
            stem = re.sub(r"[^\w.-]+", "_", Path(d.file).name.split(".")[0])
            path = path.with_name(f"{Path(report).stem}.{stem}.aircraft.toml")
            if path in out:
                path = path.with_name(f"{Path(report).stem}.{stem}.{len(out) + 1}.aircraft.toml")
        save_identified(d.model, path)
        out.append(path)
    return out
