"""Diagnosers on board see what bind would give them, act one sample later, within their budget."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from aerofdi.core import (
    HEALTHY,
    Channels,
    Diagnoser,
    Hypothesis,
    MissingChannel,
    Request,
    Status,
    WrongUse,
    bind,
    run,
)
from aerofdi.scenarios import WindSpec, load_scenario
from aerofdi.simulate import fly, fly_with

SHORT = replace(load_scenario("demo"), duration_s=5.0, faults=())
RAD = np.pi / 180


class Params(NamedTuple):
    size: np.ndarray


class State(NamedTuple):
    count: np.ndarray


def step_into(params, state, z, age, out, k):
    """Says what it reads; shakes the right elevon at 1 Hz; asks for level flight from its 100th sample on."""
    n = state.count[0]
    out.status[k] = Status.OK if np.isfinite(z[:3]).all() else Status.NOT_READY
    out.residual[k, :] = z
    out.threshold[k, :] = age
    if len(params.size):
        out.excitation[k, 0] = params.size[0] * np.sin(2 * np.pi * 0.02 * n)
        out.request[k] = Request.HOLD_LEVEL if n >= 100 else Request.NONE
    state.count[0] += 1


def run_into(params, state, z, age, out):
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def make(
    dt=0.02, size=(), budget=(), names=("p", "altitude", "command.elevon_right"), units=("rad/s", "m", "rad")
):
    outputs = ("excitation.elevon_right",) if size else ()
    if size:
        names, units = (*names, "excitation.elevon_right"), (*units, "rad")
    return Diagnoser(
        "probe", Channels(names, units, (0.1,) * len(names)), Channels(outputs, ("rad",) * len(outputs)),
        (HEALTHY, Hypothesis("elevon_right", "stuck", "rad", "elevon")), dt, bool(size), Params(np.array(size)),
        lambda p: State(np.zeros(1)), step_into, run_into, tuple(names), budget,
    )  # fmt: skip


@pytest.mark.parametrize("dt", [1 / 92, 0.02, 0.1])
@pytest.mark.parametrize("altitude_hz,behind", [(92.0, 0), (4.0, 0), (4.0, 3), (92.0, 1)])
def test_live_is_replay_bit_for_bit(dt, altitude_hz, behind):
    """Faster channels are averaged, slower ones held, or read some samples behind: on board as in `bind`."""
    s = replace(SHORT, sensors={"altitude": {"rate_hz": altitude_hz}})
    on_board = [make(dt), make(dt, (2 * RAD,), (3 * RAD,))]
    on_board = [d._replace(inputs=d.inputs._replace(behind_s=behind * dt)) for d in on_board]
    flown = fly_with(s, on_board)
    for d, watched in zip(on_board, flown.verdicts, strict=True):
        sample = bind(flown.flight, d.inputs, d.dt_s, 0.0, 5.0, who=d.name)
        _, replay = run(d, sample)
        n = min(len(sample.t_s), len(watched.t_s))
        assert n >= 5.0 / dt - 1
        for field, ours, theirs in zip(replay._fields, watched.verdict, replay, strict=True):
            np.testing.assert_array_equal(ours[:n], theirs[:n], err_msg=field)


def test_a_passive_diagnoser_changes_nothing():
    with_it, without = fly_with(SHORT, [make()]).flight, fly(SHORT)
    for name, series in without.measured.items():
        np.testing.assert_array_equal(series.value, with_it.measured[name].value)


def test_excitation_starts_one_sample_later_and_is_clipped_to_the_budget():
    calm = replace(
        SHORT,
        wind=WindSpec(),
        noise_factor=0.0,
        guidance=SHORT.guidance._replace(lateral="heading", track=None),
    )
    flown = fly_with(calm, [make(0.05, (4 * RAD,), (2 * RAD,))])
    added = flown.flight.measured["excitation.elevon_right"]
    wish = flown.verdicts[0].verdict.excitation[:, 0]
    assert added.value[0] == 0.0
    n = len(added.value) - 1
    np.testing.assert_allclose(added.value[1:], np.clip(wish, -2 * RAD, 2 * RAD)[:n], atol=1e-15)
    assert np.abs(added.value).max() == 2 * RAD and np.abs(wish).max() > 3.9 * RAD
    np.testing.assert_allclose(added.t_s, 0.05 * np.arange(n + 1), atol=1 / 184)
    plain = fly(calm)
    moved = np.abs(
        flown.flight.truth["surface.elevon_right"].value - plain.truth["surface.elevon_right"].value
    )
    t = plain.truth["surface.elevon_right"].t_s
    first = t[np.argmax(moved > 1e-9)]
    # verdict 1 (t = 0.05 s) is the first with an excitation; it acts at 0.10 s and arrives 0.05 s of delay
    # later
    assert 0.15 < first <= 0.15 + 2 / 92


def test_excitations_of_two_diagnosers_add_up():
    a, b = make(0.05, (1 * RAD,), (3 * RAD,)), make(0.05, (2 * RAD,), (3 * RAD,))
    flown = fly_with(replace(SHORT, duration_s=1.5), [a, b])
    added = flown.flight.measured["excitation.elevon_right"].value
    both = flown.verdicts[0].verdict.excitation[:, 0] + flown.verdicts[1].verdict.excitation[:, 0]
    np.testing.assert_allclose(added[1:], both[: len(added) - 1], atol=1e-15)


def test_hold_level_levels_the_wings_in_the_middle_of_a_turn():
    turning = replace(
        SHORT,
        duration_s=12.0,
        guidance=SHORT.guidance._replace(
            lateral="bank", track=None, points=(SHORT.guidance.points[0]._replace(angle=0.5),)
        ),
    )
    asking, quiet = make(0.05, (0.0,), (1.0,)), make(0.05)
    level, turn = fly_with(turning, [asking]).flight, fly_with(turning, [quiet]).flight
    t = level.truth["phi"].t_s
    np.testing.assert_array_equal(level.truth["phi"].value[t < 5.0], turn.truth["phi"].value[t < 5.0])
    assert turn.truth["phi"].value[-1] > 0.35
    assert abs(level.truth["phi"].value[-1]) < 0.15
    mode = level.measured["mode"]
    assert mode.t_s[np.argmax(mode.value > 0)] == pytest.approx(5.05, abs=1 / 92)
    assert [e.text for e in level.events if e.kind == "mode"] == ["hold_level"]


def test_what_does_not_fit_is_refused_by_name():
    with pytest.raises(MissingChannel, match=r"'beta'.*probe.*demo"):
        fly_with(SHORT, [make(names=("p", "beta", "altitude"), units=("rad/s", "rad", "m"))])
    with pytest.raises(WrongUse, match="deg/s"):
        fly_with(SHORT, [make(units=("deg/s", "m", "rad"))])
    strange = make(size=(0.1,), budget=(0.1,))._replace(outputs=Channels(("excitation.rudder",), ("rad",)))
    with pytest.raises((WrongUse, MissingChannel), match=r"excitation\.rudder"):
        fly_with(SHORT, [strange])
