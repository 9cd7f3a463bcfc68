"""The paper "smac": the claims that must hold, and tables that cannot have been made up."""

import numpy as np
import pytest
from scipy import linalg

from aerofdi.aircraft import hash as aircraft_hash
from aerofdi.aircraft import load_aircraft
from aerofdi.diagnosers import smac_ekf
from aerofdi.papers import reproduce
from aerofdi.papers.smac import beyond, bound, load, methods
from aerofdi.papers.smac.flights import flown


def claims(item):
    told = reproduce("smac", item, quick=True)
    return {c["id"]: c for c in told["claims"]}, told["tables"]


def test_stored_designs_are_of_this_aircraft():
    """Else every run designs anew; `python -m aerofdi.papers.smac.methods` makes them again."""
    now = aircraft_hash(load_aircraft(methods.AIRCRAFT))
    assert {methods.design(kind).aircraft_hash for kind in methods.SPECS} == {now}
    for kind in methods.SPECS:
        assert (methods.DESIGNS / f"{kind}.toml").exists()


def test_still_air():
    found, tables = claims("still_air")
    for name in (
        "detected",
        "isolated",
        "right_surface",
        "false_declared",
        "false_alarms",
    ):
        assert found[name]["status"] == "reproduced", found[name]
    assert found["lambda_dead"]["status"] == "reproduced"
    # The 1 deg rudder is found late, and the table says so instead of leaving it out.
    assert found["detected_rudder"]["ours"] > 1.0
    assert [row["not_isolated"] for row in tables["still_air_ordered"]] == [0] * 5
    faster = [row["isolated_s_median"] for row in tables["still_air_together"]]
    assert np.mean(faster) < np.mean([row["isolated_s_median"] for row in tables["still_air_ordered"]])


def test_wind_with_thresholds_that_follow_it():
    found, tables = claims("wind")
    assert found["wind_wrong_adapted"]["status"] == "reproduced"
    assert tables["wind"]["together"]["isolated"] >= 0.6
    gusts = flown("together", 2.5).flight.truth["wind_down"].value
    assert 1.5 < np.std(gusts) < 3.5


def test_tuning_rules_and_the_thresholds_no_rudder_can_reach():
    found, _ = claims("tuning")
    assert found["lambda_max"]["status"] == found["p_threshold"]["status"] == "reproduced"
    assert found["r_threshold"]["status"] == "not_reproduced" and "60 deg" in found["r_threshold"]["reason"]


def test_snr_of_innovations_is_that_of_the_whole_record():
    """Against the Gaussian likelihood of a long stationary record, fault at its end."""
    A, B = np.array([[-3.0, -4.0], [1.0, -0.5]]), np.array([[2.0, 1.0], [0.0, 0.3]])
    C, Q, R = np.array([[1.0, 0.5]]), np.array([[0.4]]), np.array([[0.02]])
    step = linalg.expm(np.block([[A, B], [np.zeros((2, 4))]]) * bound.DT_S)
    F, G, W = step[:2, :2], step[:2, 2], step[:2, 3:]
    gap = 0.1 * np.linspace(0.5, 1.0, 40)
    before, n = 400, 440
    P = linalg.solve_discrete_lyapunov(F, W @ Q @ W.T)
    powers = [np.eye(2)]
    for _ in range(n):
        powers.append(F @ powers[-1])
    covariance = linalg.toeplitz([(C @ powers[k] @ P @ C.T).item() for k in range(n)]) + R[0, 0] * np.eye(n)
    mean, x = np.zeros(n), np.zeros(2)
    for k, d in enumerate(gap):
        mean[before + k] = (C @ x).item()
        x = F @ x + G * d
    whole = np.sqrt(mean @ np.linalg.solve(covariance, mean))
    assert whole > 0.5
    assert bound.innovations_snr(A, B, C, Q, R, gap) == pytest.approx(whole, rel=1e-3)


def test_no_three_state_filter_sees_the_rudder_in_time_but_every_other_surface():
    found = bound.best_possible()
    assert found["rudder"]["noticed_three_states"] < 0.5 < found["rudder"]["noticed_whole_model"]
    assert min(v["noticed_three_states"] for s, v in found.items() if s != "rudder") > 0.99
    assert all(v["snr_three_states"] < v["snr_whole_model"] for v in found.values())


def test_bank_of_filters_cannot_tell_the_ailerons_apart():
    found, tables = claims("banks")
    for name in ("bank_cannot", "extended_bank_cannot_in_gusts", "smac_can"):
        assert found[name]["status"] == "reproduced", found[name]
    # The larger bank is not blind: in still air the ailerons' pitching moment gives them away.
    assert tables["banks"]["exact, still air"]["told_apart"] == 1.0
    assert tables["banks"]["extended, gusts 1.0 m/s"]["twin_share"] > 0.0
    assert tables["banks"]["smac, still air"]["told_apart"] == 1.0


def test_operations_are_counted_in_the_source():
    def three(a, b, c):
        return a * b + c - a

    assert load.operations(three) == 3
    assert load.operations(smac_ekf._times) == 15
    found, tables = claims("load")
    assert found["operations_ratio"]["ours"] > 3.0 and tables["load"]["smac"]["filter_states"] == 3


def test_campaign_draws_every_kind_and_its_rows_come_from_flights():
    kinds = {beyond.draw(seed)[0] for seed in range(1, 60)}
    assert kinds == set(beyond.KINDS)
    seed = next(
        s for s in range(1, 200) if beyond.draw(s)[0] == "stuck" and beyond.draw(s)[1].wind.turbulence is None
    )
    rows = beyond.fly_one(seed)
    assert rows == beyond.fly_one(seed) or np.isnan(rows[0]["lost_share"])
    (row,) = rows
    fault = beyond.draw(seed)[1].faults[0]
    assert row["target"] == fault.target and row["size"] == pytest.approx(np.degrees(fault.value))
    assert "| stuck |" in beyond.markdown(beyond.table(rows))
