"""Profiles: small TOML files that say what the fields of a log mean; see profiles/README.md."""

from __future__ import annotations

import functools
import re
import tomllib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from ..core import WrongUse
from .codes import CODE_TABLES
from .units import CONVERSIONS, channel_units, to_si

FORMATS = ("ulog", "dataflash", "tlog", "rosbag", "alfa", "paparazzi", "mat", "csv", "parquet")
SCHEMES = ("ardupilot", "px4")
AXES = ("roll", "pitch", "yaw")
TABLES = ("channels", "output", "truth")


@dataclass(frozen=True)
class ChannelSpec:
    """How one channel is formed: value = sign * scale * (raw - offset), converted from `unit`.

    source: 'topic.field' alternatives, the first present wins. mix: weighted sum of fields of one topic, in
    place of source. farthest_from: of all sources (of one topic) take, at each sample, the one farthest from
    this raw value. where: keep only samples whose other fields have these values. bit: take this bit of an
    integer; equals: 1 where the raw value is this, else 0. codes: number -> name, or the name of a code
    table. limits: clip of the converted value; negative_scale: factor then applied to negative values (servos
    whose travel differs on the two sides of neutral). absent_if_zero: no channel at all where every value is
    0, because such a log had no sensor.
    """

    source: tuple[str, ...] = ()
    unit: str = "1"
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    mix: dict[str, float] = field(default_factory=dict)
    farthest_from: float | None = None
    where: dict[str, float] = field(default_factory=dict)
    bit: int | None = None
    equals: float | None = None
    codes: dict[int, str] | None = None
    limits: tuple[float, float] | None = None
    negative_scale: float = 1.0
    repeats: bool = False
    absent_if_zero: bool = False

    @property
    def topics(self) -> set[str]:
        return {name.partition(".")[0] for name in (*self.source, *self.mix)}


@dataclass(frozen=True)
class Profile:
    """A checked profile. channels, output and truth become the three tables of a Flight."""

    name: str
    reader: tuple[str, ...]
    about: str = ""
    source: str = ""
    aircraft: str = ""
    signs: str = ""
    autopilot_modes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    match: dict[str, Any] = field(default_factory=dict)
    time: dict[str, Any] = field(default_factory=dict)
    channels: dict[str, ChannelSpec] = field(default_factory=dict)
    output: dict[str, ChannelSpec] = field(default_factory=dict)
    truth: dict[str, ChannelSpec] = field(default_factory=dict)
    surfaces: dict[str, dict[str, int]] = field(default_factory=dict)
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)
    servos: dict[str, dict[str, float]] = field(default_factory=dict)
    outputs: dict[str, Any] = field(default_factory=dict)

    @property
    def topics(self) -> set[str]:
        """Every topic this profile reads or matches on."""
        specs = (*self.channels.values(), *self.output.values(), *self.truth.values())
        found = {topic for spec in specs for topic in spec.topics} | set(self.match.get("topics", ()))
        found |= {name.partition(".")[0] for name in self.match.get("fields", ())}
        found |= {name.partition(".")[0] for name in self.outputs.get("topics", ())}
        if "field" in self.time:
            found.add(self.time["field"].partition(".")[0])
        return found


_TOP = {
    "name": str,
    "reader": (str, list),
    "about": str,
    "source": str,
    "aircraft": str,
    "signs": str,
    "autopilot_modes": list,
    "assumed": list,
    "match": dict,
    "time": dict,
    "channels": dict,
    "output": dict,
    "truth": dict,
    "surfaces": dict,
    "groups": dict,
    "aliases": dict,
    "servos": dict,
    "outputs": dict,
}
_CHANNEL = {
    "from": (str, list),
    "unit": str,
    "sign": (int, float),
    "scale": (int, float),
    "offset": (int, float),
    "mix": dict,
    "farthest_from": (int, float),
    "where": dict,
    "bit": int,
    "equals": (int, float),
    "codes": (str, dict),
    "limits": list,
    "negative_scale": (int, float),
    "repeats": bool,
    "absent_if_zero": bool,
}
_MATCH = {"topics": list, "fields": list, "info": dict}
_TIME = {"field": str, "unit": str}
_OUTPUTS = {"scheme": str, "topics": list, "names": dict}
_SERVO = {"neutral_us": (int, float), "us_per_unit": (int, float)}


