"""Scores: every rule of the docstring on verdicts written by hand."""

import math

import numpy as np
import pytest

from aerofdi.core import HEALTHY, Hypothesis, Status, Verdict, WrongUse
from aerofdi.evaluate import Fault, confusion, rising_edges, score, summarise

DT = 0.1
TABLE = (HEALTHY, Hypothesis("left", "stuck", "rad", "pair"), Hypothesis("right", "stuck", "rad", "pair"))


def verdict(n=1000, alarms=(), named=(), estimate=(), bad=()):
    """alarms: (t0, t1); named: (hypothesis, t0, t1); estimate: (hypothesis, value); bad: (t0, t1)."""
    t = DT * np.arange(n)
    v = Verdict(
        np.zeros(n, bool), np.zeros((n, 3), bool), np.full((n, 3), np.nan), np.full((n, 3), np.nan),
        np.full((n, 3), np.nan), np.zeros((n, 1)), np.zeros((n, 1)), np.zeros((n, 0)), np.zeros(n, int),
        np.full(n, int(Status.OK)),
    )  # fmt: skip
    for t0, t1 in alarms:
        v.detected[(t >= t0) & (t < t1)] = True
    for i, t0, t1 in named:
        v.active[(t >= t0) & (t < t1), i] = True
    for i, x in estimate:
        v.estimate[:, i] = x
        v.estimate_std[:, i] = 0.01
    for t0, t1 in bad:
        v.status[(t >= t0) & (t < t1)] = int(Status.NONFINITE)
    return t, v


def test_a_plain_detection():
    t, v = verdict(alarms=[(52, 80)], named=[(2, 53, 80)], estimate=[(2, -0.1)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0, -0.09)])
    (d,) = s.detections
    assert d.delay_s == pytest.approx(2.0) and d.isolation_s == pytest.approx(3.0)
    assert d.isolated == "right/stuck" and d.correct and not d.missed and d.others == ()
    assert d.error == pytest.approx(-0.01) and d.estimate_std == 0.01
    assert s.false_alarms == 0 and s.ok_share == 1.0
    # Healthy: before the fault and from ten seconds after its end.
    assert s.healthy_s == pytest.approx(50 + (100 - 90))


def test_a_missed_fault_is_infinitely_late():
    t, v = verdict()
    (d,) = score(t, v, TABLE, [Fault("right", "stuck", 50.0)]).detections
    assert d.missed and d.delay_s == math.inf and d.isolated == "none" and not d.correct


def test_an_alarm_that_was_on_before_earns_nothing():
    t, v = verdict(alarms=[(45, 70)], named=[(2, 45, 70)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 70.0)])
    assert s.false_alarms == 1 and s.detections[0].missed and s.detections[0].alarmed_before
    t, v = verdict(alarms=[(45, 51), (55, 70)], named=[(2, 45, 51), (2, 55, 70)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 70.0)])
    assert s.false_alarms == 1 and s.detections[0].delay_s == pytest.approx(5.0)


def test_the_first_named_counts_and_the_wrong_ones_are_listed():
    t, v = verdict(alarms=[(52, 80)], named=[(1, 53, 80), (2, 54, 80)])
    (d,) = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)]).detections
    assert d.isolated == "left/stuck" and not d.correct and d.others == ("left/stuck",)
    # Both at once: the wrong one does not hide behind the right one.
    t, v = verdict(alarms=[(52, 80)], named=[(1, 53, 80), (2, 53, 80)])
    assert not score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)]).detections[0].correct


def test_a_group_names_its_members():
    t, v = verdict(alarms=[(52, 80)], named=[(1, 53, 80)])
    (d,) = score(t, v, TABLE, [Fault("pair", "stuck", 50.0, 80.0)]).detections
    assert d.correct


def test_false_alarms_are_counted_once_and_only_where_healthy():
    t, v = verdict(alarms=[(10, 11), (11.5, 12), (30, 31), (52, 85), (95, 96)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)], settle_s=5.0)
    assert s.false_alarms_s == pytest.approx((10.0, 30.0, 95.0))
    assert s.healthy_s == pytest.approx(45 + 10)


def test_an_alarm_left_over_from_a_fault_is_neither_false_nor_healthy_time():
    t, v = verdict(alarms=[(52, 93), (96, 97)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)])
    assert s.false_alarms_s == pytest.approx((96.0,)) and s.healthy_s == pytest.approx(50 + 7)


def test_an_alarm_on_from_the_start_is_a_false_one():
    t, v = verdict(alarms=[(0, 40)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)], settle_s=10.0)
    assert s.false_alarms_s == pytest.approx((10.0,)) and s.healthy_s == pytest.approx(40 + 10)


def test_samples_that_do_not_judge_neither_detect_nor_count():
    t, v = verdict(alarms=[(20, 21), (52, 80)], bad=[(19, 22), (50, 60)])
    s = score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0)])
    assert s.false_alarms == 0 and s.detections[0].delay_s == pytest.approx(10.0)
    assert s.healthy_s == pytest.approx(50 - 3 + 10) and s.ok_share == pytest.approx(0.87)


def test_the_verdict_must_belong_to_the_instants():
    t, v = verdict()
    with pytest.raises(WrongUse, match="999"):
        score(t[:-1], v, TABLE)


def test_edges_merge():
    on = np.array([1, 0, 1, 1, 0, 0, 1], bool)
    assert rising_edges(on, np.arange(7.0)).tolist() == [0.0, 2.0, 6.0]
    assert rising_edges(on, np.arange(7.0), 2.5).tolist() == [0.0, 6.0]
    assert rising_edges(on, np.arange(7.0), 3.5).tolist() == [0.0]


def test_a_summary_pools_flights():
    scores = []
    for delay in (1.0, 2.0, 3.0, None):
        alarms = [] if delay is None else [(50 + delay, 80)]
        named = [] if delay is None else [(2 if delay < 3 else 1, 50 + delay, 80)]
        t, v = verdict(alarms=[(5, 6), *alarms], named=named, estimate=[(2, -0.1)])
        scores.append(score(t, v, TABLE, [Fault("right", "stuck", 50.0, 80.0, -0.08)]))
    s = summarise(scores, allowed_s=[1.5] * 4)
    assert s.faults == 4 and s.missed.value == 0.25 and s.isolated.value == pytest.approx(2 / 3)
    assert s.delay_s.value == pytest.approx(2.5) and s.detected_in_time.value == 0.25
    assert s.false_alarms == 4 and s.healthy_hours == pytest.approx(4 * 60 / 3600)
    assert s.false_alarms_per_hour.value == pytest.approx(60.0)
    assert s.estimate_error.value == pytest.approx(0.02)
    mute = [
        s._replace(detections=tuple(d._replace(isolated="none", correct=False) for d in s.detections))
        for s in scores
    ]
    assert math.isnan(summarise(mute).isolated.value), "one that names nothing is not always wrong"
    table = confusion(d for s in scores for d in s.detections)
    assert table == {"right/stuck": {"left/stuck": 1, "missed": 1, "right/stuck": 2}}
