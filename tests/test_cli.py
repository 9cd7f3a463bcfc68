"""The command line: quick to start, one clear line for every error, one JSON object, the promised exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerofdi
from aerofdi import cli
from aerofdi.core import CannotJudge, Flight, Series
from aerofdi.records import read_flight, write_flight


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """(exit code, stdout, stderr) of one command in this process."""
    code = cli.execute(words)
    return code, *capsys.readouterr()


def one_line(err: str) -> str:
    """What stderr says, which must be one line without a traceback."""
    assert err.count("\n") == 1 and "Traceback" not in err, err
    return err


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's flight as a file."""
    path = tmp_path_factory.mktemp("demo") / "demo.parquet"
    assert cli.execute(["fly", "demo", "-o", str(path)]) == 0
    return path


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """A record of a minute in which no surface moves."""
    t = 0.02 * np.arange(3000)
    rates = {n: Series(t, 0.01 * np.sin((1 + i) * t), "rad/s") for i, n in enumerate("pqr")}
    flight = Flight(
        rates | {"command.elevator": Series(t, np.zeros(3000), "rad")}, meta={"source": "ground.parquet"}
    )
    write_flight(flight, tmp_path / "ground.parquet")
    return tmp_path / "ground.parquet"


@pytest.mark.parametrize("words", [["--help"], ["--version"]])
def test_starts_at_once(words: list[str]) -> None:
    """Nothing heavy is loaded, and the processor is busy for less than 0.3 s (wall time depends on the neighbours)."""
    probe = (
        "import resource, sys\n"
        "from aerofdi.cli import execute\n"
        f"code = execute({words!r})\n"
        "heavy = [m for m in ('numpy', 'scipy', 'numba', 'pyarrow', 'rich', 'plotly') if m in sys.modules]\n"
        "used = resource.getrusage(resource.RUSAGE_SELF)\n"
        "print(code, heavy, used.ru_utime + used.ru_stime, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    code, heavy, seconds = (
        done.stderr.split(" ", 1)[0],
        done.stderr.split("[")[1].split("]")[0],
        done.stderr.split()[-1],
    )
    assert code == "0" and heavy == "" and float(seconds) < 0.3, done.stderr
    assert (
        ("diagnose" in done.stdout)
        if words == ["--help"]
        else done.stdout == f"aerofdi {aerofdi.__version__}\n"
    )


