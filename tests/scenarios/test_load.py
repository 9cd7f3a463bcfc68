"""A scenario file says what it means: units are converted, unknown keys and wrong units refused with the
line.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core import UnreadableFile, WrongUse
from aerofdi.scenarios import load_scenario, scenario_names
from aerofdi.scenarios.reader import factor
from aerofdi.simulate.prepare import prepare

BASE = """\
aircraft = "vireo"
duration = "1 min"
seed = 7

[start]
airspeed = "36 kt"
altitude = "300 ft"
heading = "90 deg"

[guidance]
lateral = "course"

[[guidance.point]]
t = "0 s"

[[guidance.point]]
t = "5 s"
course = "120 deg"

[wind]
speed = "18 km/h"
from = "180 deg"
turbulence = { model = "dryden", level = "light" }

[sensors.p]
noise = "0.2 deg/s"
drift = "0.6 deg/s/min"
walk = "0.1 deg/s/sqrt(s)"
delay = "20 ms"

[[fault]]
target = "elevon_right"
mode = "stuck"
value = "-5 deg"
about = "trim"
start = "20 s"
end = "40 s"
"""


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text.replace('duration = "1 min"', 'duration = "60 s"'))
    return path


def line_of(text, word):
    return 1 + next(i for i, line in enumerate(text.split("\n")) if word in line)


def test_units_become_si(tmp_path):
    s = load_scenario(write(tmp_path, BASE))
    assert s.start.airspeed == pytest.approx(36 * 1852 / 3600) and s.start.altitude == pytest.approx(91.44)
    assert s.start.heading == pytest.approx(math.pi / 2)
    assert s.wind.speed == pytest.approx(5.0) and s.wind.direction == pytest.approx(math.pi)
    assert s.wind.turbulence.wind_20ft == pytest.approx(15 * 0.514444)
    p = s.sensors["p"]
    assert p["sigma"] == pytest.approx(math.radians(0.2)) and p["drift"] == pytest.approx(math.radians(0.01))
    assert p["walk"] == pytest.approx(math.radians(0.1)) and p["delay_s"] == pytest.approx(0.02)
    (fault,) = s.faults
    assert fault.value == pytest.approx(math.radians(-5)) and (fault.start_s, fault.end_s) == (20.0, 40.0)
    assert (s.seed, s.duration_s, s.name, s.title) == (7, 60.0, "mine", "mine")
    # What a point leaves out stays as it was.
    first, second = s.guidance.points
    assert first.angle == pytest.approx(math.pi / 2) and second.angle == pytest.approx(math.radians(120))
    assert second.airspeed == s.start.airspeed and second.altitude == s.start.altitude


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('speed = "18 km/h"', 'sped = "18 km/h"', ["'sped'", "known", "speed"]),
        ('altitude = "300 ft"', 'altitude = "300 kg"', ["'kg'", "accepted", "ft"]),
        ('altitude = "300 ft"', "altitude = 300", ["needs a number and its unit"]),
        ('altitude = "300 ft"', 'altitude = "high"', ["needs a number and its unit"]),
        ('model = "dryden"', 'model = "kolmogorov"', ["kolmogorov", "von_karman"]),
        ('target = "elevon_right"', 'target = "elevator"', ["elevator", "elevon_left", "sensor."]),
        ('mode = "stuck"', 'mode = "lift_loss"', ["lift_loss", "stuck"]),
        ('value = "-5 deg"', 'value = "-5 m"', ["'m'", "deg"]),
        ('about = "trim"', 'about = "zero"', ["zero", "neutral"]),
        ('about = "trim"\n', "", ["misses 'about'"]),
        ('noise = "0.2 deg/s"', 'nose = "0.2 deg/s"', ["'nose'", "noise"]),
        ("[sensors.p]", "[sensors.smell]", ["smell", "airspeed"]),
        ('aircraft = "vireo"', 'aircraft = "zeppelin"', ["zeppelin", "vireo"]),
        ("seed = 7", 'seed = "7"', ["whole number"]),
        ('lateral = "course"', 'lateral = "corse"', ["corse", "track"]),
        ('course = "120 deg"', 'heading = "120 deg"', ["heading", "course"]),
        ("seed = 7", "seed = 7\nwether = 1", ["wether"]),
    ],
)
def test_mistakes_are_refused_with_file_and_line(tmp_path, old, new, says):
    assert old in BASE
    text = BASE.replace(old, new)
    path = write(tmp_path, text)
    with pytest.raises(WrongUse) as caught:
        load_scenario(path)
    message = str(caught.value)
    assert all(word in message for word in says), message
    said = int(message.split("line ")[1].split(":")[0])
    where = line_of(text, new.split("\n")[-1]) if new else line_of(text, "[[fault]]")
    assert str(path) in message and said == where, message


def test_unreadable_files_and_unknown_names():
    with pytest.raises(UnreadableFile, match=r"nowhere\.toml"):
        load_scenario("nowhere.toml")
    with pytest.raises(WrongUse, match="demo"):
        load_scenario("domo")


def test_aircraft_numbers_by_value_and_by_factor(tmp_path):
    s = load_scenario(
        write(
            tmp_path, BASE + '\n[parameters]\n"mass.mass" = "1.5 kg"\n"reference.span" = { factor = 1.1 }\n'
        )
    )
    aircraft = prepare(s).aircraft
    assert aircraft.number("mass.mass") == 1.5 and aircraft.number("reference.span") == pytest.approx(
        1.1 * 0.9723
    )
    with pytest.raises(WrongUse, match=r"line \d+.*mass\.mas"):
        load_scenario(write(tmp_path, BASE + '\n[parameters]\n"mass.mas" = "1.5 kg"\n'))


def test_gusts_tracks_profiles_and_hardover(tmp_path):
    text = BASE.replace('lateral = "course"', 'lateral = "track"').replace(
        'course = "120 deg"', 'altitude = "60 m"'
    )
    text = text.replace(
        "[wind]", '[guidance.track]\nlength = "300 m"\nwidth = "100 m"\nturn = "left"\n\n[wind]'
    )
    text += """
