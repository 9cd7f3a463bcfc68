"""check_diagnoser passes a good diagnoser and catches each kind of bad one."""

from typing import NamedTuple

import numpy as np
import pytest

from aerofdi.core import (
    HEALTHY,
    Channels,
    ContractError,
    Diagnoser,
    Flight,
    Hypothesis,
    Request,
    Series,
    Status,
    Verdict,
    check_diagnoser,
    run,
    step,
)
from aerofdi.core.bind import bind


class Params(NamedTuple):
    limit: float
    age: float


class State(NamedTuple):
    mean: np.ndarray


def init(params):
    return State(np.zeros(1))


def step_into(params, state, z, age, out, k):
    if not np.isfinite(z[0]) or age[0] > params.age:
        out.status[k] = Status.NONFINITE if not np.isfinite(z[0]) else Status.STALE_INPUT
        return
    state.mean[0] += 0.1 * (z[0] - state.mean[0])
    out.status[k] = Status.OK
    out.detected[k] = abs(state.mean[0]) > params.limit
    out.active[k, 0] = not out.detected[k]
    out.active[k, 1] = out.detected[k]
    out.score[k, 1] = abs(state.mean[0])


def run_into(params, state, z, age, out):
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


GOOD = Diagnoser(
    "mean", Channels(("p",), ("rad/s",), (0.5,)), Channels((), ()), (HEALTHY, Hypothesis("p", "offset", "rad/s", "p")),
    0.1, False, Params(1.0, 0.5), init, step_into, run_into,
)  # fmt: skip
T = np.arange(0, 20, 0.1)
FAULTY = Flight({"p": Series(T, np.where(T > 10, 3.0, 0.0), "rad/s")})


def test_a_good_diagnoser_passes():
    check_diagnoser(GOOD, FAULTY)


def test_run_and_live_steps_agree():
    sample = bind(FAULTY, GOOD.inputs, 0.1)
    _, whole = run(GOOD, sample)
    state = GOOD.init(GOOD.params)
    for k in range(len(sample.t_s)):
        state, now = step(GOOD, state, sample.z[k], sample.age[k])
        assert now.detected == whole.detected[k]
    assert whole.detected.any() and int(now.request) == Request.NONE


def breaks(words, **changes):
    with pytest.raises(ContractError, match=words):
        check_diagnoser(GOOD._replace(**changes), FAULTY)


def test_hidden_memory_is_caught():
    seen = []

    def forgetful(params, state, z, age, out):
        seen.append(1)
        run_into(params._replace(limit=len(seen) * 0.3), state, z, age, out)

    breaks("two different verdicts", run_into=forgetful)


def test_a_step_that_writes_its_inputs_is_caught():
    def vandal(params, state, z, age, out, k):
        step_into(params, state, z, age, out, k)
        z[0] = 7.0

    breaks("changed its inputs", step_into=vandal)


def test_a_loop_that_differs_from_the_step_is_caught():
    def other(params, state, z, age, out):
        run_into(params, state, z, age, out)
        out.score[5, 1] += 1.0

    breaks("live and replay differ at sample 5", run_into=other)


def test_saying_ok_on_nan_is_caught():
    def blind(params, state, z, age, out, k):
        step_into(params, state, np.nan_to_num(z, posinf=0.0), np.zeros(1), out, k)

    def blind_run(params, state, z, age, out):
        for k in range(len(z)):
            blind(params, state, z[k], age[k], out, k)

    breaks("still gives status OK", step_into=blind, run_into=blind_run)


def test_silence_is_caught():
    breaks("no alarm", params=Params(99.0, 0.5))


def test_a_first_hypothesis_that_is_not_healthy_is_caught():
    breaks("HEALTHY", hypotheses=(Hypothesis("p", "offset", "rad/s", "p"), HEALTHY))


def test_every_status_says_what_to_do():
    assert all(len(s.text) > 5 for s in Status)
    assert isinstance(Verdict._fields, tuple)
