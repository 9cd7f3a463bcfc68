"""`learn`: healthy flights in, a calibrated aircraft out. The job behind `aerofdi identify`."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ..aircraft.identified import IdentifiedModel
from ..core.errors import CannotJudge
from ..core.types import Flight
from ..identify import identify
from ..records import flown, read
from .judge import Progress
from .spans import parse_span
from .train import calibrate, checked_rate
from .types import Span


def learn(
    flights: Iterable[str | os.PathLike[str] | Flight],
    *,
    healthy: str | Span | None = None,
    false_alarms_per_hour: float | None = None,
    profile: str | None = None,
    progress: Progress | None = None,
) -> IdentifiedModel:
    """One model of all these flights, which must be of one aircraft and healthy throughout.

    healthy: the span to learn from in every flight (s on its own clock), else all that is flown under autopilot with
    commands moving. Thresholds are the highest that any of the flights asks for; false_alarms_per_hour as in `diagnose`.
    The result can be saved with `aircraft.identified.save_identified` and given to `diagnose(aircraft=...)`.

    Raises CannotJudge where nothing was flown or no command moved, MissingChannel where rates or commands are absent.
    """
    span = parse_span(healthy, "--healthy") if isinstance(healthy, str) else healthy
    rate = checked_rate(false_alarms_per_hour)
    used = []
    for item in flights:
        flight = item if isinstance(item, Flight) else read(os.fspath(item), profile)
        spans = [span] if span else flown(flight)[0]
        if not spans:
            raise CannotJudge(
                f"{flight.name}: nothing in it was flown under autopilot with surface commands moving; "
                f"give its healthy span with --healthy T0:T1"
            )
        used.append((flight, spans))
    name = str(used[0][0].meta.get("aircraft") or "aircraft")
    model = identify([(f, a, b) for f, spans in used for a, b in spans], name=name, progress=progress)
    if progress:
        progress("thresholds")
    found = [calibrate(f, spans, model, rate).model.calibration for f, spans in used]
    return model._replace(
        calibration={key: tuple(map(max, zip(*(c[key] for c in found), strict=True))) for key in found[0]}
    )
