"""The Vireo's observer: weights, actuator, entry point, shipped designs."""

from pathlib import Path

import numpy as np
import pytest

import aerofdi.papers.vireo_comparison
from aerofdi.aircraft import load_aircraft
from aerofdi.core import WrongUse
from aerofdi.design.certificates import LIMIT
from aerofdi.design.io import load_design
from aerofdi.design.lpv import hinf_norm, poles, response, transfer
from aerofdi.design.lpv_observer import AXES, KINDS, Spec, design_lpv_observer
from aerofdi.design.lpv_observer_check import recheck, saved_filter
from aerofdi.design.lpv_observer_models import (
    default_weights,
    linear_models,
    sensitivity_weight,
    weights_from,
    weights_table,
)
from aerofdi.design.lpv_observer_plants import delay_free_actuator
from aerofdi.design.synthesis import filter_at

from .conftest import LAT_WEIGHTS, LON_WEIGHTS

pytest.importorskip("clarabel")
DESIGNS = Path(aerofdi.papers.vireo_comparison.__file__).parent / "designs"


@pytest.fixture(scope="module")
def vireo():
    return load_aircraft("vireo")


def test_the_actuator_of_the_paper_comes_out_of_servo_and_delay(actuator):
    servo = transfer([62.8**2], [1.0, 2 * 0.77 * 62.8, 62.8**2], "x", "y")
    ours = delay_free_actuator(servo, 0.05)
    assert ours.order == 5
    w = np.logspace(-2, 4, 400)
    assert np.abs(response(ours, w) - response(actuator, w)).max() < 0.004
    assert ours.D[0, 0, 0] == pytest.approx(-0.06135, abs=3e-4)
    assert response(ours, [0.0])[0, 0, 0, 0].real == pytest.approx(1.0, abs=1e-9)
    assert delay_free_actuator(servo, 0.0).order == 2


def test_weights_say_what_the_text_says():
    for w, percent in ((0.87, 38.16), (14.5, 12.25), (62.8, 18.18)):
        assert 100 * LON_WEIGHTS.uncertainty.gain_at(w) == pytest.approx(percent, abs=0.01)
    again = sensitivity_weight(-35.0, 1.0, 4.0)
    np.testing.assert_allclose(
        again.num + again.den, LAT_WEIGHTS.error.num + LAT_WEIGHTS.error.den, rtol=0.02
    )
    assert weights_from(weights_table(LON_WEIGHTS)) == LON_WEIGHTS


def test_linear_models_are_the_published_ones_at_cruise(vireo):
    m = linear_models(vireo, np.array([15.4]))
    assert m.lat[0][0, 1, 1] == pytest.approx(-11.3, abs=1e-3) and m.lat[1][0, 1, 0] == pytest.approx(
        -201, abs=1e-2
    )
    assert m.lon[1][0, 0, 0] == pytest.approx(-185.7, abs=1e-2)
    assert np.degrees(m.elevator[0]) == pytest.approx(-3.575, abs=0.01)
    assert default_weights(vireo, m, 15.4)["lat"].error == LAT_WEIGHTS.error


def test_the_entry_point_makes_what_it_documents(vireo):
    said = []
    d = design_lpv_observer(
        vireo, Spec("robust_lti", w_scale=(0.02, 0.5)), lambda text, share: said.append(share)
    )
    assert d.method == "lpv_observer" and d.spec["mixing"] == [[1.0, -1.0], [1.0, 1.0]]
    assert d.params["lat.A"].shape == (1, 15, 15) and d.params["lon.A"].shape == (1, 13, 13)
    assert d.params["lat.B"].shape == (1, 15, 3) and d.params["lon.D"].shape == (1, 1, 1)
    assert said[0] == 0.0 and said[-1] == 1.0 and said == sorted(said)
    for a in AXES:
        assert d.certificate[a]["proved"] and d.certificate[a]["status"] == "solved"
        assert max(recheck(vireo, d, a).values()) <= LIMIT
    broken = d._replace(params=d.params | {"lat.B": 1.3 * d.params["lat.B"]})
    assert recheck(vireo, broken, "lat")["loop"] > 1e-4


@pytest.mark.parametrize("kind", KINDS)
def test_shipped_designs_prove_themselves(vireo, kind):
    """Every inequality again on 161 airspeeds, from the aircraft file and the stored storage matrices."""
    d = load_design(DESIGNS / f"{kind}.toml")
    assert d.spec["kind"] == kind
    for a in AXES:
        c = d.certificate[a]
        now = recheck(vireo, d, a)
        assert c["status"] == "solved" and c["stable"]
        assert c["on_grid_only"] == (max(now.values()) > LIMIT)
        f = saved_filter(d, a)
        V = np.linspace(12.0, 20.0, 81)
        for rate in (-8.0, 0.0, 8.0):
            assert poles(filter_at(f, V, rate)).real.max() < 0.0
        assert hinf_norm(filter_at(f, 15.4))[0] > 0.02


def test_the_same_entry_serves_another_aircraft():
    """The Ultra Stick: first-order servos without delay, table aerodynamics, its own gains and modes."""
    stick = load_aircraft("ultrastick120")
    d = design_lpv_observer(stick, Spec("nominal_lti"))
    rows = dict(zip(d.spec["surfaces"], d.spec["mixing"], strict=True))
    assert rows["elevator"] == [1.0, 0.0] and rows["aileron_left"] == [0.0, -rows["aileron_right"][1]]
    assert d.spec["weights"]["lat"]["error"] != weights_table(LAT_WEIGHTS)["error"]
    for a in AXES:
        assert d.certificate[a]["proved"] and d.certificate[a]["stable"]
        assert max(recheck(stick, d, a).values()) <= LIMIT
    assert d.params["lon.A"].shape == (1, 7, 7)


def test_wrong_specs_are_refused(vireo):
    with pytest.raises(WrongUse, match="observer kind 'best' is not known"):
        design_lpv_observer(vireo, Spec("best"))
    with pytest.raises(WrongUse, match="lowest < highest"):
        design_lpv_observer(vireo, Spec("nominal_lpv", airspeeds=(20.0, 12.0)))
