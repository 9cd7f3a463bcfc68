"""Effectiveness finds, names and measures loss and stuck surfaces; silent while healthy, it says what it cannot."""

import numpy as np
import pytest
import synthetic as syn

from aerofdi.core import CannotJudge, Status, bind, check_diagnoser, run
from aerofdi.diagnosers.effectiveness_setup import from_identified
from aerofdi.identify import identify


@pytest.fixture(scope="module")
def model():
    return identify([(syn.fly(120.0, seed=1), 0.0, 120.0)], "synthetic")


@pytest.fixture(scope="module")
def diagnoser(model):
    return from_identified(model, dict.fromkeys(model.channels, 0.2))


def judge(d, flight, t0=0.0, t1=None):
    sample = bind(flight, d.inputs, d.dt_s, t0, t1)
    return sample.t_s, run(d, sample)[1]


def named(d, verdict, k=-1):
    active = np.flatnonzero(verdict.active[k])
    return [(d.hypotheses[i].fault, d.hypotheses[i].mode) for i in active]


@pytest.mark.parametrize("seed", range(10, 16))
def test_silent_over_healthy_flight(diagnoser, seed):
    _, v = judge(diagnoser, syn.fly(90.0, seed=seed))
    assert not v.detected.any()
    assert np.mean(v.status == Status.OK) > 0.95 and v.active[-1, 0]


@pytest.mark.parametrize("surface,hypothesis", [("aileron", 1), ("elevator", 3)])
@pytest.mark.parametrize("left", [0.3, 0.5])
def test_a_loss_is_named_and_measured(diagnoser, surface, hypothesis, left):
    t, v = judge(diagnoser, syn.fly(90.0, seed=3, gain={surface: left}, start_s=40.0))
    assert not v.detected[t < 40.0].any() and v.detected[-1]
    assert named(diagnoser, v) == [(surface, "loss_of_effectiveness")]
    late = t > 60.0
    assert np.nanmedian(v.estimate[late, hypothesis]) == pytest.approx(left, abs=0.15)
    assert 0.02 < np.nanmedian(v.estimate_std[late, hypothesis]) < 0.25


@pytest.mark.parametrize(
    "surface,hypothesis,position", [("aileron", 2, 0.08), ("elevator", 4, 0.02), ("aileron", 2, -0.1)]
)
def test_a_stuck_surface_is_named_and_its_position_measured(diagnoser, surface, hypothesis, position):
    t, v = judge(diagnoser, syn.fly(60.0, seed=4, stuck={surface: position}, start_s=30.0))
    assert not v.detected[t < 30.0].any()
    assert named(diagnoser, v) == [(surface, "stuck")]
    assert np.nanmedian(v.estimate[t > 45.0, hypothesis]) == pytest.approx(position, abs=0.06)


@pytest.mark.parametrize("healthy_s", [5.0, 20.0, 60.0])
def test_the_healthy_time_before_a_fault_does_not_matter(diagnoser, healthy_s):
    t, v = judge(diagnoser, syn.fly(healthy_s + 30.0, seed=5, stuck={"aileron": 0.1}, start_s=healthy_s))
    assert not v.detected[t < healthy_s].any()
    assert (t[v.detected.argmax()] - healthy_s) < 8.0


def test_recovery_is_noticed_and_a_second_fault_found(diagnoser):
    first = syn.fly(60.0, seed=6, gain={"aileron": 0.2}, start_s=25.0)
    healthy = syn.fly(60.0, seed=7)
    second = syn.fly(60.0, seed=8, gain={"aileron": 0.2}, start_s=20.0)
    joined = first
    for extra, shift in ((healthy, 60.0), (second, 120.0)):
        merged = {
            n: s._replace(t_s=np.concatenate((s.t_s, extra.measured[n].t_s + shift)),
                          value=np.concatenate((s.value, extra.measured[n].value)))
            for n, s in joined.measured.items()
        }  # fmt: skip
        joined = joined.with_measured(**merged)
    t, v = judge(diagnoser, joined)
    assert v.detected[(t > 45.0) & (t < 59.0)].all()
    assert not v.detected[(t > 100.0) & (t < 139.0)].any()
    assert v.detected[t > 165.0].all()


@pytest.mark.parametrize("behind_s", [0.0, 0.06])
def test_the_contract(model, behind_s):
    diagnoser = from_identified(model, dict.fromkeys(model.channels, 0.2), behind_s=behind_s)
    check_diagnoser(diagnoser, syn.fly(60.0, seed=9, stuck={"aileron": 0.1}, start_s=30.0))


