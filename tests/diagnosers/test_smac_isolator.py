"""The table of `smac_isolator` row by row: every transition of the machine from a state set by hand."""

import math

import numpy as np
import pytest

from aerofdi.diagnosers import smac_types as t
from aerofdi.diagnosers.smac_health import needed_odds
from aerofdi.diagnosers.smac_isolator import HALT, REST, SPENT, TEST, TRACK, WATCH, isolate, reset
from aerofdi.papers.smac.methods import design

ROLL, PITCH, YAW = range(3)
AIL_L, AIL_R, ELE_L, ELE_R, RUDDER = range(5)


class Machine:
    """The isolator alone: residuals, suspicion and evidence are given, not computed."""

    def __init__(self, kind="together", **timing):
        p = t.unflatten(design(kind).params)
        self.p = p._replace(timing=p.timing._replace(**timing), budget=p.budget._replace(seconds=1e3))
        self.s = t.init(self.p)
        self.s.misc[t.SCALE : t.SCALE + 6] = 1.0
        self.z = np.zeros(len(self.p.max_age))
        self.z[[t.AIRSPEED, t.ALTITUDE, t.THETA]] = 30.0, 200.0, 0.09
        self.odds = self.p.timing.odds

    def residual(self, axis, ratio):
        self.s.axes[axis, t.LEVEL] = ratio * self.p.detector.axis[axis]

    def suspect(self, on=True):
        self.s.clock[t.SUSPECT] = on

    def step(self, n=1):
        for _ in range(n):
            isolate(self.p, self.s, self.z)
        return self.mode

    def evidence(self, surface, share):
        self.s.surface[surface, t.EVIDENCE] = share * self.odds

    def declare(self, surface):
        """As if a round had ended with this surface declared."""
        self.s.count[:, t.ROUND] = 1
        self.s.count[surface, t.LABEL] = 1
        self.s.clock[t.MODE], self.s.clock[t.SINCE] = TRACK, 0
        self.s.misc[[t.HOME_THETA, t.HOME_ALTITUDE]] = self.z[[t.THETA, t.ALTITUDE]]

    @property
    def mode(self):
        return int(self.s.clock[t.MODE])

    @property
    def excited(self):
        return np.flatnonzero(self.s.surface[:, t.EXCITATION]).tolist()

    @property
    def declared(self):
        return np.flatnonzero(self.s.count[:, t.LABEL]).tolist()


def test_watch_waits_for_suspicion_and_begins_with_the_loudest_axis():
    m = Machine()
    m.residual(ROLL, 2.0)
    m.residual(PITCH, -5.0)
    assert m.step(100) == WATCH and m.excited == []
    m.suspect()
    assert m.step() == TEST and m.excited == []
    assert m.step() == TEST and m.excited == [ELE_L, ELE_R]


def test_sound_surfaces_pass_on_to_the_next_axis_and_the_round_ends_in_rest():
    m = Machine()
    for axis, ratio in ((YAW, 4.0), (ROLL, 3.0), (PITCH, 2.0)):
        m.residual(axis, ratio)
    m.suspect()
    m.step(2)
    order = []
    while m.mode == TEST:
        order.append(m.excited)
        for i in m.excited:
            m.evidence(i, -1.0)
        m.step(2)
    assert order == [[RUDDER], [AIL_L, AIL_R], [ELE_L, ELE_R]]
    assert m.mode == REST and m.declared == [] and m.excited == []
    m.suspect(False)
    assert m.step(m.p.timing.rest - 2) == REST
    assert m.step(2) == WATCH


def test_fallen_suspicion_ends_a_round_without_a_fault():
    m = Machine()
    m.residual(YAW, 4.0)
    m.suspect()
    m.step(2)
    m.suspect(False)
    assert m.step() == TEST, "the surface under test is decided first"
    m.evidence(RUDDER, -1.0)
    assert m.step() == REST


def test_declared_twin_explains_its_axis_and_is_tracked():
    m = Machine()
    m.residual(ROLL, 4.0)
    m.residual(PITCH, 0.9)
    m.suspect()
    m.step(2)
    m.evidence(AIL_R, 1.01)
    assert m.step() == TEST and m.declared == [AIL_R], "its twin is still open"
    m.evidence(AIL_L, -1.01)
    assert m.step() == TRACK and m.declared == [AIL_R], "no other axis is above its threshold"
    m.step()
    assert m.excited == [AIL_R]


def test_undecided_surface_is_not_declared():
    m = Machine(test_max=70)
    m.residual(YAW, 4.0)
    m.suspect()
    m.step(2)
    m.evidence(RUDDER, 0.99)
    assert m.step(68) == TEST and m.excited == [RUDDER]
    m.step(2)
    assert m.declared == [] and m.excited != [RUDDER]


