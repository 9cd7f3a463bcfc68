"""SMAC on board: the contract, what it promises of its excitation, and that it finds the right surface."""

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.aircraft import load_aircraft
from aerofdi.core import MissingChannel, Request, Status, WrongUse, bind, check_diagnoser, empty_verdict, run
from aerofdi.design.smac import design_smac, dryden, level_flight
from aerofdi.diagnosers import smac, smac_types
from aerofdi.diagnosers.smac_isolator import HALT, SPENT, TEST, TRACK, WATCH
from aerofdi.dynamics.faults import Fault
from aerofdi.dynamics.trim import trim
from aerofdi.simulate import fly_with

DEG = math.pi / 180.0
SURFACES = ("aileron_left", "aileron_right", "elevator_left", "elevator_right", "rudder")


@pytest.fixture(scope="module")
def design():
    return design_smac(load_aircraft("ducard"), {"torque_scale": 0.75, "calibration_s": 60.0})


@pytest.fixture(scope="module")
def fly(design):
    """fly(faults) -> (flight, watched) with SMAC on board the level aircraft, noise and all."""
    aircraft = load_aircraft("ducard")
    condition = trim(aircraft)

    def go(faults, duration_s=32.0, d=None, seed=3):
        s = level_flight(aircraft, condition, duration_s, faults=tuple(faults), seed=seed)
        found = fly_with(s, [d or smac.from_design(design)])
        return found.flight, found.verdicts[0]

    return go


@pytest.fixture(scope="module")
def stuck(fly):
    """The left aileron stuck at 2 deg from 12 to 22 s."""
    return fly([Fault("aileron_left", "stuck", 12.0, 22.0, 2.0 * DEG, "trim")])


def declared(verdict):
    return verdict.active[:, 1::2] | verdict.active[:, 2::2]


def test_contract(design, stuck):
    check_diagnoser(smac.from_design(design), stuck[0])


def test_live_is_replay_and_replay_says_where_it_would_differ(design, stuck):
    flight, watched = stuck
    d = smac.from_design(design)
    sample = bind(flight, d.inputs, d.dt_s)
    _, replayed = run(d, sample)
    for a, b in zip(replayed, watched.verdict):
        np.testing.assert_array_equal(a, b)
    assert smac.excitation_difference(d, sample, replayed).samples == 0
    shy = d._replace(params=d.params._replace(detector=d.params.detector._replace(axis=np.full(3, 1e3))))
    other = smac.excitation_difference(shy, sample, run(shy, sample)[1])
    assert (
        other.samples > 100
        and 12.0 < other.first_s < 14.0
        and other.largest == pytest.approx(2.0 * DEG, rel=0.01)
    )


def test_flight_without_excitation_channels_is_refused(design, stuck):
    d = smac.from_design(design)
    without = {k: v for k, v in stuck[0].measured.items() if k != "excitation.rudder"}
    with pytest.raises(MissingChannel, match=r"excitation\.rudder.*smac"):
        bind(replace(stuck[0], measured=without), d.inputs, d.dt_s, who=d.name)


def test_stuck_surface_is_found_measured_and_forgotten_when_it_recovers(stuck):
    t, v = stuck[1].t_s, stuck[1].verdict
    on = declared(v)
    first = t[np.flatnonzero(v.detected)[0]]
    found = t[np.flatnonzero(on[:, 0])[0]]
    assert 12.0 < first < 13.0 and first < found < 15.0
    assert not on[:, 1:].any()
    assert v.active[t > 21.0, 1][0]  # "stuck"
    angle, std = v.estimate[t > 20.0, 1][0], v.estimate_std[t > 20.0, 1][0]
    assert abs(angle - 2.0 * DEG) < 4.0 * std < 2.0 * DEG
    assert not on[t > 24.5].any() and not v.detected[t > 27.0].any()
    assert (v.request[on[:, 0]] == Request.HOLD_LEVEL).all() and v.request[100] == Request.NONE


