"""Truth recorded beside a flight, attached to score verdicts; it never becomes measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..core import Flight, Series
from .log import unreadable
from .plain import house_profile
from .profile import Profile, load_profile, shipped
from .read import read_log
from .sniff import format_of
from .translate import matches, translate


def attach_truth(flight: Flight, path: str | Path, profile: str | Path | Profile | None = None) -> Flight:
    """A copy of the flight with every channel of a truth table (CSV, gzipped or not, Parquet) added to
    `truth`.

    The table must be on the flight's clock. profile: as for `read`; without one, a shipped profile that fits,
    else every column under its own name. Channels that are already there are replaced. measured stays as it
    is.
    """
    path = Path(path)
    kind = format_of(path)
    log = read_log(path, kind)
    chosen = None if profile is None else load_profile(profile)
    if chosen is None:
        scored = [(matches(p, log), p) for p in shipped().values() if kind in p.reader]
        best = max(scored, key=lambda pair: pair[0], default=(0, None))
        chosen = best[1] if best[0] else house_profile(log, everything_is_truth=True)
    if chosen is None:
        raise unreadable(path, "has no time column (t_s, t, time) and fits no profile, so it cannot be truth")
    other = translate(log, chosen, path)
    truth: dict[str, Series] = {**flight.truth, **other.measured, **other.output, **other.truth}
    notes = [*flight.meta.get("notes", []), f"truth attached from {path.name}"]
    return replace(flight, truth=truth, meta={**flight.meta, "notes": notes})
