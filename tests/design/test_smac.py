"""SMAC designs from aircraft files: what they measure is what the closed loop does; what cannot be found is
refused.
"""

import math

import numpy as np
import pytest

from aerofdi.aircraft import load_aircraft
from aerofdi.core import CannotJudge, WrongUse
from aerofdi.design import smac_tuning as tune
from aerofdi.design.io import load_design, save_design
from aerofdi.design.smac import PAPER, design_smac, dryden, level_flight, make_spec
from aerofdi.diagnosers import smac, smac_types
from aerofdi.dynamics.faults import Fault
from aerofdi.dynamics.trim import trim
from aerofdi.simulate import fly_with

QUICK = {"calibration_s": 60.0}


@pytest.fixture(scope="module")
def designs():
    return {name: design_smac(load_aircraft(name), QUICK) for name in ("ducard", "vireo")}


def test_answers_of_the_closed_loop_agree_with_the_linear_one(designs):
    """The autopilot's criteria, derived from linear models, say 0.65, 0.65, 0.76 at 1 Hz; here it is
    flown.
    """
    found = designs["ducard"].certificate["surfaces"]
    for name, ratio in (("aileron_left", 0.65), ("elevator_left", 0.65), ("rudder", 0.76)):
        assert found[name]["answer"] == pytest.approx(ratio, abs=0.03)
    assert found["aileron_right"]["frequency_hz"] == 2.0 and found["aileron_left"]["frequency_hz"] == 1.0


def test_twin_left_alone_answers_as_predicted():
    """One aileron stuck: the other answers its excitation by -L1/(1 + L1) with L1 measured on the healthy
    pair.
    """
    from aerofdi.design.smac_measure import measure_answers

    aircraft = load_aircraft("ducard")
    condition, surfaces, spec = (
        trim(aircraft),
        ("aileron_left", "aileron_right"),
        make_spec({"together": False}),
    )
    omega = np.full(2, 2.0 * math.pi)
    healthy = measure_answers(aircraft, condition, surfaces, omega, spec, lambda *_: None).value
    stuck = (Fault("aileron_right", "stuck", 0.0, value=0.0, about="trim"),)
    alone = measure_answers(aircraft, condition, surfaces, omega, spec, lambda *_: None, faults=stuck).value
    assert alone[0] == pytest.approx(tune.lone_answer(tune.lone_loop(healthy[0], 1)), abs=0.02)
    assert abs(alone[1]) < 0.01


def test_thresholds_lie_in_their_window_and_are_made_of_the_noise(designs):
    for d in designs.values():
        for axis in d.certificate["axes"].values():
            low, high = axis["window_rad_s"]
            assert low <= axis["threshold_rad_s"] < high
            assert axis["threshold_rad_s"] == pytest.approx(4.0 * axis["noise_rad_s"])
            assert axis["noise_in_gusts_rad_s"] > axis["noise_rad_s"]


def test_without_sensor_noise_the_resolution_of_the_servos_is_the_threshold():
    """This file has ideal sensors; a threshold made of their noise would be zero."""
    d = design_smac(load_aircraft("aerosonde_aerosim"), QUICK)
    found = d.certificate["surfaces"]
    assert all(axis["threshold_rad_s"] > 1e-5 for axis in d.certificate["axes"].values())
    # (13) doubles it; sound twins share the deviation.
    assert min(x["smallest_stuck_angle_deg"] for x in found.values()) == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("stuck", [False, True])
def test_surface_the_autopilot_never_answers_is_judged_by_the_residual_alone(stuck):
    """The Aerosonde's rudder is held still, so its command is silent whether it moves or not."""
    aircraft = load_aircraft("aerosonde")
    condition, d = trim(aircraft), smac.from_design(design_smac(aircraft, QUICK))
    faults = (Fault("rudder", "stuck", 40.0, value=math.radians(3.0), about="trim"),) if stuck else ()
    wind = dryden(condition.altitude, 0.5)
    seen = fly_with(level_flight(aircraft, condition, 90.0, wind=wind, seed=5, faults=faults), [d]).verdicts[
        0
    ]
    rudder = d.outputs.names.index("excitation.rudder")
    declared = seen.verdict.active[:, 1::2] | seen.verdict.active[:, 2::2]
    assert seen.verdict.excitation[:, rudder].any(), "it was tested"
    assert declared.any(axis=0).tolist() == [stuck and j == rudder for j in range(declared.shape[1])]