def test_gusts_start_tests_but_raise_no_alarm_and_accuse_nobody():
    gusty = {
        "duration_s": 70.0,
        "faults": (),
        "wind": dryden(trim(load_aircraft("ducard")).altitude, 2.5),
        "seed": 5,
    }
    scenario = level_flight(load_aircraft("ducard"), trim(load_aircraft("ducard")), **gusty)
    verdicts = {}
    for follow in (False, True):
        d = smac.from_design(
            design_smac(load_aircraft("ducard"), {"torque_scale": 0.75, "follow_wind": follow})
        )
        verdicts[follow] = fly_with(scenario, [d]).verdicts[0].verdict
    fixed, following = verdicts[False], verdicts[True]
    assert fixed.detected.sum() > 100, "the gusts are far above thresholds made in still air"
    assert following.excitation.any() and (following.threshold[-1, :2] > 2.0 * fixed.threshold[-1, :2]).all()
    assert not following.detected.any() and not following.active[:, 1:].any()


def test_surface_stuck_since_before_the_start_is_found(fly):
    """The running variance of the residual must not take a fault for gusts."""
    _, seen = fly([Fault("aileron_left", "stuck", 0.0, value=4.0 * DEG, about="trim")], 20.0)
    k = np.flatnonzero(seen.verdict.detected)[0]
    assert seen.t_s[k] < 9.0 and declared(seen.verdict)[-1].tolist() == [True] + [False] * 4


@pytest.mark.parametrize("surface", ["aileron_right", "elevator_left"])
def test_transient_of_a_large_fault_accuses_no_other_surface(fly, surface):
    for seed in (21, 22):
        _, seen = fly([Fault(surface, "stuck", 12.0, value=9.0 * DEG, about="trim")], 22.0, seed=seed)
        found = declared(seen.verdict).any(axis=0)
        assert found.tolist() == [s == surface for s in SURFACES]


def test_two_stuck_surfaces_are_both_found(fly):
    flight, w = fly(
        [
            Fault("aileron_right", "stuck", 12.0, value=-2.0 * DEG, about="trim"),
            Fault("elevator_left", "stuck", 12.0, value=3.0 * DEG, about="trim"),
        ]
    )
    on = declared(w.verdict)
    assert on[-1].tolist() == [False, True, True, False, False]
    assert not on[:, [0, 3, 4]].any()
    late = w.t_s > 26.0
    right = flight.meta["faults"][1]["value"]
    assert np.nanmedian(w.verdict.estimate[late, 1 + 2 * 2]) == pytest.approx(right, abs=0.6 * DEG)


def test_two_stuck_twins_are_both_found_and_no_angle_is_claimed(fly):
    both = [
        Fault(f"elevator_{side}", "stuck", 12.0, value=s * DEG, about="trim")
        for side, s in (("left", 2), ("right", 1))
    ]
    w = fly(both)[1]
    on = declared(w.verdict)
    assert on[-1].tolist() == [False, False, True, True, False]
    assert np.isnan(w.verdict.estimate[-1, 5:9]).all()  # one residual, two unknowns


def test_lost_effectiveness_is_found_by_a_sweep_and_measured(fly, design):
    d = smac.from_design(design)
    d = d._replace(params=d.params._replace(timing=d.params.timing._replace(sweep_every=300)))
    fault = Fault("elevator_left", "loss_of_effectiveness", 9.0, value=0.6, about="trim")
    w = fly([fault], d=d)[1]
    on = declared(w.verdict)
    assert on[-1].tolist() == [False, False, True, False, False]
    last, name = w.verdict.active[-1], smac.from_design(design).hypotheses
    assert [h.mode for h, a in zip(name, last) if a] == ["loss_of_effectiveness"]
    assert np.nanmedian(w.verdict.estimate[w.t_s > 24.0, 2 + 2 * 2]) == pytest.approx(0.6, abs=0.1)