class _Checker:
    """Raises WrongUse with the file and the line of the offending key."""

    def __init__(self, text: str, label: str) -> None:
        self.text, self.label = text, label

    def line_of(self, path: tuple[str, ...]) -> int:
        """The line where the last key of `path` is written; of its nearest parent where it is inline."""
        table: tuple[str, ...] = ()
        best, depth = 1, 0
        for number, line in enumerate(self.text.splitlines(), 1):
            header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", line)
            key = re.match(
                r"\s*((?:\"[^\"]*\"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:\"[^\"]*\"|'[^']*'|[\w-]+))*)\s*=", line
            )
            if header:
                table = here = _split_key(header.group(1))
            elif key:
                here = table + _split_key(key.group(1))
            else:
                continue
            common = len(here) if here == path[: len(here)] else 0
            if common > depth:
                best, depth = number, common
        return best

    def fail(self, path: tuple[str, ...], why: str) -> WrongUse:
        return WrongUse(f"{self.label}, line {self.line_of(path)}: {why}")

    def keys(self, table: dict[str, Any], schema: dict[str, Any], path: tuple[str, ...]) -> None:
        for key, value in table.items():
            here = (*path, key)
            if key not in schema:
                raise self.fail(here, f"unknown key {key!r}; accepted here are {', '.join(schema)}")
            kind = schema[key]
            number = bool not in (kind if isinstance(kind, tuple) else (kind,))
            if not isinstance(value, kind) or (isinstance(value, bool) and number):
                kinds = kind if isinstance(kind, tuple) else (kind,)
                names = " or ".join(_WORDS[k] for k in kinds if k is not int or float not in kinds)
                raise self.fail(here, f"{key!r} is {value!r}; it must be {names}")

    def strings(self, table: dict[str, Any], key: str, path: tuple[str, ...]) -> tuple[str, ...]:
        value = table.get(key, [])
        items = [value] if isinstance(value, str) else value
        if not all(isinstance(item, str) for item in items):
            raise self.fail((*path, key), f"{key!r} is {value!r}; it must hold text only")
        return tuple(items)


_WORDS = {
    str: "text",
    list: "a list",
    dict: "a table",
    int: "an integer",
    float: "a number",
    bool: "true or false",
}


def _split_key(text: str) -> tuple[str, ...]:
    parts = re.findall(r"\"([^\"]*)\"|'([^']*)'|([\w-]+)", text)
    return tuple(a or b or c for a, b, c in parts)


def _numbers(check: _Checker, value: dict[str, Any], path: tuple[str, ...]) -> dict[str, float]:
    for key, number in value.items():
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise check.fail((*path, key), f"{key!r} is {number!r}; it must be a number")
    return {key: float(number) for key, number in value.items()}


def _codes(check: _Checker, value: Any, path: tuple[str, ...]) -> dict[int, str] | None:
    if value is None:
        return None
    if isinstance(value, str):
        if value not in CODE_TABLES:
            raise check.fail(path, f"unknown code table {value!r}; there are {', '.join(CODE_TABLES)}")
        return CODE_TABLES[value]
    try:
        return {int(key): str(name) for key, name in value.items()}
    except ValueError as error:
        raise check.fail(path, "codes are written as number = name, as in codes = { 0 = 'off' }") from error


def _channel(check: _Checker, name: str, raw: Any, table: str) -> ChannelSpec:
    path = (table, name)
    if not isinstance(raw, dict):
        raise check.fail(path, f"channel {name!r} must be a table with at least `from` or `mix`")
    check.keys(raw, _CHANNEL, path)
    source = check.strings(raw, "from", path)
    mix = _numbers(check, raw.get("mix", {}), (*path, "mix"))
    if bool(source) == bool(mix):
        raise check.fail(path, f"channel {name!r} needs exactly one of `from` and `mix`")
    for reference in (*source, *mix):
        if "." not in reference.strip("."):
            raise check.fail(path, f"{reference!r} in channel {name!r} must be written topic.field")
    if (mix or "farthest_from" in raw) and len({s.partition(".")[0] for s in (*source, *mix)}) > 1:
        raise check.fail(
            path, f"channel {name!r} combines fields of several topics; they must share one clock"
        )
    unit = raw.get("unit", "1")
    if unit not in CONVERSIONS:
        raise check.fail((*path, "unit"), f"unknown unit {unit!r}; accepted are {', '.join(CONVERSIONS)}")
    if table != "truth":
        allowed = channel_units(name)
        if allowed is None:
            raise check.fail(
                path, f"{name!r} is not a channel of aerofdi; put what only scores verdicts in [truth]"
            )
        if to_si(unit, check.label)[0] not in allowed:
            raise check.fail(
                (*path, "unit"), f"channel {name!r} cannot be in {unit!r}; it is {' or '.join(allowed)}"
            )
    limits = raw.get("limits")
    if limits is not None and (len(limits) != 2 or not limits[0] < limits[1]):
        raise check.fail((*path, "limits"), f"limits {limits!r} must be [low, high]")
    return ChannelSpec(
        source=source,
        unit=unit,
        sign=float(raw.get("sign", 1.0)),
        scale=float(raw.get("scale", 1.0)),
        offset=float(raw.get("offset", 0.0)),
        mix=mix,
        farthest_from=None if "farthest_from" not in raw else float(raw["farthest_from"]),
        where=_numbers(check, raw.get("where", {}), (*path, "where")),
        bit=raw.get("bit"),
        equals=raw.get("equals"),
        codes=_codes(check, raw.get("codes"), (*path, "codes")),
        limits=None if limits is None else (float(limits[0]), float(limits[1])),
        negative_scale=float(raw.get("negative_scale", 1.0)),
        repeats=raw.get("repeats", False),
        absent_if_zero=raw.get("absent_if_zero", False),
    )


