"""`diagnose`: flights in, verdicts out. The whole job behind `aerofdi diagnose` and a notebook alike."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from ..aircraft import Aircraft, load_aircraft
from ..aircraft.identified import IdentifiedModel
from ..core.errors import AerofdiError, CannotJudge, MissingExtra, UnreadableFile, WrongUse
from ..core.types import Flight
from ..records import flown, read
from .judge import Progress, judge
from .spans import inside, parse_span, split, without
from .train import Trained, calibrate, checked_rate, diagnosers, timing, train
from .types import FlightDiagnosis, Result, Span

DIAGNOSERS = ("parity", "effectiveness")
Learning = Callable[[Flight, list[Span]], Trained]


def diagnose(
    flights: str | os.PathLike[str] | Flight | Iterable[str | os.PathLike[str] | Flight],
    *,
    aircraft: str | os.PathLike[str] | IdentifiedModel | Aircraft | None = None,
    with_diagnosers: Sequence[str] = (),
    healthy: str | Span | None = None,
    healthy_flight: str | os.PathLike[str] | Flight | None = None,
    judge_span: str | Span | None = None,
    false_alarms_per_hour: float | None = None,
    profile: str | None = None,
    refused: Callable[[str, AerofdiError], None] | None = None,
    progress: Progress | None = None,
) -> list[FlightDiagnosis]:
    """Diagnose one or many flights.

    Without options: in each flight find the spans airborne, under autopilot, with commands moving; learn from their
    first 40 %; check that this part is of one piece; judge the rest.

    healthy: the span to learn from instead; what follows it is judged. healthy_flight: another flight to learn from
    (`healthy` then is a span of that one). aircraft: a model saved before, whose thresholds healthy flight given with
    it replaces; or a published aircraft, whose derivatives are used while noise and trim are learnt. judge_span: what
    to judge, less what was learnt from. Times are seconds on the log's clock. false_alarms_per_hour: how many an hour
    of healthy flight as rough as the learnt one may bring, 0.1 by default.

    A flight that cannot be read or used (UnreadableFile, MissingExtra, WrongUse: also `healthy_flight` itself, which
    is no independent test) raises, unless `refused` is given: then refused(name, error) is called and the others are
    judged. What a flight does not allow becomes a result `cannot_judge`.
    """
    if isinstance(flights, str | os.PathLike | Flight):
        flights = [flights]
    wanted = tuple(with_diagnosers) or DIAGNOSERS
    unknown = [w for w in wanted if w not in DIAGNOSERS]
    if unknown:
        raise WrongUse(
            f"--with {unknown[0]!r} is not a diagnoser of flight records; choose from {', '.join(DIAGNOSERS)}"
        )
    say = progress or (lambda text: None)
    model, published = _known(aircraft)
    span = parse_span(healthy, "--healthy") if isinstance(healthy, str) else healthy
    window = parse_span(judge_span, "--judge") if isinstance(judge_span, str) else judge_span
    if false_alarms_per_hour is not None and model is not None and span is None and healthy_flight is None:
        raise WrongUse(
            f"--false-alarms-per-hour sets thresholds on healthy flight, but the model of {model.name} brings its own; "
            f"give healthy flight too, with --healthy T0:T1 or --healthy-flight F"
        )
    learning = _learning(model, published, checked_rate(false_alarms_per_hour), say)
    reference, source = None, None
    if healthy_flight is not None:
        source = (
            healthy_flight if isinstance(healthy_flight, Flight) else read(os.fspath(healthy_flight), profile)
        )
        reference = _reference(source, span, learning, say)
    out = []
    for item in flights:
        name = item.name if isinstance(item, Flight) else os.fspath(item)
        try:
            flight = item if isinstance(item, Flight) else read(name, profile)
            if source is not None:
                _independent(name, flight, source)
            out.append(_one(name, flight, wanted, model, learning, span, reference, window, say))
        except (UnreadableFile, WrongUse, MissingExtra) as error:
            if refused is None:
                raise
            refused(name, error)
    return out


def _learning(
    model: IdentifiedModel | None, published: Aircraft | None, rate: float, say: Progress
) -> Learning:
    def learn(flight: Flight, spans: list[Span]) -> Trained:
        if model is not None:
            return calibrate(flight, spans, model, rate)
        return train(flight, spans, say, rate, published)

    return learn


def _reference(flight: Flight, span: Span | None, learning: Learning, say: Progress) -> Trained:
    spans = [span] if span else flown(flight)[0]
    if not spans:
        raise CannotJudge(
            f"{flight.name}: nothing in it was flown under autopilot; give its healthy span with --healthy"
        )
    say(f"learning from {flight.name}")
    return learning(flight, spans)


def _independent(name: str, flight: Flight, source: Flight) -> None:
    """Refuse the very record that was learnt from, whatever its file is called: the same measurements and stamps."""
    if not flight.measured or set(flight.measured) != set(source.measured):
        return
    pairs = [(flight.measured[n], source.measured[n]) for n in flight.measured]
    if all(
        np.array_equal(a.t_s, b.t_s, equal_nan=True) and np.array_equal(a.value, b.value, equal_nan=True)
        for a, b in pairs
    ):
        raise WrongUse(
            f"{name}: this is the healthy flight itself (--healthy-flight), and what was learnt from is no "
            f"independent test; judge another flight, or learn from a span of this one with --healthy T0:T1"
        )


def _known(
    aircraft: str | os.PathLike[str] | IdentifiedModel | Aircraft | None,
) -> tuple[IdentifiedModel | None, Aircraft | None]:
    """(identified model, published aircraft): whichever of the two was given."""
    if aircraft is None or isinstance(aircraft, IdentifiedModel):
        return aircraft, None
    loaded = aircraft if isinstance(aircraft, Aircraft) else load_aircraft(aircraft)
    return (loaded.identified, None) if loaded.identified is not None else (None, loaded)


def _one(
    name: str,
    flight: Flight,
    wanted: tuple[str, ...],
    model: IdentifiedModel | None,
    learning: Learning,
    healthy: Span | None,
    reference: Trained | None,
    window: Span | None,
    say: Progress,
) -> FlightDiagnosis:
    spans, known_by = flown(flight)
    notes = [*known_by, *flight.meta.get("notes", ()), *flight.meta.get("assumed", ())]
    trained: list[Span] = []
    try:
        if healthy and reference is None and not inside([healthy], flight.span_s):
            raise CannotJudge(_outside(name, "--healthy", healthy, flight))
        if model is not None or reference is not None:
            judged = spans
            trained = [healthy] if healthy and reference is None else []
            ready = reference or (learning(flight, trained) if trained else _loaded(model, flight))
        else:
            # What was flown before a given healthy span may be the take-off; only what follows is judged.
            trained, judged = (
                ([healthy], without(spans, [(-math.inf, healthy[0])])) if healthy else split(spans)
            )
            if not trained:
                raise CannotJudge(
                    f"{name}: nothing was flown under autopilot with surface commands moving; "
                    f"give spans with --healthy T0:T1 and --judge T0:T1"
                )
            ready = learning(flight, trained)
        if window and not inside([window], flight.span_s):
            raise CannotJudge(_outside(name, "--judge", window, flight))
        judged = inside(without([window] if window else judged, trained), flight.span_s)
        if not judged:
            raise CannotJudge(f"{name}: no flown time is left to judge after training; give --judge T0:T1")
        say(f"judging {name}")
        results = [judge(d, flight, judged, ready.model, spans) for d in ready.diagnosers if d.name in wanted]
        missing = [w for w in wanted if w not in [d.name for d in ready.diagnosers]]
        results += [
            Result(w, "cannot_judge", "no surface command moved enough in training to be identified")
            for w in missing
        ]
        return FlightDiagnosis(
            name, flight, spans, trained, judged, ready.model, results, [*notes, *ready.notes]
        )
    except CannotJudge as error:
        results = [Result(w, "cannot_judge", str(error)) for w in wanted]
        return FlightDiagnosis(name, flight, spans, trained, [], None, results, notes)


def _outside(name: str, option: str, span: Span, flight: Flight) -> str:
    t0, t1 = flight.span_s
    return (
        f"{option} {span[0]:g}:{span[1]:g} lies outside {name}, which runs from {t0:.1f} to {t1:.1f} s on its own "
        f"clock; give a span within it"
    )


def _loaded(model: IdentifiedModel | None, flight: Flight) -> Trained:
    if model is None:
        raise AerofdiError("no model and no reference flight")
    return Trained(model, diagnosers(model, timing(model, flight)), model.notes)


def exit_code(found: Sequence[FlightDiagnosis], refused: int = 0) -> int:
    """10 if any fault, else 2 if any flight was refused, else 3 if any has no diagnoser able to judge, else 0."""
    verdicts = {f.verdict for f in found}
    return 10 if "fault" in verdicts else 2 if refused else 3 if "cannot_judge" in verdicts else 0


def default_model_path(report: str | os.PathLike[str]) -> Path:
    """Where the model of a diagnosis is kept: beside the report, so the next flight can reuse it."""
    return Path(report).with_suffix(".aircraft.toml")