def test_reset_forgets_and_begins_anew(design, stuck):
    d = smac.from_design(design)
    sample = bind(stuck[0], d.inputs, d.dt_s)
    z = sample.z.copy()
    at = int(18.0 / d.dt_s)
    z[:, -1] = 0.0
    z[at, -1] = 1.0
    v = run(d, sample._replace(z=z))[1]
    assert declared(v)[at - 1, 0] and not declared(v)[at].any()
    assert np.array_equal(v.detected[:at], stuck[1].verdict.detected[:at])


def drive(d, n=1500, change=None):
    """The diagnoser on a made-up level aircraft whose roll residual says fault; its excitation fed back."""
    z = np.zeros(len(d.inputs.names))
    z[smac_types.AIRSPEED], z[smac_types.ALTITUDE] = 30.0, 200.0
    alpha = 0.0882
    z[smac_types.ALPHA], z[smac_types.THETA] = alpha, alpha
    z[[12, 13]] = -0.02355
    state, out, age = d.init(d.params), empty_verdict(d, n), np.zeros(len(z))
    random = np.random.default_rng(0)
    for k in range(n):
        z[smac_types.P] = (0.4 if k > 450 else 0.0) + 0.01 * random.standard_normal()
        z[10:15] += 1e-4 * random.standard_normal(5)
        z[15:20] = out.excitation[k - 1] if k else 0.0
        if change:
            change(k, z, age)
        d.step_into(d.params, state, z, age, out, k)
        z[15:20] = 0.0
        yield k, state, out


def test_excitation_never_exceeds_its_budget_and_ends_with_its_seconds(design):
    d = smac.from_design(design)
    surface = d.params.probe.surface.copy()
    surface[:, smac_types.BUDGET] = 0.5 * surface[:, smac_types.AMPLITUDE]
    probe, budget = d.params.probe._replace(surface=surface), d.params.budget._replace(seconds=3.0)
    d = d._replace(params=d.params._replace(probe=probe, budget=budget))
    *_, (_, state, out) = drive(d)
    used = np.abs(out.excitation).max(axis=1)
    assert used.max() == pytest.approx(1.0 * DEG)
    assert 2.5 < np.sum(out.request == Request.HOLD_LEVEL) * d.dt_s <= 3.0 + 2 * d.dt_s
    assert state.clock[smac_types.MODE] == SPENT and not out.excitation[-200:].any()


@pytest.mark.parametrize(
    ("place", "value"),
    [(smac_types.PHI, 0.6), (smac_types.THETA, 0.5), (smac_types.ALTITUDE, 260.0), (smac_types.PSI, 1.5)],
)
def test_excitation_stops_at_once_outside_the_envelope(design, place, value):
    d = smac.from_design(design)
    seen = {}

    def change(k, z, age):
        if k >= 560:
            z[place] = value

    for k, state, out in drive(d, 1000, change):
        if k == 559:
            seen["before"] = np.abs(out.excitation[k - 40 : k]).max()
            seen["mode"] = int(state.clock[smac_types.MODE])
        if state.clock[smac_types.MODE] == HALT and "at" not in seen:
            seen["at"] = k
            assert not out.excitation[k].any() and out.status[k] == Status.OUT_OF_ENVELOPE
    assert seen["before"] > 0 and seen["mode"] in (TEST, TRACK)
    # Attitude and altitude count at once; a new heading takes time to become a deviation from the track.
    assert seen["at"] == 560 if place != smac_types.PSI else 560 < seen["at"] < 760


