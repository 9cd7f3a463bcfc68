"""Campaigns: the same rows whatever the order, the processes or an interruption; drawn faults are what was drawn."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from aerofdi.core import Flight, Series, WrongUse
from aerofdi.evaluate import campaign as c
from aerofdi.evaluate.draws import apply, read_draw
from aerofdi.evaluate.truth import faults_of, value_at
from aerofdi.scenarios import load_scenario

TEXT = """
name = "small"
scenarios = ["short.toml"]
seeds = { first = 50, count = 4 }
chunk = 2
score = { settle_s = 3.0, clear_s = 5.0 }
[diagnosers]
A = "aerofdi.papers.vireo_comparison.methods:method_a"
[[draw.fault]]
targets = ["elevon_left", "elevon_right"]
mode = "stuck"
about = "trim"
value = { v = [-7.0, -4.0], unit = "deg" }
start = { v = [6.0, 9.0], unit = "s" }
length = { v = [4.0, 4.0], unit = "s" }
[draw.wind]
speed = { v = [0.0, 5.0], unit = "m/s" }
turbulence = "dryden"
"""
SHORT = """
title = "short"
aircraft = "vireo"
duration = "14 s"
[start]
airspeed = "15.4 m/s"
altitude = "100 m"
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "small.toml").write_text(TEXT)
    (folder / "short.toml").write_text(SHORT)
    return c.load_campaign(folder / "small.toml")


