"""Aircraft files: what is read, what is refused, and that every refusal names its line."""

import re
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi import aircraft
from aerofdi.aircraft import aircraft_names, load_aircraft, number_rows
from aerofdi.aircraft.lines import key_lines
from aerofdi.aircraft.load import HOME
from aerofdi.core import UnreadableFile, WrongUse

ALL = ("aerosonde", "aerosonde_aerosim", "ducard", "ultrastick120", "vireo")


def edited(tmp_path: Path, name: str, old: str, new: str) -> tuple[Path, int]:
    """A copy of an aircraft file with one replacement, and the line where it was made."""
    text = (HOME / f"{name}.toml").read_text()
    assert text.count(old) >= 1, old
    path = tmp_path / f"{name}.toml"
    path.write_text(text.replace(old, new, 1))
    for table in HOME.glob(f"{name}_*.toml"):
        (tmp_path / table.name).write_text(table.read_text())
    return path, text[: text.index(old)].count("\n") + 1


def test_the_five_aircraft_are_there() -> None:
    assert aircraft_names() == ALL


@pytest.mark.parametrize("name", ALL)
def test_every_number_has_a_unit_a_source_and_a_line(name: str) -> None:
    a = load_aircraft(name)
    lines = (HOME / f"{name}.toml").read_text().split("\n")
    assert len(a.numbers) > 50
    for path, n in a.numbers.items():
        assert n.source in a.sources and n.unit, path
        key = path.split(".")[-1]
        assert re.match(rf"\s*(\w+\.)?{key}\s*=", lines[n.line - 1]), (path, n.line)
    assert any(n.assumed for n in a.numbers.values())
    assert all(s.lower < s.upper for s in a.surfaces)
    assert [r.path for r in number_rows(a)] == list(a.numbers)


def test_angles_become_radians_and_rates_si() -> None:
    s = load_aircraft("ultrastick120").surface("elevator")
    assert s.upper == pytest.approx(0.43633231)
    assert s.rate_limit == pytest.approx(2.6179939)
    assert s.bandwidth == pytest.approx(50.265482)
    engine = load_aircraft("aerosonde_aerosim").numbers["propulsion.engine_speed"]
    assert engine.value[-1] == pytest.approx(733.03829)


def test_left_and_right_are_separate_and_know_their_group() -> None:
    v = load_aircraft("vireo")
    assert v.groups == {"elevon": ("elevon_left", "elevon_right")}
    assert v.surface("elevon_left").command == {"elevator": 1.0, "aileron": -1.0}
    assert v.surface("elevon_right").feeds == {"elevator": 0.5, "aileron": 0.5}


BREAKAGES = [
    ("vireo", 'mass = { v = 1.28, unit = "kg"', 'mass = { v = 1.28, unit = "m"', "mass.mass is in 'm'; accepted: kg"),
    ("vireo", "[geometry]\n", "[geometry]\nwing_spin = 3\n", "unknown key 'wing_spin' in [geometry]"),
    ("vireo", "CL_alpha = {", "CL_alphaa = {", "unknown key 'CL_alphaa'"),
    ("vireo", "Ixx = { v = 0.032367807", "Ixx = { v = 0.4", "not that of any body"),
    ("vireo", "Ixx = { v = 0.032367807", "Ixx = { v = -0.03", "must be > 0 kg m^2"),
    ("vireo", "v = 1.28, unit", 'v = "heavy", unit', "must be a number"),
    ("vireo", "v = 1.28, unit", "v = nan, unit", "all finite"),
    ("vireo", "v = 1.28, unit", "v = [1.28], unit", "must be a number"),
    ("vireo", 'v = 1.28, unit = "kg", src = "paper"', "v = 1.28, unit = \"kg\"", "has no 'src'"),
    ("vireo", 'v = 1.28, unit = "kg", src = "paper"', 'v = 1.28, unit = "kg", src = "hearsay"', "does not list"),
    ("vireo", 'mass = { v = 1.28, unit = "kg", src = "paper" }', "mass = 1.28", "must be { v = number"),
    ("vireo", 'name = "elevon_right"', 'name = "elevon_left"', "is there twice"),
    ("vireo", 'name = "elevon_right"', 'name = "paddle"', "accepted: 'aileron_left'"),
    ("vireo", "feeds.elevator", "feeds.elevater", "unknown key 'elevater'"),
    ("vireo", 'kind = "thrust_law"', 'kind = "warp"', "'warp'; accepted: 'thrust_law'"),
    ("vireo", 'axes = "body"', 'axes = "sideways"', "accepted: 'body', 'wind'"),
    ("vireo", "format = 1", "format = 7", "this version reads 1"),
    ("vireo", 'kind = "full"', 'kind = "whole"', "accepted: 'full', 'identified'"),
    ("vireo", "min_airspeed = { v = 12.0", "min_airspeed = { v = 32.0", "must be below max_airspeed"),
    ("vireo", "[autopilot]", "[autopilots]", "unknown key 'autopilots'"),
    ("aerosonde_aerosim", "v = [-1.0, 0.0, 0.1,", "v = [-1.0, 0.1, 0.1,", "must increase strictly"),
    ("aerosonde", "[aero.icing.control.rudder]", "[aero.icing.control.fin]", "not in [aero.control]"),
    ("ducard", 'CT = { v = [0.0842,', 'CT = { v = [1.0, 0.0842,', "must have 3 values, got 4"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "old", "new", "message"), BREAKAGES)
