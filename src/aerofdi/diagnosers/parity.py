"""Parity residual: the rate a model predicts from commands against the rate that is measured (method A).

    delta  = servo(delay(command))                 position and rate limits, own dynamics per surface
    x'     = A x + B [M (delta - trim); exogenous],  y^ = C x + D [...]
    e      = R (y^ - y)                            R: low-pass Bessel filter, unit gain at zero frequency
    alarm  : |e_i| >= T_i for any i

It detects; it has one residual a rate and does not say which surface. Guarantees hold while the model does: a
residual that model error alone drives over T is a false alarm, which is why T is calibrated on healthy flight.
Not modelled: gusts (they pass R below its bandwidth); airspeed beyond its effect on the surfaces (the model's own
damping and trim stay those of its reference airspeed). Source: vireo_comparison, section 3.1, Figure 3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import HEALTHY, Array, Channels, Diagnoser, Status, Verdict
from ..parts.bessel import bessel_sections, sections_step
from ..parts.delay_line import delay_fill, delay_step
from ..parts.lti import hold, lti_advance, lti_output
from ..parts.ops import lean, maximum, merged
from ..parts.servo import servo_step

OK, NOT_READY = int(Status.OK), int(Status.NOT_READY)
STALE, NONFINITE = int(Status.STALE_INPUT), int(Status.NONFINITE)


class Params(NamedTuple):
    """ns surfaces, nu mixed inputs, ne exogenous inputs, ny residuals, n states of the model.

    a (n, n), b (n, nu + ne), c (ny, n), d (ny, nu + ne): discrete model. start (n, ny): x = start @ y after a gap.
    servo (ns, 8), delay (ns,) in samples, trim (ns,), mix (nu, ns). command_at (ns,), exogenous_at (ne,; -1 is the
    constant 1), output_at (ny,): columns of z. speed_at: column of airspeed or -1; v0 its reference: inputs of
    surfaces are scaled by V/v0. sections: Bessel. threshold (ny,). max_age (nz,). settle: samples.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    start: Array
    servo: Array
    delay: Array
    trim: Array
    mix: Array
    command_at: Any
    exogenous_at: Any
    output_at: Any
    speed_at: int
    v0: float
    speed_pole: float
    sections: Array
    threshold: Array
    max_age: Array
    settle: int


class State(NamedTuple):
    """Servo positions and speeds (ns,), delay lines, model state x, filters (ny, sections, 2), counters, scratch."""

    position: Array
    speed: Array
    line: Array
    x: Array
    filter: Array
    counter: Array  # samples since the last gap (-1: none yet), airspeed ratio
    u: Array
    y: Array
    work: Array


def init(params: Params) -> State:
    """At rest, waiting for the first good sample."""
    ns, ny = len(params.delay), len(params.threshold)
    return State(
        position=np.zeros(ns),
        speed=np.zeros(ns),
        line=np.zeros((ns, int(params.delay.max(initial=0.0)) + 4)),
        x=np.zeros(len(params.a)),
        filter=np.zeros((ny, len(params.sections), 2)),
        counter=np.array([-1.0, 1.0]),
        u=np.zeros(params.b.shape[1]),
        y=np.zeros(ny),
        work=np.zeros(len(params.a)),
    )


@merged
def _status(z: Array, age: Array, max_age: Array) -> int:
    status = OK
    for j in range(len(max_age)):
        if not np.isfinite(z[j]):
            return NONFINITE
        if not age[j] <= max_age[j]:
            status = STALE
    return status


@merged
def _restart(params: Params, state: State, z: Array) -> None:
    """Surfaces where their commands are, model at the measured outputs, filters empty."""
    for i in range(len(params.delay)):
        command = z[params.command_at[i]]
        delay_fill(state.line[i], command)
        state.position[i] = command
        state.speed[i] = 0.0
    for i in range(len(state.x)):
        state.x[i] = 0.0
        for j in range(len(params.threshold)):
            state.x[i] += params.start[i, j] * z[params.output_at[j]]
    for i in range(len(params.threshold)):
        for j in range(len(params.sections)):
            state.filter[i, j, 0] = 0.0
            state.filter[i, j, 1] = 0.0
    state.counter[0] = 0.0
    if params.speed_at >= 0:
        state.counter[1] = z[params.speed_at] / params.v0


@merged
def _inputs(params: Params, state: State, z: Array) -> None:
    """Servos one step on, then u = [mixed deflections times airspeed ratio, exogenous]."""
    if params.speed_at >= 0:
        state.counter[1] += (1.0 - params.speed_pole) * (z[params.speed_at] / params.v0 - state.counter[1])
    for i in range(len(params.delay)):
        delayed = delay_step(state.line[i], z[params.command_at[i]], params.delay[i])
        state.position[i], state.speed[i] = servo_step(
            params.servo[i], state.position[i], state.speed[i], delayed
        )
    nu = params.mix.shape[0]
    for j in range(nu):
        total = 0.0
        for i in range(len(params.delay)):
            total += params.mix[j, i] * (state.position[i] - params.trim[i])
        state.u[j] = total * state.counter[1]
    for j in range(len(params.exogenous_at)):
        at = params.exogenous_at[j]
        state.u[nu + j] = z[at] if at >= 0 else 1.0


