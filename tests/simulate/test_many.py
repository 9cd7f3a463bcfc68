"""Thousands of flights: the same numbers whatever the threads, the batches, the order or the interruptions."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pyarrow import parquet

from aerofdi.core import MissingChannel, WrongUse, bind
from aerofdi.core.types import Channels
from aerofdi.scenarios import load_scenario
from aerofdi.simulate import Normal, Uniform, changed, flights, fly, fly_many
from aerofdi.simulate.many import drawn

SHORT = replace(load_scenario("demo"), duration_s=2.0, faults=load_scenario("demo").faults[:1])
SHORT = changed(SHORT, {"faults.0.start_s": 1.0})
DRAWS = {"faults.0.value": Uniform(-0.1, -0.02), "parameters.aero.derivatives.Cl_p": Normal(1.0, 0.03)}
CHANNELS = ("p", "command.elevon_right", "truth.beta")


def table(folder, kind):
    return parquet.read_table(sorted(folder.glob(f"{kind}-*.parquet"))).sort_by("run").to_pydict()


def test_threads_batches_and_order_change_nothing(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    fly_many(SHORT, 20, DRAWS, CHANNELS, 0.1, one, jobs=1, seed=3, progress=False)
    fly_many(SHORT, 20, DRAWS, CHANNELS, 0.1, two, jobs=5, seed=3, progress=False)
    for kind in ("runs", "data"):
        assert table(one, kind) == table(two, kind)
    single = dict(flights(SHORT, [17, 4], DRAWS, seed=3, jobs=3))
    data = table(one, "data")
    mine = [p for p, r in zip(data["p"], data["run"], strict=True) if r == 17]
    np.testing.assert_array_equal(mine, bind(single[17], Channels(("p",), ("rad/s",)), 0.1, 0.0).z[:, 0])


def test_each_run_is_the_flight_of_its_scenario_seed_and_run(tmp_path):
    out = fly_many(SHORT, 3, None, ("truth.p",), 0.05, tmp_path / "x", seed=9, progress=False)
    data = table(out, "data")
    for run in range(3):
        alone = fly(SHORT, seed=9, run=run).truth["p"]
        from aerofdi.core import Flight

        want = bind(Flight({"p": alone}), Channels(("p",), ("rad/s",)), 0.05, 0.0).z[:, 0]
        got = [v for v, r in zip(data["truth.p"], data["run"], strict=True) if r == run]
        np.testing.assert_array_equal(got, want)


def test_resumes_after_an_interruption(tmp_path):
    class Stop(Exception):
        pass

    def stop(done, total):
        if done == 25:
            raise Stop

    whole = fly_many(SHORT, 40, DRAWS, CHANNELS, 0.1, tmp_path / "whole", progress=False)
    with pytest.raises(Stop):
        fly_many(SHORT, 40, DRAWS, CHANNELS, 0.1, tmp_path / "cut", progress=stop)
    left = sorted(p.name for p in (tmp_path / "cut").iterdir())
    assert left == ["data-00000000.parquet", "dataset.json", "runs-00000000.parquet"]
    seen = []
    cut = fly_many(
        SHORT, 40, DRAWS, CHANNELS, 0.1, tmp_path / "cut", progress=lambda d, t: seen.append((d, t))
    )
    assert seen[0] == (16, 40) and seen[-1] == (40, 40)  # only what was missing is flown
    for kind in ("runs", "data"):
        assert table(cut, kind) == table(whole, kind)
    fly_many(SHORT, 40, DRAWS, CHANNELS, 0.1, cut, progress=lambda d, t: seen.append((d, t)))
    assert seen[-1] == (40, 40)


def test_draws_are_what_they_say_and_are_recorded(tmp_path):
    rows = [drawn(DRAWS, 1, r) for r in range(4000)]
    angle = np.array([r["faults.0.value"] for r in rows])
    factor = np.array([r["parameters.aero.derivatives.Cl_p"] for r in rows])
    assert (
        angle.min() > -0.1 and angle.max() < -0.02 and abs(angle.mean() + 0.06) < 5 * 0.0231 / np.sqrt(4000)
    )
    assert abs(factor.mean() - 1) < 5 * 0.03 / np.sqrt(4000) and factor.std() == pytest.approx(0.03, rel=0.06)
    assert abs(np.corrcoef(angle, factor)[0, 1]) < 5 / np.sqrt(4000)
    given = {"faults.0.value": [-0.02, -0.03, -0.04]}
    out = fly_many(SHORT, 3, given, (), 0.1, tmp_path / "x", progress=False)
    assert table(out, "runs")["faults.0.value"] == [-0.02, -0.03, -0.04]
    assert not list(out.glob("data-*"))
    for run, flight in flights(SHORT, 3, given):
        assert flight.meta["faults"][0]["about_trim"] == pytest.approx(given["faults.0.value"][run])


def test_another_dataset_in_the_folder_is_refused(tmp_path):
    out = fly_many(SHORT, 2, None, (), 0.1, tmp_path / "x", progress=False)
    for kw in ({"seed": 77}, {"runs": 3}, {"channels": ("p",)}):
        with pytest.raises(WrongUse, match=next(iter(kw))):
            fly_many(**{"scenario": SHORT, "runs": 2, "out": out, "progress": False, **kw})
    with pytest.raises(WrongUse, match="scenario_hash"):
        fly_many(changed(SHORT, {"duration_s": 3.0}), 2, out=out, progress=False)
    (tmp_path / "y").mkdir()
    (tmp_path / "y" / "other.parquet").write_bytes(b"")
    with pytest.raises(WrongUse, match="something else"):
        fly_many(SHORT, 2, out=tmp_path / "y", progress=False)
    assert json.loads((out / "dataset.json").read_text())["runs"] == 2


def test_unknown_channels_and_short_draws_are_refused(tmp_path):
    with pytest.raises(MissingChannel, match="beta"):
        fly_many(SHORT, 2, None, ("beta",), 0.1, tmp_path / "x", progress=False)
    with pytest.raises(WrongUse, match="2 values for 3 runs"):
        fly_many(SHORT, 3, {"faults.0.value": [0.0, 0.1]}, out=tmp_path / "y", progress=False)


def test_the_bar_is_shown_and_taken_away(tmp_path, capsys):
    fly_many(SHORT, 2, out=tmp_path / "x")
    assert "Traceback" not in capsys.readouterr().err
