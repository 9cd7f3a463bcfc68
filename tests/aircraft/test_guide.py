"""The guide for adding an aircraft: its example is a file that loads, trims and flies as its source says."""

import math
import re
from pathlib import Path

import pytest

from aerofdi.aircraft import load_aircraft
from aerofdi.dynamics import modes, summary_lines, trim

GUIDE = Path(__file__).parents[2] / "docs" / "add_an_aircraft.md"
DEG = math.pi / 180.0


@pytest.fixture
def example(tmp_path: Path) -> Path:
    (block,) = re.findall(r"```toml\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    path = tmp_path / "my_aircraft.toml"
    path.write_text(block)
    return path


def test_the_example_loads_and_trims_as_its_source(example: Path) -> None:
    a = load_aircraft(example)
    t = trim(a, 25.0)
    # Computed apart from this package, with a drag of the elevator that the example leaves out.
    assert t.alpha / DEG == pytest.approx(2.848, abs=0.01)
    assert t.commands["elevator"] / DEG == pytest.approx(-7.100, abs=0.02)
    slow = {m.name: m for m in modes(a, 18.0)}
    assert slow["short period"].eigenvalue == pytest.approx(-3.5347 + 7.1120j, abs=0.02)
    assert slow["roll"].eigenvalue.real == pytest.approx(-15.916, abs=0.02)
    assert slow["Dutch roll"].eigenvalue == pytest.approx(-0.9873 + 3.4476j, abs=0.03)
    assert slow["spiral"].eigenvalue.real == pytest.approx(0.1547, abs=2e-3)


def test_the_python_of_the_guide_runs(example: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    monkeypatch.chdir(example.parent)
    exec(compile(code, str(GUIDE), "exec"), {})


def test_the_guide_names_files_that_are_there() -> None:
    for name in re.findall(r"\| `(\w+\.toml)` \|", GUIDE.read_text()):
        assert load_aircraft(name.removesuffix(".toml")).name


def test_the_summary_shows_every_number_trim_and_modes(example: Path) -> None:
    lines = summary_lines(load_aircraft(example))
    text = "\n".join(lines)
    assert lines[0] == "aerosonde_mavsim: Aerosonde of mavsim"
    assert any("mass.mass" in x and "11 kg" in x and "byu-magicc" in x for x in lines)
    assert any("wing_half_arm" in x and "assumed" in x and "a quarter of the span" in x for x in lines)
    assert "angle of attack  2.8" in text and "short period" in text and "Dutch roll" in text
    vireo = "\n".join(summary_lines(load_aircraft("vireo")))
    assert "angle of attack  3.907 deg" in vireo
    assert "Dutch roll    4.063 rad/s, damping 0.1338" in vireo
