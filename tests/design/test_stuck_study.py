"""The study of stuck surfaces: what it reports is what the flight shows."""

import math
from pathlib import Path

import numpy as np
import pytest

import aerofdi.papers.vireo_comparison
from aerofdi.design.io import load_design
from aerofdi.design.stuck_study import Case, Row, stuck_study, summary
from aerofdi.papers.vireo_comparison.methods import method_b

DESIGNS = Path(aerofdi.papers.vireo_comparison.__file__).parent / "designs"


@pytest.fixture(scope="module")
def rows():
    banks = {k: method_b(design=k, name=k) for k in ("robust_lpv", "stuck_lpv")}
    faulty = stuck_study(
        "vireo", banks, (15.0,), (-4.0,), ("elevon_right", "elevon_left"), (0.0,), window_s=8.0
    )
    healthy = stuck_study("vireo", banks, (15.0,), (math.nan,), ("elevon_right",), (0.0,), window_s=8.0)
    return faulty, healthy


def test_faults_are_detected_on_their_side_and_healthy_flight_is_silent(rows):
    faulty, healthy = rows
    assert len(faulty) == 4
    for r in faulty:
        assert 0.0 < r.delay_s < 5.0 and r.first == r.case.surface and not r.false_alarm
        assert r.faulty > math.radians(5.0) > r.healthy
    for r in healthy:
        assert math.isnan(r.delay_s) and not r.false_alarm and r.faulty < math.radians(5.0)


def test_the_fault_as_an_input_makes_detection_faster(rows):
    delay = {(r.diagnoser, r.case.surface): r.delay_s for r in rows[0]}
    for side in ("elevon_left", "elevon_right"):
        assert delay["stuck_lpv", side] < delay["robust_lpv", side]


def test_summary_counts():
    case, stuck_case = Case(15.0, "a", math.nan, 0.0, 1), Case(15.0, "a", -0.1, 0.0, 1)
    made = [
        Row("d", stuck_case, 1.0, "a", False, 0.01, 0.02, 0.3, 1.0),
        Row("d", stuck_case, 3.0, "b", True, -0.03, 0.01, 0.2, 1.0),
        Row("d", case, math.nan, "", False, math.nan, 0.05, 0.1, 1.0),
    ]
    s = summary(made)["d"]
    assert (
        s["detected"] == pytest.approx(2 / 3)
        and s["isolated"] == 0.5
        and s["false_alarms"] == pytest.approx(1 / 3)
    )
    assert s["median_delay_s"] == 2.0 and s["median_error_deg"] == pytest.approx(math.degrees(0.02))
    assert s["largest_healthy_deg"] == pytest.approx(math.degrees(0.05))


def test_the_fault_input_is_what_makes_the_open_loop_follow():
    """A held surface opens the loop: |e/delta| below 1 rad/s, without and with the fault as an input."""
    from aerofdi.papers.vireo_comparison.filters import SENSITIVITY_W, sensitivity

    slow = (SENSITIVITY_W > 0.1) & (SENSITIVITY_W < 1.0)
    paper, ours = (sensitivity(k, "lat").opened[:, slow].max() for k in ("robust_lpv", "stuck_lpv"))
    assert paper > 1.0 and ours < 0.3
    assert (
        np.asarray(load_design(DESIGNS / "stuck_lpv.toml").spec["weights"]["lat"]["fault"]["num"]).max() > 0.0
    )
