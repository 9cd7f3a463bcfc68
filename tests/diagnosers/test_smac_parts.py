"""The parts of SMAC against their formulas: detector (5), evaluator (17), its variance, the wind measure."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from aerofdi.core import Status, empty_verdict
from aerofdi.diagnosers import smac
from aerofdi.diagnosers import smac_types as t
from aerofdi.diagnosers.smac_health import (
    MODEL,
    WAVER,
    evaluate_health,
    listen,
    watch_commands,
    window_variance,
)
from aerofdi.diagnosers.smac_verdict import say
from aerofdi.papers.smac.methods import design, diagnoser

DEG = math.pi / 180.0


def low_pass(share, x):
    return lfilter([share], [1.0, share - 1.0], x, axis=0)


def test_detector_is_5_through_the_second_low_pass_with_release():
    """The flag rises above the threshold and falls below the share `release` of it."""
    p = t.unflatten(design("printed").params)
    d, s = p.detector._replace(release=0.5), t.init(p)
    assert d.rule == t.SUM
    s.misc[t.SCALE : t.SCALE + 6] = 1.0
    random = np.random.default_rng(1)
    residual = 0.02 * random.standard_normal((1500, 3))
    residual[300:700] += [0.03, -0.02, 0.01]
    gamma2 = low_pass(d.a2, np.abs(low_pass(d.a1, residual)).sum(axis=1))
    flags = []
    for k in range(len(residual)):
        s.axes[:, t.RESIDUAL] = residual[k]
        smac.detect(d, s)
        assert s.misc[t.GAMMA2] == pytest.approx(gamma2[k], rel=1e-9)
        flags.append(int(s.clock[t.FLAG]))
    wanted, on = [], 0
    for g in gamma2:
        on = int(g > d.threshold * (d.release if on else 1.0))
        wanted.append(on)
    assert flags == wanted and sum(np.abs(np.diff(flags))) == 2
    assert ((gamma2 < d.threshold) & np.array(flags, bool)).any(), "the release is put to the test"


def test_rectified_evaluator_is_17():
    """Lambda = LP | delta_s(k - lambda) + LP(delta_c - mean) / kappa |, the mean by a low-pass at f_i1."""
    p = t.unflatten(design("printed").params)
    probe, s, i, n = p.probe, t.init(p), 2, 200
    k = np.arange(n)
    added = 2.0 * DEG * np.sin(2.0 * math.pi * p.model.dt * k)
    command = 0.05 + 0.6 * np.roll(added, 9) + 0.01 * np.sin(0.9 * k)
    lag, kappa = int(probe.place[i, t.LAG]), float(probe.surface[i, t.REPLY])
    high = command - low_pass(probe.a_mean, command)
    delayed = np.concatenate([np.zeros(lag), added[: n - lag]])
    wanted = low_pass(probe.a_lambda, np.abs(delayed + low_pass(probe.a_noise, high) / kappa))
    z = np.zeros(len(p.max_age))
    s.count[i, t.EXCITED] = 1
    for j in k:
        z[t.FIRST + i], z[t.FIRST + 5 + i] = command[j], added[j]
        watch_commands(probe, s, z, t.FIRST, 5)
        evaluate_health(p, s)
        s.clock[t.INDEX] += 1
        assert s.surface[i, t.LAMBDA] == pytest.approx(wanted[j], rel=1e-9, abs=1e-15)
    assert lag > 0 and wanted[-1] > 0.2 * 2.0 * DEG


def test_variance_of_the_lost_share_is_that_of_many_windows():
    """The noise heard before a test tells how far one window's estimate scatters."""
    p = t.unflatten(design("ordered").params)
    probe, i = p.probe._replace(method=t.SYNCHRONOUS), 0
    s, n, omega = t.init(p), probe.window, probe.surface[0, t.PHASE]
    A, R0 = probe.surface[i, t.AMPLITUDE], complex(*probe.surface[i, [t.HEALTHY_RE, t.HEALTHY_IM]])
    command = lfilter([1.0], [1.0, -0.9], 0.003 * np.random.default_rng(2).standard_normal(400 * n))
    z = np.zeros(len(p.max_age))
    for j, c in enumerate(command):
        z[t.FIRST + i] = c
        watch_commands(probe, s, z, t.FIRST, 5)
        s.clock[t.INDEX] += 1
        if j >= n:
            listen(probe, s, 0.0)
    high = command - low_pass(probe.a_mean, command)
    blocks = high[n:].reshape(-1, n) @ np.exp(-1j * omega * np.arange(n)) * 2.0 / n
    lost = -(blocks / (A * R0)).real
    assert lost.var() > MODEL
    assert window_variance(probe, s, i) - MODEL == pytest.approx(lost.var(), rel=0.2)
    s.count[i, t.LABEL] = 1
    assert window_variance(probe, s, i) - WAVER == pytest.approx(lost.var(), rel=0.2)


