"""What every reader returns: the log as it was written, topic by topic, before anything is translated."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import AerofdiError, Array, Event, UnreadableFile

Topics = frozenset[str] | None
"""The topics a profile needs; None asks for all of them."""


class Table(NamedTuple):
    """One topic: t_s (n,) on the log's clock in s, and its fields, each (n,), numbers or text."""

    t_s: Array
    columns: dict[str, NDArray[Any]]


@dataclass
class Log:
    """A log as it was written.

    tables: topic -> Table. seen: topic -> count, also of topics that were not decoded. clock says in words
    what t_s counts from; info holds what the format says of itself (firmware, vehicle type).
    """

    format: str
    tables: dict[str, Table]
    clock: str
    parameters: dict[str, float] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    info: dict[str, Any] = field(default_factory=dict)
    seen: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def has(self, reference: str) -> bool:
        """Whether 'topic.field' is there with at least one sample."""
        topic, _, name = reference.partition(".")
        table = self.tables.get(topic)
        return table is not None and name in table.columns and len(table.t_s) > 0


Reader = Callable[[Path, Topics], Log]


def printable(text: str, longest: int = 60) -> str:
    """Text from a file as it may stand in a message: one line, no control characters, not too long."""
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return clean if len(clean) <= longest else f"{clean[: longest - 3]}..."


def unreadable(path: Path, why: str) -> UnreadableFile:
    """The error every reader raises: which file, what is wrong with it."""
    return UnreadableFile(f"{path.name}: {why}")


def read_bytes(path: Path) -> bytes:
    """The whole file; an error where it cannot be opened or is empty."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, f"cannot be opened ({error.strerror or error})") from error
    if not data:
        raise unreadable(path, "the file is empty")
    return data


@contextlib.contextmanager
def guarded(path: Path, what: str) -> Iterator[None]:
    """Run a foreign parser: whatever it raises becomes UnreadableFile, whatever it prints is dropped.

    Foreign parsers raise nearly every exception type on corrupt data, so nearly every one is caught here, and
    only here; running out of memory on a corrupt length field is one of them.
    """
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
        warnings.catch_warnings(),
        np.errstate(all="ignore"),
    ):
        warnings.simplefilter("ignore")
        try:
            yield
        except AerofdiError:
            raise
        except (Exception, MemoryError) as error:
            text = str(error).strip().splitlines()
            reason = printable(text[0], 120) if text else type(error).__name__
            raise unreadable(path, f"not a readable {what}: {reason}") from error


def ordered(t_s: Array, columns: dict[str, NDArray[Any]]) -> Table:
    """The table with finite stamps that never decrease (a stable sort; equal stamps keep their order)."""
    keep = np.isfinite(t_s)
    if not keep.all():
        t_s, columns = t_s[keep], {k: v[keep] for k, v in columns.items()}
    if len(t_s) > 1 and (np.diff(t_s) < 0).any():
        order = np.argsort(t_s, kind="stable")
        t_s, columns = t_s[order], {k: v[order] for k, v in columns.items()}
    return Table(t_s, columns)


def wants(topics: Topics, name: str) -> bool:
    return topics is None or name in topics
