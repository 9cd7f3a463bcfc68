"""`read`: a flight record in, a Flight out."""

from __future__ import annotations

from pathlib import Path

from ..core import Flight, UnreadableFile
from .log import Log, Topics, guarded, printable
from .parquet import is_flight_file, read_flight
from .plain import house_profile
from .profile import Profile, load_profile, shipped
from .sniff import format_of, reader_of
from .translate import matches, translate


def read(path: str | Path, profile: str | Path | Profile | None = None) -> Flight:
    """The flight in a log file, an ALFA folder, a bag or a Flight file, in the house's names, units and
    signs.

    path: the reader is picked by content, then by suffix. profile: name of a shipped profile, path of a TOML
    file, or None: the shipped profile whose [match] fits best; a table whose columns are named like channels
    needs none, nor does a Flight file.

    Raises UnreadableFile (missing, empty, truncated, foreign or corrupt file; no profile fits, with what the
    file has) and WrongUse (unknown or faulty profile).
    """
    path = Path(path)
    kind = format_of(path)
    if kind == "parquet" and profile is None and is_flight_file(path):
        return read_flight(path)
    if profile is not None:
        chosen = load_profile(profile)
        return translate(read_log(path, kind, frozenset(chosen.topics)), chosen, path)
    candidates = [p for p in shipped().values() if kind in p.reader]
    log = read_log(path, kind, _topics(candidates))
    return translate(log, _best(candidates, log, path), path)


def read_log(path: Path, kind: str, topics: Topics = None) -> Log:
    """The log as it was written, before translation; kind as `format_of` says. For writing a profile."""
    reader = reader_of(kind)
    with guarded(path, f"{kind} log"):
        return reader(path, topics)


def _topics(candidates: list[Profile]) -> Topics:
    return frozenset(topic for profile in candidates for topic in profile.topics)


def _best(candidates: list[Profile], log: Log, path: Path) -> Profile:
    scored = [(matches(profile, log), profile) for profile in candidates]
    score, best = max(scored, key=lambda pair: pair[0], default=(0, None))
    if best is not None and score:
        return best
    plain = house_profile(log)
    if plain is None:
        raise no_profile(candidates, log, path)
    return plain


def no_profile(candidates: list[Profile], log: Log, path: Path) -> UnreadableFile:
    have = sorted(printable(name) for name in log.seen)
    shown = ", ".join(have[:20]) + (f" and {len(have) - 20} more" if len(have) > 20 else "")
    tried = ", ".join(profile.name for profile in candidates) or "none for this format"
    return UnreadableFile(
        f"{path.name}: no shipped profile fits this {log.format} file (tried {tried}). It has {shown}. "
        f"Map what you need in [channels] of a profile of your own and pass it with --profile (profile=... in Python)"
    )
