"""Section 3.2 of the comparison on the Vireo: what its filters are and what is proved of them."""

import pytest

from aerofdi.design.certificates import LIMIT
from aerofdi.papers import folder, judge, load_expected
from aerofdi.papers.vireo_comparison import filters
from aerofdi.papers.vireo_comparison.worst_case import KINDS, NORMS, bounds, lower_bounds

pytest.importorskip("clarabel")

# What must come out; the rest is judged as it comes, each difference with its reason.
REPRODUCED = (
    "order_lat", "order_lon", "scheduled_by_rate", "quadratically_stable", "dutch_roll_rises", "short_period_rises",
    "weight_lat_bandwidth", "weight_lon_uncertainty_phugoid", "fig13_above_lower", "fig13_grows",
    "fig13_smallest_upper",
)  # fmt: skip


@pytest.fixture(scope="module")
def claims():
    expected = [e for e in load_expected(folder("vireo_comparison") / "expected.csv") if e.item == "filters"]
    parts = (filters._design_claims, filters._sensitivity_claims, filters._gain_claims, filters._step_claims)
    ours = {k: v for part in parts for k, v in part().items()}
    assert set(ours) == {e.id for e in expected}
    return {e.id: judge(e, ours[e.id]) for e in expected}


def test_the_claims_that_rest_on_the_method_come_out(claims):
    for key in REPRODUCED:
        assert claims[key]["status"] == "reproduced", claims[key]


def test_every_difference_has_its_reason(claims):
    for c in claims.values():
        assert (c["status"] == "reproduced") or len(c["reason"]) > 20


def test_every_upper_bound_is_proved_on_its_nodes_and_above_the_exact_frozen_gains():
    found = bounds()
    assert {(k, n) for k in KINDS for n in NORMS} <= set(found)
    for (kind, norm), b in found.items():
        assert b.status == "solved" and b.nodes <= LIMIT, (kind, norm, b)
        if norm == 1.0:
            assert b.gain >= max(x.gain for x in lower_bounds(kind))


def test_robust_lpv_has_the_smallest_guarantee_and_others_are_ranked_only_where_intervals_are_disjoint():
    rows = {r["filter"]: r for r in filters.gain_rows()}
    best = rows["Robust-LPV"]
    assert best["proved between nodes"]
    for name in ("Nominal-LTI", "Robust-LTI", "Nominal-LPV"):
        assert best["upper 1.0"] < rows[name]["upper 1.0"]
        for other in rows[name]["surely above"]:
            assert rows[other]["upper 1.0"] < rows[name]["lower"]
    assert {"Nominal-LTI", "Nominal-LPV"} <= {k for k, r in rows.items() if "Robust-LPV" in r["surely above"]}


def test_the_fault_as_an_input_makes_figures_9_and_14_come_out():
    assert filters.excess(filters.sensitivity("robust_lpv", "lat"))[0] > 1.5
    assert filters.excess(filters.sensitivity("stuck_lpv", "lat"))[0] < 1.05
    paper, ours = (
        filters.step_response(k, filters.worst_speed(k)).error for k in ("robust_lpv", "stuck_lpv")
    )
    assert paper > 0.5 and ours < 0.2


def test_figures_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    from aerofdi.papers.vireo_comparison.filter_figures import FIGURES, draw

    paths = draw(tmp_path)
    assert [p.stem for p in paths] == list(FIGURES)
    assert all(p.read_bytes()[:4] == b"\x89PNG" and p.stat().st_size > 10_000 for p in paths)
