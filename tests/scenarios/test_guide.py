"""The files in the guide are scenarios as they stand, and its Python works on them."""

import re
from dataclasses import replace
from pathlib import Path

from aerofdi.scenarios import load_scenario
from aerofdi.simulate import Normal, Uniform, fly
from aerofdi.simulate.many import changed, drawn
from aerofdi.simulate.prepare import prepare

GUIDE = Path(__file__).parents[2] / "docs" / "write_a_scenario.md"
TOML = re.findall(r"```toml\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_complete_file_flies(tmp_path):
    path = tmp_path / "my_scenario.toml"
    path.write_text(TOML[0])
    scenario = load_scenario(path)
    flight = fly(replace(scenario, duration_s=3.0), seed=3)
    assert flight.measured["p"].unit == "rad/s" and flight.meta["seed"] == 3
    assert flight.meta["faults"][0]["value"] == 0.5
    draws = {"faults.0.value": Uniform(0.1, 0.9), "parameters.aero.derivatives.Cl_p": Normal(1.0, 0.05)}
    assert prepare(changed(scenario, drawn(draws, 1, 0))).steps == prepare(scenario).steps


def test_the_other_pieces_fit_into_it(tmp_path):
    whole = TOML[0]
    track = re.sub(r"\[guidance\].*?(?=\[wind\])", TOML[1] + "\n", whole, count=1, flags=re.DOTALL)
    for i, text in enumerate((track, whole + "\n" + TOML[2])):
        path = tmp_path / f"piece{i}.toml"
        path.write_text(text)
        assert prepare(load_scenario(path)).steps > 1000
    assert load_scenario(tmp_path / "piece0.toml").guidance.lateral == "track"
    assert prepare(load_scenario(tmp_path / "piece1.toml")).aircraft.number("mass.mass") == 1.35


def test_every_mode_of_the_catalogue_is_in_the_guide():
    from aerofdi.dynamics.faults import MODES

    text = GUIDE.read_text(encoding="utf-8")
    assert all(f"`{mode}`" in text for mode in MODES)