def test_excitation_stops_on_bad_and_old_data_and_the_state_stays_finite(design):
    d = smac.from_design(design)

    def change(k, z, age):
        age[0] = 9.0 if 560 <= k < 565 else 0.0
        if 600 <= k < 605:
            z[smac_types.ALPHA] = np.nan
        elif k == 605:
            z[smac_types.ALPHA] = 0.0882

    for k, state, out in drive(d, 700, change):
        if 560 <= k < 565 or 600 <= k < 605:
            wanted = Status.STALE_INPUT if k < 565 else Status.NONFINITE
            assert out.status[k] == wanted and not out.excitation[k].any() and not out.active[k].any()
        assert all(np.isfinite(x).all() for x in state)
    assert np.abs(out.excitation[520:560]).max() > 0 and np.abs(out.excitation[606:]).max() > 0


def test_a_quiet_aircraft_is_left_alone(design):
    d = smac.from_design(design)

    def change(k, z, age):
        z[smac_types.P] = 0.0

    *_, (_, state, out) = drive(d, 900, change)
    assert state.clock[smac_types.MODE] == WATCH and not out.excitation.any() and not out.detected.any()
    assert out.active[int(d.settle_s / d.dt_s) + 1 :, 0].all()


@settings(max_examples=30, deadline=None)
@given(st.floats(0.2, 3.0), st.floats(-2.8, -0.3), st.floats(0.05, 1.0), st.integers(0, 1), st.booleans())
def test_remaining_effectiveness_inverts_the_loop(design_params, size, angle, left, stuck_twins, lone):
    """R = -e L1 / (1 + (h + e) L1) for h sound twins gives back e."""
    from aerofdi.diagnosers.smac_health import remaining

    p = design_params
    i = 4 if lone else 0
    loop = size * np.exp(1j * angle)
    sound = 0 if lone or stuck_twins else 1
    if abs(1 + (sound + left) * loop) < 0.05:
        return
    R = -left * loop / (1 + (sound + left) * loop)
    surface = p.probe.surface.copy()
    surface[i, [smac_types.LOOP_RE, smac_types.LOOP_IM]] = loop.real, loop.imag
    s = smac_types.init(p)
    s.surface[i, [smac_types.ANSWER_RE, smac_types.ANSWER_IM]] = R.real, R.imag
    s.count[1, smac_types.LABEL] = stuck_twins
    assert remaining(p.probe._replace(surface=surface), s, i) == pytest.approx(left, rel=1e-6)


@pytest.fixture(scope="module")
def design_params(design):
    return smac_types.unflatten(design.params)


def test_design_survives_its_arrays_and_a_foreign_one_is_refused(design):
    params = smac_types.unflatten(design.params)
    again = smac_types.flatten(params)
    assert set(again) == set(design.params)
    assert all(np.array_equal(again[k], design.params[k]) for k in again)
    with pytest.raises(WrongUse, match=r"lacks.*probe\.surface"):
        smac_types.unflatten({k: v for k, v in again.items() if k != "probe.surface"})


PLAIN = """
import sys, numpy as np
from aerofdi.core import Sample, run
from aerofdi.diagnosers.smac import from_design
from aerofdi.papers.smac.methods import design
d = from_design(design("together"))
z = np.load(sys.argv[1])["z"]
sample = Sample(d.dt_s * np.arange(len(z)), z, np.zeros_like(z), np.zeros(z.shape[1]))
np.savez(sys.argv[2], **run(d, sample)[1]._asdict())
"""


def test_compiled_and_plain_python_agree(design, stuck, tmp_path):
    d = smac.from_design(design)
    np.savez(tmp_path / "z.npz", z=np.nan_to_num(bind(stuck[0], d.inputs, d.dt_s).z[:900]))
    found = []
    for disable in "01":
        target = tmp_path / f"{disable}.npz"
        env = {**os.environ, "NUMBA_DISABLE_JIT": disable, "OMP_NUM_THREADS": "1"}
        subprocess.run(
            [sys.executable, "-c", PLAIN, str(tmp_path / "z.npz"), str(target)],
            env=env,
            check=True,
            timeout=300,
        )
        found.append(np.load(target))
    for name in found[0].files:
        np.testing.assert_allclose(found[0][name], found[1][name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert found[1]["active"][:, 1:].any()
