"""What a diagnosis consists of; the CLI, the report and notebooks read these."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..aircraft.identified import IdentifiedModel
from ..core.types import Array, Diagnoser, Flight, Verdict

Span = tuple[float, float]


class Run(NamedTuple):
    """One diagnoser over the judged spans, joined: t (n,), z (n, nz), verdict rows; `breaks` start each span."""

    diagnoser: Diagnoser
    t_s: Array
    z: Array
    verdict: Verdict
    breaks: tuple[int, ...]


@dataclass(frozen=True)
class Result:
    """What one diagnoser concludes. verdict: healthy, fault or cannot_judge; reason: one sentence for a person.

    minimum_detectable: smallest fault that would have been seen, e.g. {"aileron loss_of_effectiveness": 0.3}.
    events: dicts with t_s, event (detected, isolated, cleared), fault, mode, estimate, estimate_std, unit.
    """

    diagnoser: str
    verdict: str
    reason: str
    minimum_detectable: dict[str, float] = field(default_factory=dict)
    events: list[dict[str, Any]] = field(default_factory=list)
    run: Run | None = None


@dataclass(frozen=True)
class FlightDiagnosis:
    """One flight: where it was flown under autopilot, trained and judged, with which model, and every result."""

    file: str
    flight: Flight
    flown: list[Span]
    trained: list[Span]
    judged: list[Span]
    model: IdentifiedModel | None
    results: list[Result]
    notes: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """fault if any diagnoser says so, else healthy if any could judge, else cannot_judge."""
        said = {r.verdict for r in self.results}
        return next((v for v in ("fault", "healthy") if v in said), "cannot_judge")

    def to_json(self) -> dict[str, Any]:
        """The stable JSON form."""
        return {
            "file": self.file,
            "duration_s": self.flight.duration_s,
            "trained": [list(s) for s in self.trained],
            "judged": [list(s) for s in self.judged],
            "results": [
                {
                    "diagnoser": r.diagnoser,
                    "verdict": r.verdict,
                    "reason": r.reason,
                    "minimum_detectable": r.minimum_detectable,
                    "events": r.events,
                }
                for r in self.results
            ],
        }