@pytest.fixture(scope="module")
def flown(small, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    said = []
    return c.run_campaign(small, out, lambda text, share: said.append(share), workers=1), said


def same(a, b):
    """Equal to the last digit, NaN equal to NaN."""
    return repr(a) == repr(b)


def test_one_row_a_flight_and_one_a_fault(flown):
    paths, said = flown
    rows = c.load_rows(paths)
    assert len(paths) == 2 and said == [0.0, 0.5, 1.0]
    assert [r["seed"] for r in rows if r["kind"] == "flight"] == [50, 51, 52, 53]
    faults = [r for r in rows if r["kind"] == "fault"]
    assert len(faults) == 4 and all(6.0 <= r["start_s"] <= 9.0 for r in faults)
    assert all(-7.01 <= math.degrees(r["about_trim"]) <= -3.99 for r in faults)
    assert {r["fault"] for r in faults} == {"elevon_left", "elevon_right"}
    # Something happened: method A sees jumps of 4 deg and more within two seconds.
    assert all(r["delay_s"] < 2.0 for r in faults)


def test_an_interrupted_campaign_ends_as_if_nothing_had_been(small, flown, tmp_path):
    paths, _ = flown
    first = c.run_campaign(small, tmp_path, workers=1)
    kept = first[0].stat().st_mtime_ns
    first[1].unlink()
    again = c.run_campaign(small, tmp_path, workers=1)
    assert again[0].stat().st_mtime_ns == kept
    assert same(c.load_rows(again), c.load_rows(first[:1]) + c.load_rows(paths[1:]))
    assert not list(tmp_path.glob(".*"))


def test_processes_do_not_matter(small, flown, tmp_path):
    assert same(c.load_rows(c.run_campaign(small, tmp_path, workers=2)), c.load_rows(flown[0]))


def test_fewer_seeds_are_the_first_ones(small):
    few = c.load_campaign(small.path, 3)
    assert [u.seeds for u in c.units(few)] == [(50, 51), (52,)]


def test_scores_come_back_from_the_rows(flown):
    by_method = c.scores(c.load_rows(flown[0]))
    assert list(by_method) == ["A"] and len(by_method["A"]) == 4
    row, score = by_method["A"][0]
    assert row["seed"] == 50 and len(score.detections) == 1 and score.healthy_s > 2.0
    assert np.isfinite(c.delays(c.load_rows(flown[0]), "A")).all()


def test_the_plot_is_a_picture(flown, tmp_path):
    assert c.plot(c.load_rows(flown[0]), tmp_path / "p.png", "title").stat().st_size > 1000


def test_wrong_files_are_refused_by_name(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text('name = "x"\nsceenarios = []\n')
    with pytest.raises(WrongUse, match="sceenarios"):
        c.load_campaign(path)
    path.write_text(TEXT.replace("targets =", "target ="))
    with pytest.raises(WrongUse, match="targets"):
        c.load_campaign(path)
    path.write_text(TEXT.replace("[-7.0, -4.0]", "[-4.0, -7.0]"))
    with pytest.raises(WrongUse, match=r"low, high"):
        c.load_campaign(path)
    with pytest.raises(WrongUse, match="nowhere"):
        c.make("aerofdi.nowhere:x", "vireo")
    with pytest.raises(WrongUse, match=r"no function 'method_z'; it has .*method_a"):
        c.make("aerofdi.papers.vireo_comparison.methods:method_z", "vireo")


@pytest.mark.parametrize(
    ("given", "instead", "said"),
    [
        ("chunk = 2", "chnk = 2", r"line 5: unknown key 'chnk'; known: .*chunk"),
        ("chunk = 2", "chunk = 0", "line 5: 'chunk' must be a whole number from 1"),
        ("first = 50, ", "", r"line 4: \[seeds\] misses 'first'"),
        ("count = 4", 'count = "x"', "line 4: 'count' must be a whole number"),
        ("settle_s", "setle_s", "line 6: unknown key 'setle_s' .*settle_s"),
        ("clear_s = 5.0", "clear_s = -1.0", "line 6: 'clear_s' must be a number of seconds"),
        ('["short.toml"]', '"short.toml"', "line 3: 'scenarios' must be a list of texts"),
        ('A = "aerofdi', 'B = 1 # "', r"line 8: 'B' is 1"),
    ],
)
def test_every_refusal_has_its_line_and_what_is_accepted(tmp_path, given, instead, said):
    path = tmp_path / "x.toml"
    path.write_text(TEXT.replace(given, instead, 1))
    with pytest.raises(WrongUse, match=said):
        c.load_campaign(path)


def test_parts_that_no_longer_come_out_so_are_refused(small, flown, tmp_path):
    """The parts of another threshold, as a change of the code would leave them."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    for path in flown[0]:
        rows = [r | {"delay_s": r["delay_s"] and r["delay_s"] + 0.1} for r in c.load_rows([path])]
        pq.write_table(pa.Table.from_pylist(rows, c._schema()), tmp_path / path.name)
    with pytest.raises(WrongUse, match=r"seed 50 comes out otherwise .* another folder"):
        c.run_campaign(small, tmp_path, workers=1)


def test_an_interrupt_finishes_what_is_under_way(small, flown, tmp_path):
    """Ctrl-C as a terminal sends it, to the whole group of processes, when the first part has come."""
    code = "import sys; from aerofdi.evaluate.__main__ import main; sys.exit(main())"
    many = small.path.with_name("many.toml")
    many.write_text(TEXT.replace("count = 4", "count = 400"))
    command = [sys.executable, "-c", code, str(many), "-o", str(tmp_path), "--workers", "2"]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("part-*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, error = process.communicate(timeout=120)
    assert process.returncode == 130 and "the same command" in error and "Traceback" not in error + out
    assert not list(tmp_path.glob(".*")) and 2 <= len(list(tmp_path.glob("part-*"))) < 200
    first = c.load_rows(sorted(tmp_path.glob("part-*"))[:1])
    assert same(first, c.load_rows(flown[0][:1]))


def test_a_draw_depends_on_the_seed_alone(small):
    scenario = load_scenario(small.path.parent / "short.toml")
    assert apply(small.draw, scenario, 7) == apply(small.draw, scenario, 7)
    drawn = [apply(small.draw, scenario, s) for s in range(400)]
    sizes = np.array([math.degrees(d.faults[0].value) for d in drawn])
    # Uniform over the range: mean within four standard errors.
    assert abs(sizes.mean() + 5.5) < 4 * 3 / math.sqrt(12 * 400)
    assert -7 <= sizes.min() < -6.9 and -4.1 < sizes.max() <= -4
    assert 0.4 < np.mean([d.faults[0].target == "elevon_left" for d in drawn]) < 0.6
    speeds = np.array([d.wind.speed for d in drawn])
    assert 0 <= speeds.min() < 0.1 and 4.9 < speeds.max() <= 5
    assert all(d.wind.turbulence.wind_20ft == d.wind.speed for d in drawn)


def test_two_drawn_faults_are_drawn_apart(small):
    two = small.draw._replace(faults=small.draw.faults * 2)
    scenario = load_scenario(small.path.parent / "short.toml")
    drawn = np.array([[f.value for f in apply(two, scenario, s).faults] for s in range(400)])
    # Independent: the correlation of 400 pairs stays within four standard errors of none.
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 4 / math.sqrt(400)


def test_an_empty_draw_changes_nothing(small):
    scenario = load_scenario(small.path.parent / "short.toml")
    assert apply(read_draw(Path("x"), {}, {}), scenario, 1) == scenario


def test_faults_of_real_flights_come_from_their_truth():
    t = np.arange(10.0)
    size = np.array([np.nan, np.nan, 0.2, 0.2, np.nan, np.nan, 0.3, 0.3, 0.3, 0.3])
    flight = Flight({"p": Series(t, t, "rad/s")}, truth={"fault.aileron.stuck": Series(t, size, "rad")})
    a, b = faults_of(flight)
    assert (a.fault, a.mode, a.start_s, a.end_s, a.value) == ("aileron", "stuck", 2.0, 4.0, 0.2)
    assert (b.start_s, b.end_s, b.value) == (6.0, math.inf, 0.3)
    assert value_at(flight, "p", 3.5) == 3.0 and math.isnan(value_at(flight, "q", 3.0))