[[wind.gust]]
start = "3 s"
velocity = { v = [0, -3, 0], unit = "kt" }
length = { v = [10, 20, 30], unit = "ft" }
stays = false

[[fault]]
target = "elevon_left"
mode = "hardover"
stop = "lower"
start = "50 s"

[[fault]]
target = "wing_left"
mode = "lift_loss"
value = "10 %"
start = "10 s"
profile = { t = { v = [0, 10], unit = "s" }, share = [0, 1] }
"""
    s = load_scenario(write(tmp_path, text))
    (gust,) = s.wind.gusts
    assert gust.velocity[1] == pytest.approx(-3 * 0.514444, rel=1e-5) and gust.length[2] == pytest.approx(
        9.144
    )
    assert not gust.stays
    np.testing.assert_allclose(
        s.guidance.track.east, [0, 300, 300, 0], atol=1e-9
    )  # starts along heading 90 deg
    np.testing.assert_allclose(s.guidance.track.north, [0, 0, 100, 100], atol=1e-9)
    hard, lift = s.faults[1:]
    assert (
        hard.value == -1.0 and lift.value == pytest.approx(0.1) and lift.profile == ((0.0, 0.0), (10.0, 1.0))
    )
    table = prepare(s).params.faults.rows
    assert table[1, 4] == pytest.approx(math.radians(-30.0))  # the Vireo's lower stop


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_scenario_can_be_flown(name):
    prepared = prepare(load_scenario(name))
    assert prepared.steps > 1000 and prepared.trim.residual < 1e-6
    assert set(prepared.autopilot.module.Command._fields) <= set(prepared.servos)


def test_there_is_one_for_every_aircraft_and_one_of_them_is_the_demo():
    flown = {load_scenario(n).aircraft for n in scenario_names()}
    assert flown == {"vireo", "ultrastick120", "aerosonde", "aerosonde_aerosim", "ducard"}
    demo = load_scenario("demo")
    assert demo.faults[0].about == "trim" and demo.faults[0].value == pytest.approx(math.radians(-5))
    assert replace(demo, faults=()).faults == ()


@settings(deadline=None)
@given(x=st.floats(1e-3, 1e3))
def test_units_per_time(x):
    assert x * factor("deg/s/min", "rad/s/s") == pytest.approx(math.radians(x) / 60)
    assert x * factor("deg/s/sqrt(s)", "rad/s/sqrt(s)") == pytest.approx(math.radians(x))
    assert factor("deg/s/s", "rad/s/sqrt(s)") is None and factor("m/s", "rad/s") is None
