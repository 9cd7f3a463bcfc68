"""Running a diagnoser: one pure step, or a whole sample through its compiled loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from .types import Array, Diagnoser, Request, Sample, Status, Verdict


def empty_verdict(d: Diagnoser, n: int) -> Verdict:
    """Run buffers for n samples: nothing detected, everything else "I do not say"."""
    nh, nr, nu = len(d.hypotheses), len(d.residuals), len(d.outputs.names)
    return Verdict(
        detected=np.zeros(n, dtype=np.bool_),
        active=np.zeros((n, nh), dtype=np.bool_),
        score=np.full((n, nh), np.nan),
        estimate=np.full((n, nh), np.nan),
        estimate_std=np.full((n, nh), np.nan),
        residual=np.full((n, nr), np.nan),
        threshold=np.full((n, nr), np.nan),
        excitation=np.zeros((n, nu)),
        request=np.full(n, int(Request.NONE), dtype=np.int64),
        status=np.full(n, int(Status.NOT_READY), dtype=np.int64),
    )


def copy_state(state: Any) -> Any:
    """A deep copy of a State (NamedTuples of arrays, nested)."""
    if isinstance(state, np.ndarray):
        return state.copy()
    if isinstance(state, tuple):
        return type(state)(*(copy_state(x) for x in state))
    return state


def step(d: Diagnoser, state: Any, z: Array, age: Array) -> tuple[Any, Verdict]:
    """The pure form: (state, one sample) -> (new state, verdict of that instant); inputs stay untouched."""
    new = copy_state(state)
    out = empty_verdict(d, 1)
    d.step_into(d.params, new, np.asarray(z, float), np.asarray(age, float), out, 0)
    return new, Verdict(*(field[0] for field in out))


def run(d: Diagnoser, sample: Sample, state: Any | None = None) -> tuple[Any, Verdict]:
    """Every row of a sample through the loop: (final state, verdicts with a leading time axis)."""
    new = d.init(d.params) if state is None else copy_state(state)
    out = empty_verdict(d, len(sample.t_s))
    d.run_into(d.params, new, np.ascontiguousarray(sample.z), np.ascontiguousarray(sample.age), out)
    return new, out