def test_gaps_and_nan_freeze_the_verdict_and_say_why(diagnoser):
    f = syn.fly(40.0, seed=11)
    s = f.measured["p"]
    value = s.value.copy()
    value[1000:1100] = np.nan
    keep = (s.t_s < 30.0) | (s.t_s > 32.0)
    t, v = judge(diagnoser, f.with_measured(p=s._replace(t_s=s.t_s[keep], value=value[keep])))
    assert (v.status[(t > 20.3) & (t < 21.9)] == Status.STALE_INPUT).all()
    assert (v.status[(t > 30.3) & (t < 31.9)] == Status.STALE_INPUT).all()
    assert not v.detected.any() and not v.active[v.status != Status.OK, 0].any()


def test_saturated_commands_stay_finite_and_the_fault_stays_named(diagnoser):
    f = syn.fly(60.0, seed=12, stuck={"aileron": 0.3}, start_s=20.0)
    _, v = judge(diagnoser, f)
    assert np.abs(f.measured["command.aileron"].value[-500:]).max() > 0.0
    assert np.isfinite(v.score[v.status == Status.OK]).all()
    assert v.detected[-1] and named(diagnoser, v) == [("aileron", "stuck")]


def test_airspeed_change_is_not_a_fault_when_airspeed_is_measured():
    def speed(t):
        return 1.0 + 0.12 * np.sin(0.15 * t)

    m = identify([(syn.fly(120.0, seed=20, speed=speed), 0.0, 120.0)])
    d = from_identified(m, dict.fromkeys(m.channels, 0.2))
    _, v = judge(d, syn.fly(90.0, seed=21, speed=speed))
    assert not v.detected.any()
    outside = syn.fly(40.0, seed=22, speed=lambda t: 1.0 if t < 20 else 0.55)
    t, v = judge(d, outside)
    assert (v.status[t > 25.0] == Status.OUT_OF_ENVELOPE).all() and not v.active[-1, 0]


def test_plain_python_gives_the_same_verdict():
    import os
    import subprocess
    import sys
    from pathlib import Path

    code = (
        "import numpy as np, synthetic as syn; from aerofdi.core import bind, run;"
        "from aerofdi.aircraft.identified import load_identified;"
        "from aerofdi.diagnosers.effectiveness_setup import from_identified; import sys;"
        "m = load_identified(sys.argv[1]); d = from_identified(m, dict.fromkeys(m.channels, 0.2));"
        "f = syn.fly(8.0, seed=4, stuck={'aileron': 0.2}, start_s=3.0);"
        "v = run(d, bind(f, d.inputs, d.dt_s))[1];"
        "np.save(sys.argv[2], np.column_stack((v.score, v.detected)))"
    )
    import tempfile

    from aerofdi.aircraft.identified import save_identified

    m = identify([(syn.fly(30.0, seed=1), 0.0, 30.0)])
    with tempfile.TemporaryDirectory() as folder:
        save_identified(m, Path(folder) / "m.toml")
        out = []
        for disabled in ("0", "1"):
            target = Path(folder) / f"{disabled}.npy"
            env = os.environ | {"NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": str(Path(syn.__file__).parent)}
            subprocess.run(
                [sys.executable, "-c", code, str(Path(folder) / "m.toml"), str(target)], env=env, check=True
            )
            out.append(np.load(target))
    np.testing.assert_allclose(out[0], out[1], rtol=1e-9, atol=1e-9)
    assert out[0][-1, -1] == 1.0, "an alarm was raised in both"


def test_a_group_nobody_answers_has_no_hypotheses_and_changes_nothing_else(model, diagnoser):
    idle = model._replace(
        groups=tuple(g._replace(identifiable=g.name != "elevator") for g in model.groups),
        calibration={"effectiveness_alarm": (12.0,), "parity_threshold": (0.5, 0.3)},
    )
    from aerofdi.pipeline.train import Timing, diagnosers

    when = Timing(dict.fromkeys(model.channels, 0.2), 0.0)
    parity, one = diagnosers(idle, when)
    assert parity.name == "parity" and {h.fault for h in one.hypotheses} == {"none", "aileron"}
    f = syn.fly(60.0, seed=4, stuck={"aileron": 0.08}, start_s=30.0)
    (t, v), (_, both) = judge(one, f), judge(diagnoser, f)
    assert not v.detected[t < 30.0].any() and named(one, v) == [("aileron", "stuck")]
    np.testing.assert_allclose(v.residual, both.residual)
    none = idle._replace(groups=tuple(g._replace(identifiable=False) for g in idle.groups))
    assert [d.name for d in diagnosers(none, when)] == ["parity"]


def test_a_model_without_thresholds_is_refused(model):
    from aerofdi.pipeline.train import Timing, diagnosers

    with pytest.raises(CannotJudge, match=r"synthetic has no thresholds.*--healthy"):
        diagnosers(model, Timing(dict.fromkeys(model.channels, 0.2), 0.0))