def _surfaces(check: _Checker, raw: dict[str, Any]) -> dict[str, dict[str, int]]:
    for surface, signs in raw.items():
        good = isinstance(signs, dict) and signs and set(signs) <= set(AXES)
        if not good or not all(value in (-1, 1) for value in signs.values()):
            raise check.fail(
                ("surfaces", surface),
                f"surface {surface!r} must give the sign (1 or -1) of the moment of a positive command about "
                f"{', '.join(AXES)}, as in {surface} = {{ roll = 1 }}",
            )
    return {surface: dict(signs) for surface, signs in raw.items()}


def parse_profile(text: str, label: str) -> Profile:
    """A profile from TOML text; WrongUse names the file, the line and what is accepted there."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise WrongUse(f"{label}: not TOML: {error}") from error
    check = _Checker(text, label)
    check.keys(raw, _TOP, ())
    reader = check.strings(raw, "reader", ())
    for fmt in reader:
        if fmt not in FORMATS:
            raise check.fail(("reader",), f"unknown reader {fmt!r}; there are {', '.join(FORMATS)}")
    if not reader or "name" not in raw:
        raise WrongUse(f"{label}: a profile needs `name` and `reader` ({', '.join(FORMATS)})")
    for key, schema in (("match", _MATCH), ("time", _TIME), ("outputs", _OUTPUTS)):
        check.keys(raw.get(key, {}), schema, (key,))
    for name, servo in raw.get("servos", {}).items():
        check.keys(servo, _SERVO, ("servos", name))
    outputs = raw.get("outputs", {})
    if outputs and outputs.get("scheme") not in SCHEMES:
        raise check.fail(("outputs", "scheme"), f"scheme must be one of {', '.join(SCHEMES)}")
    if raw.get("time", {}).get("unit", "s") not in ("s", "ms", "us", "ns"):
        raise check.fail(("time", "unit"), "the time unit must be s, ms, us or ns")
    tables = {t: {n: _channel(check, n, spec, t) for n, spec in raw.get(t, {}).items()} for t in TABLES}
    return Profile(
        name=raw["name"],
        reader=reader,
        about=raw.get("about", ""),
        source=raw.get("source", ""),
        aircraft=raw.get("aircraft", ""),
        signs=raw.get("signs", ""),
        autopilot_modes=check.strings(raw, "autopilot_modes", ()),
        assumed=check.strings(raw, "assumed", ()),
        match=raw.get("match", {}),
        time=raw.get("time", {}),
        surfaces=_surfaces(check, raw.get("surfaces", {})),
        groups={k: check.strings(raw["groups"], k, ("groups",)) for k in raw.get("groups", {})},
        aliases={k: str(v) for k, v in raw.get("aliases", {}).items()},
        servos={k: _numbers(check, v, ("servos", k)) for k, v in raw.get("servos", {}).items()},
        outputs=outputs,
        channels=tables["channels"],
        output=tables["output"],
        truth=tables["truth"],
    )


@functools.cache
def shipped() -> dict[str, Profile]:
    """The profiles that come with the package, by name."""
    folder = resources.files("aerofdi.records") / "profiles"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    found = [parse_profile(f.read_text(encoding="utf-8"), f.name) for f in files]
    return {profile.name: profile for profile in found}


def load_profile(profile: str | Path | Profile) -> Profile:
    """A profile by the name of a shipped one, by path, or as it is.

    >>> load_profile("umn_thor").surfaces["elevator"]
    {'pitch': -1}
    """
    if isinstance(profile, Profile):
        return profile
    if isinstance(profile, str) and profile in shipped():
        return shipped()[profile]
    path = Path(profile)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        names = ", ".join(shipped())
        raise WrongUse(f"profile {str(profile)!r} is neither a readable file nor one of {names}") from error
    return parse_profile(text, path.name)