def test_fault_below_the_noise_is_refused_and_the_cause_named():
    with pytest.raises(CannotJudge, match=r"each degree of a stuck surface is 2 deg.*'sensor noise'"):
        design_smac(load_aircraft("ducard"), {**QUICK, "smallest_fault_deg": 0.2})


def test_where_the_sensors_are_ideal_the_servos_are_named_as_the_cause():
    with pytest.raises(CannotJudge, match="'servo resolution'"):
        design_smac(load_aircraft("aerosonde_aerosim"), {**QUICK, "smallest_fault_deg": 0.05})


def test_the_right_elevon_of_another_aircraft_is_found(designs):
    """A flying wing without vanes: elevons are tested as one group, alpha is taken from the pitch angle."""
    aircraft, d = load_aircraft("vireo"), smac.from_design(designs["vireo"])
    assert {"alpha", "beta"} <= set(d.inputs.optional)
    fault = Fault("elevon_right", "stuck", 15.0, value=math.radians(3.0), about="trim")
    w = fly_with(level_flight(aircraft, trim(aircraft), 30.0, faults=(fault,)), [d]).verdicts[0]
    on = w.verdict.active[:, 1::2] | w.verdict.active[:, 2::2]
    assert on[-1].tolist() == [False, True] and not on[:, 0].any() and not on[w.t_s < 15.0].any()


def test_design_is_saved_and_loaded_to_the_bit(designs, tmp_path):
    again = load_design(save_design(designs["ducard"], tmp_path / "d.toml"))
    assert set(again.params) == set(designs["ducard"].params)
    assert all(np.array_equal(again.params[k], v) for k, v in designs["ducard"].params.items())
    assert smac.from_design(again).hypotheses == smac.from_design(designs["ducard"]).hypotheses


def test_unknown_settings_are_refused_by_name():
    with pytest.raises(WrongUse, match="amplitude_degrees"):
        make_spec({"amplitude_degrees": 2.0})
    with pytest.raises(WrongUse, match="rectified, synchronous, fused"):
        make_spec({"evaluator": "guess"})
    with pytest.raises(WrongUse, match="together"):
        make_spec({"evaluator": "rectified"})


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"amplitude_deg": 0.0}, r"amplitude_deg = 0\.0 .* above 0"),
        ({"frequency_hz": "fast"}, "frequency_hz 'fast' .* a number"),
        ({"frequency_hz": 60.0}, "fewer than 10 samples a period .* at most 5 is"),
        ({"dt_s": -0.02}, "dt_s = -0.02"),
        ({"torque_scale": math.nan}, "torque_scale nan"),
        ({"release": 1.5}, "release = 1.5 .* at most 1"),
        ({"axis": (0.1, 0.2)}, "three thresholds above 0"),
        ({"calibration_s": 5.0}, "at least 20 s"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(wrong, said):
    with pytest.raises(WrongUse, match=said):
        make_spec(wrong)


def test_the_papers_numbers_are_the_printed_ones():
    assert (PAPER.gamma2, PAPER.axis, PAPER.f1_hz, PAPER.f2_hz) == (0.025, (0.03, 0.2, 0.5), 0.4, 0.4)
    assert PAPER.lambda_share * tune.lambda_max(math.radians(2.0)) == pytest.approx(0.01)
    assert (PAPER.r_w, PAPER.r_v, PAPER.torque_scale, PAPER.kappa) == (2.0, 0.1, 0.75, 1.0)
    assert smac_types.SUM == 0 and PAPER.rule == "sum" and PAPER.evaluator == "rectified"