def test_a_wrong_file_is_refused_with_its_line(
    tmp_path: Path, name: str, old: str, new: str, message: str
) -> None:
    path, line = edited(tmp_path, name, old, new)
    with pytest.raises(WrongUse) as caught:
        load_aircraft(path)
    text = str(caught.value)
    assert message in text
    found = re.search(r", line (\d+):", text)
    assert found and abs(int(found.group(1)) - line) <= 1, text
    assert str(path) in text


@pytest.mark.parametrize("key", ["Iyy", "CD_0", "wing_area", "max_thrust", "rate", "bandwidth", "min"])
def test_a_missing_number_is_named_with_the_line_of_its_section(tmp_path: Path, key: str) -> None:
    text = (HOME / "vireo.toml").read_text()
    path = tmp_path / "a.toml"
    path.write_text(re.sub(rf"(?m)^{key} = .*\n", "", text, count=1))
    with pytest.raises(WrongUse, match=rf"line \d+: .*misses '{key}'"):
        load_aircraft(path)


def test_a_missing_section_is_named(tmp_path: Path) -> None:
    path, _ = edited(tmp_path, "vireo", "[propulsion]", "[aero.propulsion]")
    with pytest.raises(WrongUse, match="propulsion"):
        load_aircraft(path)


def test_files_that_are_not_there_or_not_toml(tmp_path: Path) -> None:
    with pytest.raises(WrongUse, match="known are aerosonde"):
        load_aircraft("concorde")
    with pytest.raises(UnreadableFile):
        load_aircraft(tmp_path / "nothing.toml")
    path, line = edited(tmp_path, "vireo", "[mass]", "[mass")
    with pytest.raises(UnreadableFile, match=f"line {line}"):
        load_aircraft(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UnreadableFile):
        load_aircraft(path)


def test_wind_tunnel_files_are_checked(tmp_path: Path) -> None:
    path, _ = edited(tmp_path, "ultrastick120", "format = 1", "format = 1")
    table = tmp_path / "ultrastick120_windtunnel.toml"
    good = table.read_text()
    for old, new, message in (
        ("beta = [-30.0, -25.0", "beta = [-30.0, -35.0", "must be two or more numbers that increase"),
        ("[yaw_rate]", "[yaw]", "unknown table 'yaw'"),
        ('angle_unit = "deg"', 'angle_unit = "grad"', "angle_unit"),
        ("p_hat = [0.0, 0.01, ", "p_hat = [0.0, ", "expected \\(16, 6, 3\\)"),
    ):
        assert old in good
        table.write_text(good.replace(old, new, 1))
        with pytest.raises(WrongUse, match=message):
            load_aircraft(path)
    table.unlink()
    with pytest.raises(UnreadableFile, match="windtunnel"):
        load_aircraft(path)


def test_the_hash_follows_numbers_not_words(tmp_path: Path) -> None:
    plain = aircraft.hash(load_aircraft("vireo"))
    noted, _ = edited(tmp_path, "vireo", 'src = "paper" }', 'src = "paper", note = "hello" }')
    assert aircraft.hash(load_aircraft(noted)) == plain
    for old, new in (("v = 1.28,", "v = 1.29,"), ("bank_kp = { v = -0.34", "bank_kp = { v = -0.35")):
        changed, _ = edited(tmp_path, "vireo", old, new)
        assert aircraft.hash(load_aircraft(changed)) != plain
    assert len({aircraft.hash(load_aircraft(n)) for n in ALL}) == len(ALL)


def test_unknown_names_are_refused_with_what_there_is() -> None:
    a = load_aircraft("vireo")
    with pytest.raises(WrongUse, match="elevon_left, elevon_right"):
        a.surface("rudder")
    with pytest.raises(WrongUse, match=r"mass\.wings"):
        a.number("mass.wings")


words = st.text("abcdefgh_", min_size=1, max_size=6)
values = st.one_of(st.integers(), st.text("ab#[]{}=\"'. ", max_size=8), st.lists(st.integers(), max_size=4))


@settings(deadline=None, max_examples=50)
@given(
    st.dictionaries(
        words, st.dictionaries(words, st.one_of(values, st.dictionaries(words, values, min_size=1)))
    )
)
def test_the_line_of_every_key_holds_that_key(document: dict) -> None:
    text = tomli_w.dumps(document, multiline_strings=False)
    lines = text.split("\n")
    found = key_lines(text)
    for table, entries in document.items():
        for key, value in entries.items():
            path = (table, key)
            assert path in found, text
            assert key in lines[found[path] - 1]
            if isinstance(value, dict):
                for inner in value:
                    assert inner in lines[found[(*path, inner)] - 1]


def test_lines_of_arrays_of_tables_and_multi_line_values() -> None:
    text = '# a = 1\n[[s]]\nx = """\ny = 2\n"""\nf.g = [ # [\n 1,\n]\n[[s]]\nx = 1\n[s.t]\nz = { a = 1 }\n'
    found = key_lines(text)
    assert found[("s", 0, "f", "g")] == 6
    assert found[("s", 1)] == 9 and found[("s", 1, "x")] == 10
    assert found[("s", 1, "t", "z")] == 12
    assert ("s", 0, "y") not in found
