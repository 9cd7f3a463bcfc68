"""Tables that speak the house's own names: a profile made from the header, without a TOML file."""

from __future__ import annotations

import re

from .log import Log
from .profile import ChannelSpec, Profile
from .units import CONVERSIONS, channel_units, to_si

TIME_NAMES = ("t_s", "t", "time_s", "time", "timestamp", "t_log")
_SUFFIXES = {"_deg": "deg", "_dps": "deg/s", "_deg_s": "deg/s", "_kmh": "km/h", "_kt": "kt", "_g": "g"}


def split_header(column: str) -> tuple[str, str | None]:
    """'phi [deg]' or 'phi_deg' -> ('phi', 'deg'); no unit -> None.

    >>> split_header("command.elevator (rad)")
    ('command.elevator', 'rad')
    """
    found = re.fullmatch(r"\s*(\S+)\s*[\[(]\s*([^\])]+?)\s*[\])]\s*", column)
    if found:
        return found.group(1), found.group(2).replace("m/s^2", "m/s2")
    name = column.strip()
    for suffix, unit in _SUFFIXES.items():
        if name.endswith(suffix) and channel_units(name.removesuffix(suffix)):
            return name.removesuffix(suffix), unit
    return name, None


def time_column(columns: list[str]) -> str | None:
    """The column that is the clock: the first of t_s, t, time_s, time, timestamp, with or without a unit."""
    names = {split_header(column)[0].lower(): column for column in columns}
    return next((names[name] for name in TIME_NAMES if name in names), None)


def house_profile(log: Log, everything_is_truth: bool = False) -> Profile | None:
    """A profile for a table whose columns are channel names ('p', 'command.elevator [rad]', 'truth.gain').

    None where there is no time column or not one known channel. everything_is_truth: every other column
    becomes a truth channel of its own name, whatever it is called.
    """
    table = log.tables.get("table")
    if table is None:
        return None
    clock = time_column(list(table.columns))
    if clock is None:
        return None
    found: dict[str, dict[str, ChannelSpec]] = {"channels": {}, "output": {}, "truth": {}}
    assumed = []
    for column, values in table.columns.items():
        if column == clock:
            continue
        name, unit = split_header(column)
        prefix, _, rest = name.partition(".")
        where = prefix if prefix in ("output", "truth") and rest else "channels"
        name = rest if where != "channels" else name
        allowed = channel_units(name)
        if everything_is_truth:
            where = "truth"
        elif where == "channels" and allowed is None:
            continue
        text = values.dtype.kind in "US"
        if unit is None:
            unit = "1" if text or allowed is None else allowed[0]
            if name.startswith("command.") and where == "channels":
                assumed.append(f"{column} has no unit in its header; rad is assumed")
        if unit not in CONVERSIONS or (
            where != "truth" and to_si(unit, "the header")[0] not in (allowed or ())
        ):
            assumed.append(f"{column} is left out: {unit!r} is not a unit of it")
            continue
        found[where][name] = ChannelSpec(source=(f"table.{column}",), unit=unit)
    if not any(found.values()):
        return None
    time_unit = split_header(clock)[1] or "s"
    return Profile(
        name="house names",
        reader=("csv", "parquet"),
        signs="as the file has them; nothing is turned round",
        assumed=tuple(assumed),
        time={"field": f"table.{clock}", "unit": time_unit if time_unit in ("s", "ms", "us", "ns") else "s"},
        channels=found["channels"],
        output=found["output"],
        truth=found["truth"],
    )
