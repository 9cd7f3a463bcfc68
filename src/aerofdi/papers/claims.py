"""Claims of a paper and how each is judged: `expected.csv` against what a reproduction found."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ..core import UnreadableFile, WrongUse

COLUMNS = ("id", "item", "where", "claim", "paper", "unit", "kind", "tolerance", "reason")
KINDS = ("value", "relative", "at_most", "at_least", "true", "not_reproducible")
REPRODUCED, NOT_REPRODUCED, NOT_REPRODUCIBLE = "reproduced", "not_reproduced", "not_reproducible"


class Expected(NamedTuple):
    """One row of expected.csv.

    id: short and stable. item: what `--item` selects. where: table, figure or section. claim: in our own
    words. paper: the number stated (1 for "true"). kind: "value" |ours - paper| <= tolerance; "relative" the
    same, tolerance as a fraction of |paper|; "at_most" ours <= paper + tolerance; "at_least" ours >= paper -
    tolerance; "true" ours is 1; "not_reproducible" never judged. reason: why it cannot be reproduced, or a
    standing explanation of a difference.
    """

    id: str
    item: str
    where: str
    claim: str
    paper: float
    unit: str
    kind: str
    tolerance: float
    reason: str


class Ours(NamedTuple):
    """What we found: a value, its confidence interval where it is a statistic, and the reason where it
    differs.
    """

    value: float
    ci: tuple[float, float] | None = None
    reason: str = ""


class Findings(NamedTuple):
    """What `run` of a paper returns: id -> Ours, and tables of plain numbers and strings."""

    ours: Mapping[str, Ours]
    tables: Mapping[str, Any]


def _number(text: str, default: float) -> float:
    return float(text) if text.strip() else default


def load_expected(path: Path) -> tuple[Expected, ...]:
    """Read expected.csv; a missing column, a repeated id or an unknown kind is refused with its line."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise UnreadableFile(
            f"{path}: {error.strerror}; every paper's folder needs an expected.csv"
        ) from error
    found: dict[str, Expected] = {}
    for line, row in enumerate(rows, start=2):
        missing = [c for c in COLUMNS if row.get(c) is None]
        if missing or row["kind"] not in KINDS or row["id"] in found:
            raise UnreadableFile(
                f"{path}, line {line}: it needs the columns {', '.join(COLUMNS)}, an id of its own "
                f"and one of the kinds {', '.join(KINDS)}; given {row}"
            )
        numbers = _number(row["paper"], math.nan), _number(row["tolerance"], 0.0)
        found[row["id"]] = Expected(
            row["id"], row["item"], row["where"], row["claim"],
            numbers[0], row["unit"], row["kind"], numbers[1], row["reason"],
        )  # fmt: skip
    return tuple(found.values())


def holds(e: Expected, value: float) -> bool:
    """Whether a value of ours reproduces the claim; NaN never does."""
    slack = e.tolerance * abs(e.paper) if e.kind == "relative" else e.tolerance
    if e.kind == "at_most":
        return value <= e.paper + slack
    if e.kind == "at_least":
        return value >= e.paper - slack
    return abs(value - e.paper) <= slack


def _plain(x: float) -> float | None:
    """JSON has no NaN; infinity is written as text by nobody, so it becomes None too."""
    return float(x) if math.isfinite(x) else None


def judge(expected: Expected, ours: Ours | None) -> dict[str, Any]:
    """One claim in the machine-readable form: paper, ours, ci, tolerance, status, reason."""
    row: dict[str, Any] = {
        "id": expected.id, "where": expected.where, "claim": expected.claim, "paper": _plain(expected.paper),
        "ours": None, "ci": None, "unit": expected.unit, "tolerance": expected.tolerance,
    }  # fmt: skip
    if expected.kind == "not_reproducible":
        return row | {"status": NOT_REPRODUCIBLE, "reason": expected.reason}
    if ours is None:
        raise WrongUse(
            f"claim {expected.id!r} is in expected.csv, but the reproduction found no value for it"
        )
    ok = holds(expected, ours.value)
    ci = None if ours.ci is None else [_plain(x) for x in ours.ci]
    reason = "" if ok else " ".join(r for r in (ours.reason, expected.reason) if r)
    if not ok and not reason:
        reason = f"ours is {ours.value:.4g} {expected.unit}, the paper states {expected.paper:.4g}"
    status = REPRODUCED if ok else NOT_REPRODUCED
    return row | {"ours": _plain(ours.value), "ci": ci, "status": status, "reason": reason}
