"""Sensors read the right quantity at the right time, with the noise, bias, drift and delay they declare."""

import math

import numpy as np
import pytest

from aerofdi.core.errors import WrongUse
from aerofdi.dynamics.faults import Fault, fault_state, fault_table, faults_now
from aerofdi.dynamics.sensors import (
    TRUE,
    Sensor,
    sensor_offsets,
    sensor_order,
    sensor_params,
    sensor_state,
    sensors_start,
    sensors_step,
)

DT = 0.01


def read(sensors, truth, faults=(), n=400, seed=1, run=0):
    """channel -> samples, when channel c truly is truth(c, k)."""
    params, counts = sensor_offsets(sensor_params(sensors, DT, delay_faults=True), n)
    names = [sensors[i].channel for i in sensor_order(sensors, DT)]
    state = sensor_state(params, extra_delay_s=1.0)
    table = fault_table(faults, (), [(0.0, 1.0)], [0.0], names, DT)
    fstate, modified = fault_state(table, 1, len(names))
    record = np.full(sum(counts), -1e9)
    values = lambda k: np.array([truth(c, k) for c in TRUE])
    sensors_start(params, state, values(0), seed, run)
    for k in range(n):
        faults_now(table, fstate, modified, np.zeros(1), k * DT, 0.0, 0.0)
        sensors_step(params, state, modified.sensor, values(k), record, seed, run, k, k * DT)
    assert (record != -1e9).all()  # every place was written exactly once
    return {c: record[o : o + m] for c, o, m in zip(names, params.offset, counts, strict=True)}


def ramp(channel, k):
    return 1000.0 * list(TRUE).index(channel) + k


def test_each_sensor_reads_its_own_quantity_at_its_own_rate():
    sensors = [Sensor("p", 50.0), Sensor("airspeed", 10.0), Sensor("az", 100.0), Sensor("psi", 50.0)]
    out = read(sensors, lambda c, k: 0.01 * k if c == "psi" else ramp(c, k), n=101)
    np.testing.assert_array_equal(out["p"], ramp("p", 0) + np.arange(0, 101, 2))
    np.testing.assert_array_equal(out["airspeed"], ramp("airspeed", 0) + np.arange(0, 101, 10))
    np.testing.assert_array_equal(out["az"], ramp("az", 0) + np.arange(101))
    np.testing.assert_allclose(out["psi"], 0.02 * np.arange(51), atol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.03, 0.07])
def test_delay_is_not_off_by_one(delay):
    d = round(delay / DT)
    out = read([Sensor("q", 50.0, delay_s=delay), Sensor("r", 100.0)], ramp)
    np.testing.assert_array_equal(out["q"], ramp("q", 0) + np.maximum(np.arange(0, 400, 2) - d, 0))
    np.testing.assert_array_equal(out["r"], ramp("r", 0) + np.arange(400))


def test_noise_bias_and_drift_have_their_size():
    sensors = [
        Sensor("p", 100.0, sigma=0.3, bias=2.0, drift=0.5),
        Sensor("q", 100.0, sigma=0.3),
        Sensor("r", 100.0, walk=0.2),
        Sensor("ax", 100.0, bias_sigma=1.5),
    ]
    n, runs = 400, 60
    flights = [read(sensors, lambda c, k: 1.0, n=n, run=r) for r in range(runs)]
    p = np.array([f["p"] for f in flights]) - 1.0 - 2.0 - 0.5 * DT * np.arange(n)
    assert abs(p.mean()) < 5 * 0.3 / math.sqrt(n * runs)
    assert p.std() == pytest.approx(0.3, rel=5 / math.sqrt(2 * n * runs))
    q = np.array([f["q"] for f in flights]) - 1.0
    assert abs(np.mean(p * q)) < 5 * 0.09 / math.sqrt(n * runs)  # axes do not share their noise
    assert abs(np.mean(p[:, 1:] * p[:, :-1])) < 5 * 0.09 / math.sqrt(n * runs)
    walk = np.array([f["r"] for f in flights]) - 1.0
    assert walk[:, 0].std() == 0.0
    assert walk[:, -1].std() == pytest.approx(0.2 * math.sqrt((n - 1) * DT), rel=0.4)
    turn_on = np.array([f["ax"] for f in flights]) - 1.0
    assert np.ptp(turn_on, axis=1).max() < 1e-12 and turn_on[:, 0].std() == pytest.approx(1.5, rel=0.4)


def test_heading_is_wrapped_and_others_are_not():
    out = read([Sensor("psi", 100.0), Sensor("phi", 100.0)], lambda c, k: 0.05 * k)
    assert np.abs(out["psi"]).max() <= math.pi and out["phi"][-1] == pytest.approx(0.05 * 399)
    np.testing.assert_allclose(np.sin(out["psi"]), np.sin(0.05 * np.arange(400)), atol=1e-9)


def test_sensor_faults():
    base = [Sensor("p", 100.0, sigma=0.1), Sensor("q", 100.0, sigma=0.1)]
    healthy = read(base, ramp)["p"]

    def faulty(**kw):
        out = read(base, ramp, [Fault("sensor.p", start_s=1.0, end_s=2.0, **kw)])
        np.testing.assert_array_equal(out["q"], read(base, ramp)["q"])
        np.testing.assert_array_equal(out["p"][:100], healthy[:100])
        np.testing.assert_array_equal(out["p"][200:], healthy[200:])
        return out["p"][100:200], healthy[100:200]

    bad, good = faulty(mode="offset", value=3.0)
    np.testing.assert_allclose(bad - good, 3.0)
    bad, good = faulty(mode="drift", value=3.0)
    np.testing.assert_allclose(bad - good, 3.0 * DT * np.arange(100), atol=1e-9)
    bad, good = faulty(mode="stuck")
    assert (bad == healthy[99]).all()
    bad, good = faulty(mode="off")
    assert np.isnan(bad).all()
    bad, good = faulty(mode="noise", value=5.0)
    assert np.std(bad - good) == pytest.approx(5.0, rel=0.3)


def test_delay_fault_adds_exactly_its_delay():
    out = read([Sensor("p", 100.0)], ramp, [Fault("sensor.p", "delayed", 1.0, value=0.05)])["p"]
    np.testing.assert_array_equal(out[:100], np.arange(100))
    np.testing.assert_array_equal(out[100:], np.arange(100, 400) - 5)


@pytest.mark.parametrize(
    ("sensor", "word"),
    [
        (Sensor("p", 30.0), "divide"),
        (Sensor("smell", 50.0), "smell"),
        (Sensor("p", 50.0, sigma=-1.0), "sigma"),
        (Sensor("p", 0.0), "above 0"),
    ],
)
def test_impossible_sensors_are_refused(sensor, word):
    with pytest.raises(WrongUse, match=word):
        sensor_params([sensor], DT)