@lean
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: servos, prediction, filtered residual, threshold. Bad data freeze everything and give a status."""
    status = _status(z, age, params.max_age)
    if status != OK:
        state.counter[0] = -1.0
        out.status[k] = status
        return
    if state.counter[0] < 0.0:
        _restart(params, state, z)
    _inputs(params, state, z)
    lti_output(params.c, params.d, state.x, state.u, state.y)
    worst = 0.0
    for i in range(len(params.threshold)):
        e = sections_step(params.sections, state.filter[i], state.y[i] - z[params.output_at[i]])
        out.residual[k, i] = e
        out.threshold[k, i] = params.threshold[i]
        worst = maximum(worst, abs(e) / params.threshold[i])
    lti_advance(params.a, params.b, state.x, state.u, state.work)
    ready = state.counter[0] >= params.settle
    state.counter[0] += 1.0
    out.status[k] = OK if ready else NOT_READY
    out.detected[k] = ready and worst >= 1.0
    out.active[k, 0] = ready and worst < 1.0
    out.score[k, 0] = worst


@lean
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row in order."""
    for k in range(z.shape[0]):
        step_into(params, state, z[k], age[k], out, k)


def from_linear(
    a: Array,
    b: Array,
    c: Array,
    *,
    dt_s: float,
    commands: Sequence[str],
    servo: Array,
    delay_s: float,
    mix: Array,
    outputs: Sequence[str],
    threshold: Sequence[float] | Array,
    bandwidth: float,
    order: int = 5,
    trim: Sequence[float] | Array | None = None,
    exogenous: Sequence[str] = (),
    units: dict[str, str] | None = None,
    max_age_s: dict[str, float] | None = None,
    start: Array | None = None,
    airspeed: float | None = None,
    name: str = "parity",
) -> Diagnoser:
    """A parity diagnoser from a continuous linear model x' = a x + b [mixed surfaces; exogenous], y = c x.

    commands (ns): channels of the surfaces; servo (ns, 8): rows of `parts.servo.servo_coefficients` at dt_s; delay_s
    before each. mix (nu, ns): deflections about `trim` -> model inputs. outputs (ny): measured channels compared with
    y; threshold (ny,) in their unit. exogenous: measured channels that follow the mixed inputs in b, "1" for a
    constant. bandwidth: of the Bessel filter, rad/s. units: of the commands and exogenous channels, rad and rad/s by
    default. airspeed: reference in m/s, where surface effects shall follow the measured airspeed.
    """
    names, unit_of = _channels(commands, outputs, exogenous, units or {}, airspeed)
    nu, ns = np.shape(mix)
    limits = np.asarray(threshold, float)
    _check(name, (a, b, c), (nu, ns), (commands, exogenous, outputs), limits)
    ad, bd = hold(np.asarray(a, float), np.asarray(b, float), dt_s)
    ages = tuple((max_age_s or {}).get(n, 5.0 * dt_s) for n in names)
    settle_s = max(2.5 * order / 5.0 / bandwidth * 2.0, 0.5)
    params = Params(
        a=ad,
        b=bd,
        c=np.ascontiguousarray(c, dtype=float),
        d=np.zeros((len(outputs), nu + len(exogenous))),
        start=np.zeros((len(a), len(outputs))) if start is None else np.asarray(start, float),
        servo=np.asarray(servo, float).reshape(ns, -1),
        delay=np.full(ns, delay_s / dt_s),
        trim=np.zeros(ns) if trim is None else np.asarray(trim, float),
        mix=np.asarray(mix, float),
        command_at=np.array([names.index(n) for n in commands], dtype=np.int64),
        exogenous_at=np.array([names.index(n) if n != "1" else -1 for n in exogenous], dtype=np.int64),
        output_at=np.array([names.index(n) for n in outputs], dtype=np.int64),
        speed_at=names.index("airspeed") if airspeed else -1,
        v0=airspeed or 1.0,
        speed_pole=math.exp(-dt_s / 1.0),
        sections=bessel_sections(order, bandwidth, dt_s),
        threshold=limits,
        max_age=np.array(ages),
        settle=math.ceil(settle_s / dt_s),
    )
    return Diagnoser(
        name=name,
        inputs=Channels(names, tuple(unit_of[n] for n in names), ages),
        outputs=Channels((), ()),
        hypotheses=(HEALTHY,),
        dt_s=dt_s,
        active=False,
        params=params,
        init=init,
        step_into=step_into,
        run_into=run_into,
        residuals=tuple(outputs),
        settle_s=settle_s + 2 * dt_s,
    )


def _check(
    name: str, model: tuple[Array, Array, Array], mix: tuple[int, int], channels: tuple[Sequence[str], ...], limits: Array
) -> None:  # fmt: skip
    """Shapes that fit and positive thresholds, or WrongUse."""
    (a, b, c), (nu, ns), (commands, exogenous, outputs) = model, mix, channels
    if ns != len(commands) or b.shape != (len(a), nu + len(exogenous)) or c.shape != (len(outputs), len(a)):
        raise WrongUse(
            f"{name}: shapes do not fit: a {a.shape}, b {b.shape}, c {c.shape}, mix {mix} for "
            f"{len(commands)} commands, {len(exogenous)} exogenous inputs and {len(outputs)} outputs"
        )
    if limits.shape != (len(outputs),) or not (limits > 0).all():
        raise WrongUse(
            f"{name}: threshold {limits.tolist()} must hold a positive number for each of {tuple(outputs)}"
        )


def _channels(
    commands: Sequence[str],
    outputs: Sequence[str],
    exogenous: Sequence[str],
    units: dict[str, str],
    airspeed: float | None,
) -> tuple[tuple[str, ...], dict[str, str]]:
    unit_of = {n: units.get(n, "rad/s" if n in ("p", "q", "r") else "rad") for n in (*outputs, *commands)}
    unit_of |= {n: units.get(n, "rad/s" if n in ("p", "q", "r") else "rad") for n in exogenous if n != "1"}
    if airspeed:
        unit_of["airspeed"] = "m/s"
    return tuple(unit_of), unit_of
