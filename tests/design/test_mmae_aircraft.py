"""The filter bank made from an aircraft file alone, for every shipped aircraft with a redundant pair."""

from dataclasses import replace

import numpy as np
import pytest

from aerofdi.aircraft import load_aircraft
from aerofdi.core import CannotJudge, WrongUse, bind, check_diagnoser, run
from aerofdi.design.mmae_aircraft import design_for_aircraft
from aerofdi.diagnosers import mmae
from aerofdi.papers.vireo_comparison import methods

DT = methods.DT_S


def test_the_vireo_file_gives_the_bank_of_the_papers_matrices():
    """(17) is printed to three digits; the file reproduces them, so gains and predictions agree to those."""
    made = design_for_aircraft(load_aircraft("vireo"), methods.PAPER_TUNING, DT, airspeed=15.4)
    paper = methods.method_c_design()
    for key in ("A", "B", "L", "S_inv", "std"):
        a, b = made.params[key], paper.params[key]
        np.testing.assert_allclose(a, b, rtol=2e-3, atol=2e-3 * np.nanmax(np.abs(b)), err_msg=key)
    assert mmae.state_count(made)["total"] == 42 and made.aircraft_hash
    np.testing.assert_allclose(np.degrees(made.params["trim"]), -3.575, atol=0.01)


@pytest.mark.parametrize(
    ("name", "group", "suspects"),
    [
        ("ducard", "aileron", ["aileron_left", "aileron_right"]),
        ("ultrastick120", "aileron", ["aileron_left", "aileron_right"]),
        ("aerosonde", "aileron", ["aileron_left", "aileron_right"]),
        ("aerosonde_aerosim", "aileron", ["aileron_left", "aileron_right"]),
        ("vireo", None, ["elevon_left", "elevon_right"]),
    ],
)
def test_every_file_with_a_pair_gives_a_bank(name, group, suspects):
    aircraft = load_aircraft(name)
    design = design_for_aircraft(aircraft, methods.PAPER_TUNING, DT, group=group)
    assert design.spec["suspects"] == suspects and set(suspects) <= set(design.spec["surfaces"])
    assert max(design.certificate["riccati_residual"]) < 1e-8
    assert max(design.certificate["slowest_pole"]) < 1.0
    d = mmae.from_design(design)
    assert [h.fault for h in d.hypotheses[1:]] == suspects


def test_it_finds_the_elevon_and_keeps_the_contract():
    from aerofdi.simulate import fly

    flight = fly("demo")
    fault = flight.meta["faults"][0]
    d = mmae.from_design(design_for_aircraft(load_aircraft("vireo"), methods.PAPER_TUNING, DT))
    sample = bind(flight, d.inputs, d.dt_s)
    v = run(d, sample)[1]
    assert not v.detected[sample.t_s < fault["start_s"]].any() and v.detected.any()
    first = v.active[v.active[:, 1:].any(axis=1).argmax()]
    assert d.hypotheses[int(first.argmax())].fault == fault["target"]
    check_diagnoser(d, flight.between(fault["start_s"] - 20.0, fault["start_s"] + 10.0))


def test_wrong_groups_are_refused_by_name():
    vireo = load_aircraft("vireo")
    with pytest.raises(CannotJudge, match="same group"):
        design_for_aircraft(replace(vireo, surfaces=vireo.surfaces[:1]), methods.PAPER_TUNING, DT)
    with pytest.raises(WrongUse, match=r"no group was given.* aileron, elevator"):
        design_for_aircraft(load_aircraft("ducard"), methods.PAPER_TUNING, DT)
    with pytest.raises(WrongUse, match="'rudder' was given"):
        design_for_aircraft(load_aircraft("ducard"), methods.PAPER_TUNING, DT, group="rudder")
    with pytest.raises(CannotJudge, match=r"elevator_left.* moves none of"):
        states = {"state_std": {"u": 0.1}, "measured": {"u": 0.1}, "weight": {"u": 1.0}, "delay": 0}
        design_for_aircraft(
            load_aircraft("ducard"),
            methods.PAPER_TUNING._replace(**states),
            DT,
            group="elevator",
            states=["phi"],
        )