def test_sweep_needs_no_suspicion_but_twice_the_evidence():
    m = Machine(sweep_every=50)
    assert m.step(49) == WATCH and m.step() == TEST
    m.step()
    first = m.excited
    assert needed_odds(m.p, m.s) == 2.0 * m.odds
    m.evidence(first[0], 1.5)
    m.step()
    assert m.declared == []
    m.evidence(first[0], 2.0)
    m.step()
    assert m.declared == [first[0]]


def test_answer_that_is_back_ends_the_track():
    m = Machine()
    m.declare(ELE_R)
    m.evidence(ELE_R, 0.99)
    assert m.step(5) == TRACK and m.excited == [ELE_R]
    m.evidence(ELE_R, 1.0)
    assert m.step() == REST and m.declared == [] and m.excited == []


def test_second_fault_on_another_axis_is_looked_for_while_the_first_is_tracked():
    m = Machine()
    m.declare(AIL_L)
    m.step(m.p.timing.rest)
    m.residual(PITCH, 1.5)
    m.step(m.p.timing.confirm - 1)
    assert m.mode == TRACK
    assert m.step() == TEST
    m.step()
    assert m.excited == [AIL_L, ELE_L, ELE_R], "the declared one stays excited: another axis"


def test_what_a_declared_surface_does_on_another_axis_is_no_second_fault():
    m = Machine()
    m.declare(AIL_L)
    m.s.surface[AIL_L, t.DELTA] = math.radians(20.0)
    explained = m.p.detector.sensitivity[:, AIL_L] * math.radians(20.0)
    assert abs(explained[PITCH]) > 1.5 * m.p.detector.axis[PITCH], "or there is nothing to explain"
    m.s.axes[:, t.LEVEL] = explained
    assert m.step(m.p.timing.retest - 1) == TRACK
    m.s.surface[AIL_L, t.DELTA] = 0.0
    m.step(m.p.timing.confirm + m.p.timing.rest)
    assert m.mode == TEST


@pytest.mark.parametrize(("kind", "excited"), [("together", [AIL_L, AIL_R]), ("ordered", [AIL_R])])
def test_twin_is_tested_again_and_the_declared_one_is_quiet_where_they_share_a_frequency(kind, excited):
    m = Machine(kind)
    m.declare(AIL_L)
    assert m.step(m.p.timing.retest - 1) == TRACK and m.excited == [AIL_L]
    assert m.step() == TEST
    m.step()
    assert m.excited == excited
    m.evidence(AIL_R, 1.0)
    m.step()
    assert m.declared == [AIL_L, AIL_R]


@pytest.mark.parametrize("mode", [TEST, TRACK])
def test_outside_the_envelope_everything_stops_until_it_flies_level_again(mode):
    m = Machine()
    m.residual(ROLL, 4.0)
    if mode == TRACK:
        m.declare(AIL_L)
    else:
        m.suspect()
    m.step(3)
    assert m.mode == mode and m.excited
    m.z[t.PHI] = 1.01 * m.p.budget.bank
    assert m.step() == HALT and m.excited == []
    assert m.step(10 * m.p.timing.rest) == HALT, "still banked"
    m.z[t.PHI], m.z[t.ALTITUDE] = 0.0, 300.0
    assert m.step(m.p.timing.rest - 1) == HALT
    assert m.step() == REST, "level again; the altitude it has now is its home"
    assert m.step(m.p.timing.rest) == (TRACK if mode == TRACK else WATCH)
    m.step(2)
    assert m.excited and m.declared == ([AIL_L] if mode == TRACK else [])


def test_spent_budget_leaves_the_label_until_the_suspicion_has_gone():
    m = Machine()
    m.p = m.p._replace(budget=m.p.budget._replace(seconds=1.0))
    m.declare(AIL_L)
    m.suspect()
    used = 0
    for _ in range(60):
        m.step()
        used += bool(m.excited)
    assert m.mode == SPENT and used == round(1.0 / m.p.model.dt) and m.declared == [AIL_L]
    m.step(2 * m.p.timing.settle)
    assert m.declared == [AIL_L]
    m.suspect(False)
    m.step(m.p.timing.settle)
    assert m.declared == [] and m.mode == SPENT
    m.suspect()
    assert m.step(100) == SPENT and m.excited == []
    reset(m.s)
    m.step(2)
    assert m.mode == TEST and m.excited, "event.reset gives the seconds back"


def test_a_climb_it_has_left_for_good_does_not_keep_it_halted():
    m = Machine()
    m.residual(ROLL, 4.0)
    m.z[t.THETA] += 0.35
    m.suspect()
    assert m.step(3) == TEST
    m.z[t.THETA] -= 0.35
    assert m.step() == HALT, "far from where the test began"
    m.step(2 * m.p.timing.rest)
    assert m.mode != HALT


def test_a_sweep_that_was_halted_is_over():
    m = Machine(sweep_every=50)
    m.step(51)
    assert m.s.clock[t.SWEEP] == 1
    m.z[t.PHI] = 1.0
    assert m.step() == HALT
    m.z[t.PHI] = 0.0
    m.step(m.p.timing.rest + 1)
    assert m.mode != HALT and needed_odds(m.p, m.s) == m.odds
