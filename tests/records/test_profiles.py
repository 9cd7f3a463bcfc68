"""Profiles: every shipped one is sound; a faulty one is refused with the file, the line and what is accepted."""

import re

import pytest

from aerofdi import records
from aerofdi.core import WrongUse
from aerofdi.records.units import CONVERSIONS, channel_units, to_si

HEAD = 'name = "x"\nreader = "csv"\n'


@pytest.mark.parametrize("name", sorted(records.shipped()))
def test_shipped_profiles_state_signs_sources_and_known_channels(name):
    profile = records.shipped()[name]
    assert profile.about and profile.source and profile.signs and profile.match
    assert profile.channels or profile.truth
    for table in (profile.channels, profile.output):
        for channel, spec in table.items():
            assert to_si(spec.unit, name)[0] in channel_units(channel)
    commands = {c.partition(".")[2] for c in profile.channels if c.startswith("command.")}
    assert commands <= set(profile.surfaces), "every mapped command states its sign"
    for members in profile.groups.values():
        assert set(members) <= commands
    assert not set(profile.channels) & set(profile.truth)


def test_every_profile_has_a_match_of_its_own():
    matches = [(tuple(p.reader), repr(p.match)) for p in records.shipped().values()]
    assert len(set(matches)) == len(matches)


@pytest.mark.parametrize(
    ("body", "line", "says"),
    [
        (
            "[channels]\np = { from = 'table.p', untis = 'rad/s' }\n",
            4,
            "unknown key 'untis'; accepted here are from",
        ),
        ("colour = 1\n", 3, "unknown key 'colour'"),
        ("[channels]\np = { from = 'table.p', unit = 'furlong' }\n", 4, "unknown unit 'furlong'"),
        ("[channels]\np = { from = 'table.p', unit = 'm' }\n", 4, "'p' cannot be in 'm'; it is rad/s"),
        ("[channels]\n\nspeed = { from = 'table.v' }\n", 5, "'speed' is not a channel"),
        ("[channels.p]\nunit = 'rad/s'\n", 3, "exactly one of `from` and `mix`"),
        ("[channels.p]\nfrom = 'p'\n", 3, "must be written topic.field"),
        (
            "[channels.p]\nunit = 'rad/s'\nfrom = 'a.b'\nsign = 'up'\n",
            6,
            "'sign' is 'up'; it must be a number",
        ),
        ("[channels.p]\nunit = 'rad/s'\nfrom = 'a.b'\nrepeats = 1\n", 6, "must be true or false"),
        ("[channels.p]\nunit='rad/s'\nmix = { 'a.b' = 1, 'c.d' = 2 }\n", 3, "must share one clock"),
        ("[channels.p]\nunit='rad/s'\nfrom = 'a.b'\nlimits = [1, 0]\n", 6, r"must be \[low, high\]"),
        ("[channels.mode]\nfrom = 'a.b'\ncodes = 'nonsense'\n", 5, "unknown code table"),
        ("[channels.mode]\nfrom = 'a.b'\ncodes = { one = 'x' }\n", 5, "number = name"),
        ("[surfaces]\nrudder = { yaw = 2 }\n", 4, "must give the sign"),
        ("[outputs]\nscheme = 'mine'\n", 4, "scheme must be one of ardupilot, px4"),
        ("[time]\nfield = 'a.b'\nunit = 'h'\n", 5, "s, ms, us or ns"),
        ("[servos.rudder]\nneutral = 1500\n", 4, "unknown key 'neutral'"),
    ],
)
def test_faults_are_named_with_their_line(body, line, says):
    with pytest.raises(WrongUse, match=says) as caught:
        records.parse_profile(HEAD + body, "mine.toml")
    assert re.match(rf"mine\.toml, line {line}: ", str(caught.value)), str(caught.value)


def test_broken_toml_unknown_reader_and_missing_name():
    with pytest.raises(WrongUse, match=r"mine\.toml: not TOML: .*line 1"):
        records.parse_profile("name = \n", "mine.toml")
    with pytest.raises(WrongUse, match="unknown reader 'vhs'"):
        records.parse_profile('name = "x"\nreader = "vhs"\n', "mine.toml")
    with pytest.raises(WrongUse, match="needs `name` and `reader`"):
        records.parse_profile('reader = "csv"\n', "mine.toml")


def test_conversions_are_consistent():
    assert to_si("deg", "x") == ("rad", pytest.approx(3.141592653589793 / 180))
    for unit, (si, factor) in CONVERSIONS.items():
        assert CONVERSIONS[si] == (si, 1.0) and factor > 0, unit