def test_vanes_raise_the_thresholds_and_their_own_noise_does_not():
    p = t.unflatten(design("together").params)
    for swing, noise in ((0.0, 0.049), (6.0 * DEG, 0.0)):
        s, z = t.init(p), np.zeros(len(p.max_age))
        random = np.random.default_rng(3)
        for k in range(3000):
            z[t.ALPHA] = (
                0.09
                + swing * math.sin(2.0 * math.pi * 0.2 * p.model.dt * k)
                + noise * random.standard_normal()
            )
            z[t.BETA] = noise * random.standard_normal()
            smac.follow_wind(p, s, z)
            s.clock[t.READY] += 1
        scale = s.misc[t.SCALE : t.SCALE + 3]
        gain = p.detector.wind_gain
        if swing:
            power = s.misc[t.WIND_POWER]
            assert scale == pytest.approx(np.sqrt(1.0 + gain**2 * (power - p.detector.wind_floor)))
            # Between the low-passes at 0.05 and 0.5 Hz a swing at 0.2 Hz loses little.
            assert 0.5 < power / (0.5 * swing**2) < 1.0 and scale[0] > 5.0
        else:
            assert (scale < 1.6).all()


def flown_level(d, n, change):
    """The diagnoser on rates and commands of level flight, noise-free; change(k, z, age)."""
    z, age = np.zeros(len(d.inputs.names)), np.zeros(len(d.inputs.names))
    z[[t.AIRSPEED, t.ALTITUDE, t.ALPHA, t.THETA]] = 30.0, 200.0, 0.0882, 0.0882
    z[[12, 13]] = -0.02355
    state, out = d.init(d.params), empty_verdict(d, n)
    for k in range(n):
        change(k, z, age)
        d.step_into(d.params, state, z, age, out, k)
        yield k, state, out


@pytest.mark.parametrize("lost", [5, 60])
def test_filter_begins_at_the_rates_after_a_gap_and_settles_again_after_a_long_one(lost):
    d = diagnoser("together")
    back = 500 + lost
    assert (lost > d.params.probe.window) == (lost == 60)

    def change(k, z, age):
        age[0] = 9.0 if 500 <= k < back else 0.0
        z[t.P] = 0.3 if k >= back else 0.0

    for k, state, out in flown_level(d, back + 1, change):
        if k == back:
            assert state.axes[0, t.RESIDUAL] == 0.0, "a rate that changed unseen is no residual"
            assert out.status[k] == (Status.NOT_READY if lost == 60 else Status.OK)
        elif k >= 500:
            assert out.status[k] == Status.STALE_INPUT


def test_angle_in_gusts_is_as_much_less_certain_as_the_threshold_is_higher():
    d = smac.from_design(design("together"))
    said = []
    for scale in (1.0, 3.0):
        s, out = t.init(d.params), empty_verdict(d, 1)
        s.misc[t.SCALE : t.SCALE + 3] = scale
        s.count[3, t.LABEL] = 1
        say(d.params, s, 0, out, 0)
        said.append(out.estimate_std[0, 1 + 2 * 3])
    assert said[0] == d.params.probe.surface[3, t.ANGLE_STD] and said[1] == pytest.approx(3.0 * said[0])
