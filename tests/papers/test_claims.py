"""How claims are judged, on a paper made up on the spot; and the form of what reproduce returns."""

import json
import math

import pytest

from aerofdi import papers
from aerofdi.core import UnreadableFile, WrongUse
from aerofdi.papers.claims import COLUMNS, Expected, Ours, judge, load_expected

HEAD = ",".join(COLUMNS) + "\n"


def expected(kind, paper=2.0, tolerance=0.5, reason=""):
    return Expected("x", "table4", "Table 4", "a claim", paper, "s", kind, tolerance, reason)


@pytest.mark.parametrize(
    ("kind", "value", "ok"),
    [
        ("value", 2.5, True),
        ("value", 2.6, False),
        ("relative", 2.9, True),
        ("relative", 3.1, False),
        ("at_most", 2.5, True),
        ("at_most", 2.6, False),
        ("at_most", -9.0, True),
        ("at_least", 1.5, True),
        ("at_least", 1.4, False),
        ("at_least", math.inf, True),
        ("value", math.nan, False),
        ("at_most", math.nan, False),
    ],
)
def test_kinds(kind, value, ok):
    row = judge(expected(kind), Ours(value))
    assert row["status"] == ("reproduced" if ok else "not_reproduced")
    assert bool(row["reason"]) == (not ok)
    json.dumps(row, allow_nan=False)


def test_a_difference_keeps_its_reason_and_interval():
    row = judge(
        expected("value", reason="their flight data are not public"), Ours(9.0, (8.0, math.inf), "slow")
    )
    assert row["reason"] == "slow their flight data are not public" and row["ci"] == [8.0, None]
    assert judge(expected("not_reproducible", reason="why"), None)["status"] == "not_reproducible"


def test_a_claim_without_a_value_is_an_error():
    with pytest.raises(WrongUse, match="'x'"):
        judge(expected("value"), None)


def test_files_are_refused_with_their_line(tmp_path):
    path = tmp_path / "expected.csv"
    with pytest.raises(UnreadableFile, match=r"expected\.csv"):
        load_expected(path)
    path.write_text(HEAD + "a,t,w,c,1,s,value,0.1,\na,t,w,c,1,s,value,0.1,\n")
    with pytest.raises(UnreadableFile, match="line 3"):
        load_expected(path)
    path.write_text(HEAD + "a,t,w,c,1,s,sometimes,0.1,\n")
    with pytest.raises(UnreadableFile, match="sometimes"):
        load_expected(path)
    path.write_text("id,claim\na,b\n")
    with pytest.raises(UnreadableFile, match="tolerance"):
        load_expected(path)
    path.write_text(HEAD + "a,t,w,c,,,not_reproducible,,no data\n")
    (row,) = load_expected(path)
    assert math.isnan(row.paper) and row.tolerance == 0.0


def test_every_paper_states_its_claims_and_items():
    for name in papers.names():
        rows = load_expected(papers.folder(name) / "expected.csv")
        assert rows and {r.item for r in rows} <= set(papers.items(name))
        assert all(r.claim and r.where for r in rows)
        assert all(r.reason for r in rows if r.kind == "not_reproducible")
        lines = (papers.folder(name) / "reproduce.py").read_text().count("\n")
        assert lines <= 80, f"{name}/reproduce.py has {lines} lines"
        assert (papers.folder(name) / "README.md").exists()


def test_unknown_papers_and_items_are_refused():
    with pytest.raises(WrongUse, match="there are"):
        papers.reproduce("nothing")
    for name in papers.names():
        with pytest.raises(WrongUse, match="it has"):
            papers.reproduce(name, item="nothing")
