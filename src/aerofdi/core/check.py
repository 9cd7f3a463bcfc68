"""The contract of a diagnoser, as something you can run: `check_diagnoser(d, flight)`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .bind import bind
from .errors import AerofdiError, ContractError
from .run import copy_state, run, step
from .types import HEALTHY, Diagnoser, Flight, Sample, Status, Verdict

OK_SHARE = 0.95


def _same(a: Any, b: Any) -> bool:
    """Equal bit for bit (NaN equal to NaN), through nested tuples."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=np.asarray(a).dtype.kind == "f")


def _finite(state: Any) -> bool:
    if isinstance(state, tuple):
        return all(_finite(x) for x in state)
    array = np.asarray(state)
    return array.dtype.kind != "f" or bool(np.isfinite(array).all())


def _rows(sample: Sample, start: int, stop: int) -> Sample:
    return Sample(sample.t_s[start:stop], sample.z[start:stop], sample.age[start:stop], sample.delay_s)


def _shapes(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    n, nh, nr, nu = len(sample.t_s), len(d.hypotheses), len(d.residuals), len(d.outputs.names)
    want = [(n,), (n, nh), (n, nh), (n, nh), (n, nh), (n, nr), (n, nr), (n, nu), (n,), (n,)]
    got = [field.shape for field in whole]
    return None if got == want else f"verdict shapes are {got}, expected {want}"


def _declaration(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    if not d.hypotheses or d.hypotheses[0] != HEALTHY:
        return "hypotheses[0] must be core.HEALTHY"
    if len(d.inputs.max_age_s) != len(d.inputs.names) or len(d.inputs.units) != len(d.inputs.names):
        return "inputs must give a unit and a max_age_s for every name"
    if d.active != bool(d.outputs.names) or len(d.budget) != len(d.outputs.names):
        return "an active diagnoser declares outputs and a budget for each; a passive one declares none"
    return None


def _deterministic(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    return None if _same(run(d, sample)[1], whole) else "the same sample gave two different verdicts"


def _untouched(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    z, age = sample.z.copy(), sample.age.copy()
    state = d.init(d.params)
    before, params = copy_state(state), copy_state(d.params)
    row = len(z) // 2
    step(d, state, z[row], age[row])
    run(d, sample, state)
    clean = _same(state, before) and _same(d.params, params)
    clean = clean and _same(z, sample.z) and _same(age, sample.age)
    return None if clean else "step or run changed its inputs (state, params, z or age)"


def _split(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    cut = len(sample.t_s) // 3
    state, first = run(d, _rows(sample, 0, cut))
    _, second = run(d, _rows(sample, cut, len(sample.t_s)), state)
    joined = Verdict(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    return None if _same(joined, whole) else f"a run split at sample {cut} differs from the whole run"


def _live(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    state = d.init(d.params)
    for k in range(min(len(sample.t_s), 3000)):
        state, now = step(d, state, sample.z[k], sample.age[k])
        if not _same(now, Verdict(*(field[k] for field in whole))):
            return f"live and replay differ at sample {k} (t = {sample.t_s[k]:.3f} s)"
    return None


def _bad_data(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    for bad in (np.nan, np.inf):
        for j, name in enumerate(d.inputs.names):
            z = sample.z.copy()
            start = len(z) // 2
            z[start : start + 10, j] = bad
            state, out = run(d, sample._replace(z=z))
            if not _finite(state):
                return f"{bad} in {name!r} leaves a state that is not finite"
            if name not in d.inputs.optional and (out.status[start : start + 10] == Status.OK).any():
                return f"{bad} in {name!r} still gives status OK"
    for j, name in enumerate(d.inputs.names):
        if name in d.inputs.optional or not np.isfinite(d.inputs.max_age_s[j]):
            continue
        age = sample.age.copy()
        start = len(age) // 2
        age[start : start + 10, j] = 10.0 * d.inputs.max_age_s[j] + 1.0
        if (run(d, sample._replace(age=age))[1].status[start : start + 10] == Status.OK).any():
            return f"a stale {name!r} still gives status OK"
    return None


def _refusals(d: Diagnoser, flight: Flight) -> str | None:
    for j, name in enumerate(d.inputs.names):
        if name in d.inputs.optional:
            continue
        without = {k: v for k, v in flight.measured.items() if k != name}
        other = {**flight.measured, name: flight.measured[name]._replace(unit="furlong")}
        for what, table in (("missing", without), ("in the wrong unit", other)):
            try:
                bind(Flight(table), d.inputs, d.dt_s, who=d.name)
            except AerofdiError as error:
                if name not in str(error) or d.name not in str(error):
                    return f"channel {name!r} {what}: the error does not name both sides: {error}"
            else:
                return f"channel {name!r} {what} was accepted"
        if d.inputs.units[j] == "":
            return f"input {name!r} has no unit; use '1' for a pure number"
    return None


def _something_happened(d: Diagnoser, sample: Sample, whole: Verdict) -> str | None:
    after = sample.t_s >= sample.t_s[0] + d.settle_s
    share = float(np.mean(whole.status[after] == Status.OK)) if after.any() else 0.0
    if share < OK_SHARE:
        return f"status is OK on {100 * share:.1f} % of the samples after settling, less than {100 * OK_SHARE:.0f} %"
    if not whole.detected.any():
        return "no alarm on a flight that should raise one"
    silent = whole.status != Status.OK
    if (whole.active[silent, 0]).any():
        return "it says healthy while its status is not OK"
    return None


_CLAUSES: tuple[Callable[[Diagnoser, Sample, Verdict], str | None], ...] = (
    _declaration,
    _shapes,
    _deterministic,
    _untouched,
    _split,
    _live,
    _bad_data,
)


def check_diagnoser(
    d: Diagnoser, flight: Flight, t0_s: float | None = None, t1_s: float | None = None, alarm: bool = True
) -> None:
    """Run the whole contract of a diagnoser on one flight that holds a fault; raise ContractError with every breach.

    Checked: declarations; shapes constant from sample 0; same in, same out; inputs untouched; split run = whole
    run and live = replay, bit for bit; NaN, inf and stale inputs give a Status and a finite state; missing channels
    and wrong units are refused with both sides named; and something happened: status OK on at least 95 % of the
    samples after settling and (unless alarm=False) an alarm.
    """
    sample = bind(flight, d.inputs, d.dt_s, t0_s, t1_s, who=d.name)
    if len(sample.t_s) < 30:
        raise ContractError(
            f"{d.name}: {flight.name} gives only {len(sample.t_s)} samples; at least 30 are needed"
        )
    _, whole = run(d, sample)
    broken = [text for clause in _CLAUSES if (text := clause(d, sample, whole))]
    broken += [text for text in (_refusals(d, flight),) if text]
    if alarm:
        broken += [text for text in (_something_happened(d, sample, whole),) if text]
    if broken:
        raise ContractError(f"{d.name} breaks the contract of a diagnoser: " + "; ".join(broken))
