"""Parity: residual zero when the model is right, alarm when a surface stops, threshold as requested."""

import math

import numpy as np
import pytest
import synthetic as syn

from aerofdi.core import Flight, Series, Status, WrongUse, bind, check_diagnoser, run
from aerofdi.design.parity import calibrate_threshold
from aerofdi.diagnosers import parity_setup
from aerofdi.diagnosers.parity import from_linear
from aerofdi.identify import identify
from aerofdi.parts.servo import servo_coefficients

DT = 0.01
LP, LD = -8.0, -60.0


RATE = math.radians(120.0)


def exact(threshold=0.1, rate=RATE, trim=0.0, airspeed=None):
    servo = servo_coefficients(2, 50.0, 0.8, lower=-0.4, upper=0.3, rate=rate, dt_s=DT).reshape(1, -1)
    return from_linear(
        np.array([[LP]]), np.array([[LD]]), np.eye(1), dt_s=DT, commands=["command.aileron"], servo=servo,
        delay_s=0.05, mix=np.eye(1), outputs=["p"], threshold=[threshold], bandwidth=4.0, start=np.eye(1),
        trim=[trim], airspeed=airspeed,
    )  # fmt: skip


def flight(stuck_at=math.inf, seconds=20.0):
    """The same servo and rate dynamics integrated with a thousand small steps a second."""
    n = round(seconds / DT)
    t = DT * np.arange(n)
    u = 0.25 * np.sign(np.sin(1.3 * t)) + 0.1 * np.sin(4.0 * t)
    fine, x, v, p = 20, 0.0, 0.0, np.zeros(n)
    h = DT / fine
    rate, w, z = 0.0, 50.0, 0.8
    frozen = None
    for k in range(n):
        p[k] = rate
        command = np.clip(u[max(k - 5, 0)] if k >= 5 else u[0], -0.4, 0.3)
        if k == 0:
            x = command
        for _ in range(fine):
            acc = w * w * (command - x) - 2 * z * w * v
            v = float(np.clip(v + h * acc, -math.radians(120.0), math.radians(120.0)))
            x = float(np.clip(x + h * v, -0.4, 0.3))
            if t[k] >= stuck_at:
                frozen = x if frozen is None else frozen
                x, v = frozen, 0.0
            rate += h * (LP * rate + LD * x)
    return Flight({"p": Series(t, p, "rad/s"), "command.aileron": Series(t, u, "rad")})


def test_an_exact_model_leaves_no_residual_through_limits_rate_and_delay():
    d = exact()
    v = run(d, bind(flight(), d.inputs, DT))[1]
    ok = v.status == Status.OK
    assert ok.mean() > 0.9 and not v.detected.any()
    assert np.abs(v.residual[ok]).max() < 0.06, "only the finite steps of the reference remain"


def test_a_model_without_the_rate_limit_is_wrong_by_much_more():
    d = exact(rate=math.inf)
    v = run(d, bind(flight(), d.inputs, DT))[1]
    assert np.abs(v.residual[v.status == Status.OK]).max() > 0.15


def test_the_model_is_about_the_trim_it_is_told():
    """A trim that is not there shows as its steady rate: 0 = LP p + LD (delta - trim)."""
    residual = []
    for trim in (0.0, 0.05):
        d = exact(trim=trim)
        residual.append(run(d, bind(flight(), d.inputs, DT))[1].residual[-500:, 0])
    np.testing.assert_allclose(residual[1] - residual[0], LD / LP * 0.05, rtol=1e-3)


def test_surfaces_act_as_the_airspeed_is():
    """At 1.2 times the reference airspeed the prediction from the same commands is 1.2 times as large."""
    f = flight()
    n = len(f.measured["p"].t_s)
    f = f.with_measured(airspeed=f.measured["p"]._replace(value=np.full(n, 24.0), unit="m/s"))
    still = f.with_measured(p=f.measured["p"]._replace(value=np.zeros(n)))
    plain = run(exact(), bind(still, exact().inputs, DT))[1].residual[-1000:, 0]
    d = exact(airspeed=20.0)
    scaled = run(d, bind(still, d.inputs, DT))[1].residual[-1000:, 0]
    np.testing.assert_allclose(scaled, 1.2 * plain, atol=1e-9)
    assert np.abs(plain).max() > 0.5


def test_a_stuck_surface_raises_the_alarm():
    d = exact()
    t = bind(flight(), d.inputs, DT).t_s
    v = run(d, bind(flight(stuck_at=10.0), d.inputs, DT))[1]
    assert not v.detected[t < 10.0].any()
    assert 10.0 < t[v.detected.argmax()] < 13.5
    assert not v.active[v.detected].any(), "parity detects, it does not isolate"


def test_the_contract():
    check_diagnoser(exact(), flight(stuck_at=10.0))


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(WrongUse, match="shapes do not fit"):
        from_linear(np.eye(1), np.eye(2), np.eye(1), dt_s=DT, commands=["c"], servo=np.zeros((1, 8)), delay_s=0.0,
                    mix=np.eye(1), outputs=["p"], threshold=[1.0], bandwidth=1.0)  # fmt: skip
    with pytest.raises(WrongUse, match="threshold"):
        exact(threshold=-1.0)


def test_identified_model_healthy_silent_then_alarm():
    m = identify([(syn.fly(90.0, seed=1), 0.0, 90.0)])
    ages = dict.fromkeys(m.channels, 0.2)
    loose = parity_setup.from_identified(m, ages)
    healthy = run(loose, bind(syn.fly(90.0, seed=1), loose.inputs, loose.dt_s))[1]
    ok = healthy.status == Status.OK
    limits = tuple(calibrate_threshold(healthy.residual[ok, i], loose.dt_s, 0.1) for i in range(2))
    d = parity_setup.from_identified(m, ages, limits)
    for seed in (30, 31, 32):
        assert not run(d, bind(syn.fly(60.0, seed=seed), d.inputs, d.dt_s))[1].detected.any()
    bad = syn.fly(60.0, seed=33, stuck={"aileron": 0.25}, start_s=30.0)
    s = bind(bad, d.inputs, d.dt_s)
    v = run(d, s)[1]
    assert v.detected.any() and s.t_s[v.detected.argmax()] > 30.0


def test_threshold_meets_the_requested_rate_on_noise_it_has_not_seen():
    rng = np.random.default_rng(0)
    pole = math.exp(-0.02 / 0.5)

    def noise(n):
        from scipy.signal import lfilter

        return lfilter([1.0], [1.0, -pole], rng.normal(size=n))

    limit = calibrate_threshold(noise(15_000), 0.02, 1.0)
    seen = np.abs(noise(50 * 180_000)) > limit
    alarms = np.sum(np.diff(seen.astype(int)) == 1)
    assert alarms <= 1.0 * 50 + 3 * math.sqrt(50), "at most the requested one an hour over fifty hours"
    assert limit < 12.0 * noise(15_000).std(), "and not by never alarming"