def test_the_commands_of_the_architecture(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "--help")
    for name in ("fly", "diagnose", "identify", "design", "paper", "info", "demo"):
        assert f"\n  {name} " in out
        assert run(capsys, name, "--help")[0] == 0
    assert all(len(line) <= 80 for line in out.splitlines())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diagnose", "nowhere.ulg"], "nowhere.ulg"),
        (["info", "nowhere"], "aircraft are"),
        (["diagnose"], "FLIGHT"),
        (["diagnose", "x.csv", "--nonsense"], "--nonsense"),
        (["nonsense"], "nonsense"),
        (["fly", "nowhere"], "nowhere"),
        (["design", "magic", "--aircraft", "vireo"], "lpv_observer, smac"),
        (["design", "smac", "--aircraft", "vireo", "--set", "nodes"], "KEY=VALUE"),
        (["design", "lpv_observer", "--aircraft", "vireo", "--set", "wings=3"], "wings"),
        (["paper", "nowhere"], "nowhere"),
        (["identify", "nowhere.csv", "-o", "a.toml"], "nowhere.csv"),
        (["identify", "x.csv", "-o", "nowhere/a.toml"], "nowhere/a.toml"),
        (["fly", "demo", "-o", "nowhere/f.parquet"], "nowhere/f.parquet"),
        (["diagnose", "x.csv", "--report", "nowhere/r.html"], "nowhere/r.html"),
        (["design", "smac", "--aircraft", "vireo", "-o", "."], "'-o'"),
        (["demo", "--report", "nowhere/r.html"], "nowhere/r.html"),
        (["diagnose", "x.csv", "--false-alarms-per-hour", "0"], "above 0 and at most 60 per hour"),
        (["identify", "x.csv", "--false-alarms-per-hour", "often"], "--false-alarms-per-hour"),
    ],
)
def test_wrong_use_is_one_line_and_code_2(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    code, out, err = run(capsys, *words)
    assert code == 2 and out == "" and said in one_line(err)


def test_foreign_and_empty_files(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for name, content in (
        ("a.ulg", b""),
        ("b.BIN", b"hello"),
        ("c.csv", b"\xff\xfe\x00"),
        ("d.toml", b"x = 1"),
    ):
        (tmp_path / name).write_bytes(content)
        command = "info" if name.endswith("toml") else "diagnose"
        code, out, err = run(capsys, command, str(tmp_path / name))
        assert code == 2 and out == "" and name in one_line(err)


def test_one_unreadable_file_leaves_the_others_their_results(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, ground: Path
) -> None:
    bad, worse = tmp_path / "bad.ulg", tmp_path / "worse.BIN"
    bad.write_bytes(b"")
    worse.write_bytes(b"hello")
    page = tmp_path / "r.html"
    code, out, err = run(capsys, "diagnose", str(bad), str(ground), str(worse), "--report", str(page))
    assert code == 2 and "cannot judge" in out and page.exists()
    first, second = err.splitlines()
    assert first.startswith("not judged: ") and "bad.ulg" in first and "worse.BIN" in second
    code, out, err = run(capsys, "diagnose", str(ground), str(bad), "--json")
    told = json.loads(out)
    assert code == 2 and "bad.ulg" in one_line(err)
    assert [f["file"] for f in told["flights"]] == [str(ground)]
    assert [r["file"] for r in told["refused"]] == [str(bad)] and told["refused"][0]["error"]
    code, out, err = run(capsys, "diagnose", str(worse), str(bad), "--report", str(tmp_path / "none.html"))
    assert code == 2 and out == "" and err.count("\n") == 2 and not (tmp_path / "none.html").exists()


def test_wrong_unit_names_both_sides(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    t = 0.02 * np.arange(2000)
    measured = {n: Series(t, np.sin(t), "deg/s" if n == "p" else "rad/s") for n in "pqr"}
    measured["command.elevator"] = Series(t, np.sin(3 * t), "rad")
    write_flight(Flight(measured, meta={"source": "odd.parquet"}), tmp_path / "odd.parquet")
    code, _, err = run(capsys, "diagnose", str(tmp_path / "odd.parquet"))
    assert code == 2 and "'rad/s'" in one_line(err) and "'deg/s'" in err and "'p'" in err


def test_a_missing_channel_is_code_3_with_both_sides(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    t = 0.02 * np.arange(2000)
    measured = {"phi": Series(t, np.sin(t), "rad"), "command.elevator": Series(t, np.sin(3 * t), "rad")}
    write_flight(Flight(measured, meta={"source": "few.parquet"}), tmp_path / "few.parquet")
    code, out, _ = run(capsys, "diagnose", str(tmp_path / "few.parquet"), "--json")
    (told,) = json.loads(out)["flights"]
    assert code == 3 and all(r["verdict"] == "cannot_judge" for r in told["results"])
    assert all("angular rates" in r["reason"] and "command.elevator" in r["reason"] for r in told["results"])


def test_what_cannot_be_judged_is_never_healthy(capsys: pytest.CaptureFixture[str], ground: Path) -> None:
    code, out, _ = run(capsys, "diagnose", str(ground))
    assert code == 3 and "cannot judge" in out and "No surface fault found" not in out
    code, out, _ = run(capsys, "info", str(ground))
    assert code == 0 and "no surface command ever moves" in " ".join(out.split())


def raising(error: BaseException) -> Any:
    def never(*_: Any, **__: Any) -> Any:
        raise error

    return never


def test_an_interruption_says_what_was_kept(
    capsys: pytest.CaptureFixture[str], monkeypatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("aerofdi.pipeline.diagnose", raising(KeyboardInterrupt()))
    code, out, err = run(capsys, "diagnose", "x.csv")
    assert code == 130 and out == "" and "nothing had been written" in one_line(err)
    monkeypatch.setattr("aerofdi.pipeline.diagnose", lambda *_, **__: [])
    monkeypatch.setattr("aerofdi.report.write_html", lambda found, path: path)
    monkeypatch.setattr("aerofdi.pipeline.save_models", raising(KeyboardInterrupt()))
    code, _, err = run(capsys, "diagnose", "x.csv", "--report", "r.html")
    assert code == 130 and "kept: r.html" in one_line(err)


def test_an_internal_error_is_one_line_unless_asked(capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    monkeypatch.delenv("AEROFDI_DEBUG", raising=False)
    monkeypatch.setattr("aerofdi.pipeline.diagnose", raising(ZeroDivisionError("two\nlines")))
    code, out, err = run(capsys, "diagnose", "x.csv")
    assert code == 1 and out == "" and "internal error: ZeroDivisionError: two lines" in one_line(err)
    assert "report it" in err
    with pytest.raises(ZeroDivisionError):
        cli.execute(["diagnose", "x.csv", "--debug"])
    monkeypatch.setenv("AEROFDI_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        cli.execute(["diagnose", "x.csv"])


def test_an_error_of_the_house_keeps_its_code(capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    monkeypatch.setattr("aerofdi.pipeline.learn", raising(CannotJudge("too short")))
    code, _, err = run(capsys, "identify", "x.csv")
    assert code == 3 and one_line(err) == "error: too short\n"


def test_a_reader_that_stops_early_is_no_error(demo: Path) -> None:
    command = f"{sys.executable} -m aerofdi info {demo} | head -1"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "" and "demo" in done.stdout


def test_fly_writes_a_flight(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    flight = read_flight(demo)
    assert flight.meta["aircraft"] == "vireo" and flight.duration_s > 80.0
    assert any("elevon_right" in e.text for e in flight.events)


def test_info_tells_who_can_judge(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    code, out, _ = run(capsys, "info", str(demo), "--json")
    told = json.loads(out)
    can = {a["diagnoser"]: a for a in told["diagnosers"]}
    assert code == 0 and told["kind"] == "flight" and can["parity"]["runs"] and can["effectiveness"]["runs"]
    assert not can["smac"]["runs"] and "aerofdi design smac" in can["smac"]["why"]
    assert any(
        c["name"] == "p" and c["unit"] == "rad/s" and c["gaps"]["count"] == 0 for c in told["channels"]
    )
    code, out, _ = run(capsys, "info", str(demo))
    assert code == 0 and all(len(line) <= 80 for line in out.splitlines())


@pytest.mark.parametrize("target", ["vireo", "demo"])
def test_info_of_the_package(capsys: pytest.CaptureFixture[str], target: str) -> None:
    code, out, err = run(capsys, "info", target)
    assert code == 0 and err == "" and "right" in out
    told = json.loads(run(capsys, "info", target, "--json")[1])
    assert told["kind"] == {"vireo": "aircraft", "demo": "scenario"}[target] and told["name"] == target


def test_diagnose_writes_page_and_model_and_the_model_judges_again(
    capsys: pytest.CaptureFixture[str], demo: Path, tmp_path: Path
) -> None:
    page = tmp_path / "r.html"
    code, out, err = run(capsys, "diagnose", str(demo), "--report", str(page), "--json")
    told = json.loads(out)
    assert err == "" and code in (0, 3, 10)
    assert told["files"] == [str(page), str(tmp_path / "r.aircraft.toml")]
    assert page.stat().st_size < 3e6 and all(Path(f).exists() for f in told["files"])
    (flight,) = told["flights"]
    assert set(flight) == {"file", "duration_s", "trained", "judged", "results"}
    events = [e for r in flight["results"] for e in r["events"]]
    assert (code == 10) == bool(events)
    assert all(
        {"t_s", "event", "fault", "mode", "estimate", "estimate_std", "unit"} <= set(e) for e in events
    )
    again, text, _ = run(capsys, "diagnose", str(demo), "--aircraft", told["files"][1], "--judge", "40:90")
    assert (
        again == code and "not on this flight" in text and all(len(line) <= 80 for line in text.splitlines())
    )


def test_identify_and_show_what_was_learnt(
    capsys: pytest.CaptureFixture[str], demo: Path, tmp_path: Path
) -> None:
    path = tmp_path / "a.toml"
    code, out, _ = run(capsys, "identify", str(demo), "-o", str(path), "--healthy", "5:40")
    assert code == 0 and path.exists()
    for wanted in ("Roll", "R²", "held out", "±", "left elevon"):
        assert wanted in out
    code, out, _ = run(capsys, "info", str(path))
    assert code == 0 and "Pitch" in out
    told = json.loads(run(capsys, "info", str(path), "--json")[1])
    assert told["kind"] == "aircraft" and len(told["axes"]) == 3 and told["calibration"]


def test_demo(capsys: pytest.CaptureFixture[str], monkeypatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, "demo")
    assert code == 0 and err == "" and "FAULT" in out and "ight elevon" in out
    assert sorted(os.listdir(tmp_path)) == ["aerofdi-demo.aircraft.toml", "aerofdi-demo.html"]
