"""The nouns of the house: Series, Flight, Channels, Sample, Hypothesis, Verdict, Diagnoser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# float64 by convention; numpy infers narrower and wider float types than a reader cares about.
Array = NDArray[Any]


class Series(NamedTuple):
    """One signal on its own clock.

    t_s: (n,) stamps in s on the flight's clock, never decreasing. value: (n,) in `unit`. codes: number -> name
    for coded signals (mode, armed), else None. repeats: True where the log is known to write old values again,
    so that an unchanged value is not news. Gaps stay gaps: nothing is ever resampled or filled here.
    """

    t_s: Array
    value: Array
    unit: str
    codes: dict[int, str] | None = None
    repeats: bool = False

    @property
    def period_s(self) -> float:
        """Median time between samples with different stamps, s; NaN for fewer than two."""
        steps = np.diff(self.t_s)
        steps = steps[steps > 0]
        return float(np.median(steps)) if len(steps) else float("nan")

    def between(self, t0_s: float, t1_s: float) -> Series:
        """The samples with t0_s <= t < t1_s."""
        i, j = np.searchsorted(self.t_s, [t0_s, t1_s])
        return self._replace(t_s=self.t_s[i:j], value=self.value[i:j])


class Event(NamedTuple):
    """Something the log says in words: an autopilot message, a mode change, an injected fault."""

    t_s: float
    kind: str
    text: str


@dataclass(frozen=True)
class Flight:
    """What happened in one flight, simulated or real.

    measured is the only table a diagnoser can bind to. output (what was really sent to an actuator after a fault
    was injected) and truth (faults, wind, true states) exist to score verdicts and are never bindable.
    """

    measured: dict[str, Series]
    output: dict[str, Series] = field(default_factory=dict)
    truth: dict[str, Series] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last stamp over all measured channels, s; (0, 0) where there are none."""
        starts = [s.t_s[0] for s in self.measured.values() if len(s.t_s)]
        ends = [s.t_s[-1] for s in self.measured.values() if len(s.t_s)]
        return (float(min(starts)), float(max(ends))) if starts else (0.0, 0.0)

    @property
    def duration_s(self) -> float:
        t0, t1 = self.span_s
        return t1 - t0

    @property
    def name(self) -> str:
        """What messages call this flight: its source file, else 'the flight'."""
        return str(self.meta.get("source", "the flight"))

    def between(self, t0_s: float, t1_s: float) -> Flight:
        """The same flight with only the samples t0_s <= t < t1_s in every table."""

        def cut(table: dict[str, Series]) -> dict[str, Series]:
            return {name: series.between(t0_s, t1_s) for name, series in table.items()}

        events = [e for e in self.events if t0_s <= e.t_s < t1_s]
        return replace(
            self, measured=cut(self.measured), output=cut(self.output), truth=cut(self.truth), events=events
        )

    def with_measured(self, **channels: Series) -> Flight:
        """A copy with these measured channels replaced or added (dots in names: pass with `**{...}`)."""
        return replace(self, measured={**self.measured, **channels})


class Channels(NamedTuple):
    """What a diagnoser reads or writes, in order.

    names, units: (n,) each. max_age_s: (n,) a value older than this is stale. optional: names that may be absent;
    an absent optional channel is bound as NaN with infinite age. behind_s: how far the instant described lies behind the
    one at which it is described, so that a channel logged slowly is known on both sides of it (see `bind`).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    max_age_s: tuple[float, ...] = ()
    optional: tuple[str, ...] = ()
    behind_s: float = 0.0


class Sample(NamedTuple):
    """A flight as one diagnoser sees it: t_s (n,), z (n, nz) last known values, age (n, nz) their ages in s.

    delay_s (nz,) is how far each channel lies behind t_s: what `behind_s` asks for and the delay of the anti-alias mean, 0
    where neither was needed.
    """

    t_s: Array
    z: Array
    age: Array
    delay_s: Array


class Status(IntEnum):
    """How far a verdict can be trusted at one sample. Anything but OK means: no judgement now."""

    OK = 0
    NOT_READY = 1
    STALE_INPUT = 2
    NONFINITE = 3
    SOLVER_LIMIT = 4
    OUT_OF_ENVELOPE = 5

    @property
    def text(self) -> str:
        """What it means and what to do, in one sentence."""
        return _STATUS_TEXT[self]


_STATUS_TEXT = {
    Status.OK: "judging",
    Status.NOT_READY: "still filling its filters; give it more flight before the time of interest",
    Status.STALE_INPUT: "an input is older than its max_age_s; look for gaps with `aerofdi info`",
    Status.NONFINITE: "an input is NaN or infinite; look at the channel with `aerofdi info`",
    Status.SOLVER_LIMIT: "the solver ran out of iterations; allow more, or a longer sample period",
    Status.OUT_OF_ENVELOPE: "the aircraft is outside the envelope of the model; add flights there to the training",
}


class Request(IntEnum):
    """What a diagnoser asks of the autopilot while it works."""

    NONE = 0
    HOLD_LEVEL = 1


class Hypothesis(NamedTuple):
    """One thing that may be wrong: ("elevon_right", "stuck", "rad", "elevon"). Index 0 is always HEALTHY.

    fault: surface or group. mode: fault mode. unit: of estimate (and its std). group: the surfaces it belongs to.
    """

    fault: str
    mode: str
    unit: str
    group: str


HEALTHY = Hypothesis("none", "healthy", "1", "none")


class Verdict(NamedTuple):
    """What a diagnoser says; NaN means "I do not say". One instant, or a run with a leading time axis (n, ...).

    detected: bool. active: (nh,) bool, several may hold; all false while detected = faulty but not isolated.
    score, estimate, estimate_std: (nh,) float, the last two in each hypothesis's unit. residual, threshold: (nr,).
    excitation: (nu,) to be added to the commands one sample later. request: a Request. status: a Status.
    """

    detected: Array
    active: Array
    score: Array
    estimate: Array
    estimate_std: Array
    residual: Array
    threshold: Array
    excitation: Array
    request: Array
    status: Array


class Diagnoser(NamedTuple):
    """A method: numbers fixed at design time and pure functions. No subclassing; tweak with `_replace`.

    init(params) -> State (a NamedTuple of arrays). step_into(params, state, z, age, out, k) advances `state` in
    place from one sample z (nz,), age (nz,) and writes row k of the run buffers `out` (see `empty_verdict`).
    run_into(params, state, z, age, out) is the same over (n, nz) rows, compiled. `core.step` wraps step_into into
    the pure form. residuals names the nr residuals; budget (nu,) bounds |excitation| in the units of `outputs`.
    """

    name: str
    inputs: Channels
    outputs: Channels
    hypotheses: tuple[Hypothesis, ...]
    dt_s: float
    active: bool
    params: Any
    init: Callable[[Any], Any]
    step_into: Callable[..., None]
    run_into: Callable[..., None]
    residuals: tuple[str, ...] = ()
    budget: tuple[float, ...] = ()
    settle_s: float = 0.0


class Design(NamedTuple):
    """The result of a synthesis: what was asked, the numbers, and the proof. Saved as TOML + npz, never pickle."""

    method: str
    spec: dict[str, Any]
    aircraft_hash: str
    params: dict[str, Any]
    certificate: dict[str, Any]
