"""Which part of a flight is learnt from and which is judged."""

from __future__ import annotations

from ..core.errors import WrongUse
from .types import Span

TRAIN_SHARE = 0.4


def parse_span(text: str, option: str) -> Span:
    """'T0:T1' in seconds on the log's clock -> (t0, t1)."""
    parts = text.split(":")
    try:
        t0, t1 = (float(p) for p in parts)
    except ValueError:
        raise WrongUse(
            f"{option} {text!r} is not T0:T1; give two times in seconds, like {option} 120:300"
        ) from None
    if not t1 > t0:
        raise WrongUse(f"{option} {text!r} ends before it begins; give T0:T1 with T1 after T0")
    return t0, t1


def split(flown: list[Span], share: float = TRAIN_SHARE) -> tuple[list[Span], list[Span]]:
    """The first `share` of the flown time to learn from, the rest to judge.

    >>> split([(0.0, 50.0), (60.0, 110.0)])
    ([(0.0, 40.0)], [(40.0, 50.0), (60.0, 110.0)])
    """
    need = share * sum(b - a for a, b in flown)
    train: list[Span] = []
    judge: list[Span] = []
    for a, b in flown:
        take = min(b - a, max(need, 0.0))
        need -= take
        if take > 0:
            train.append((a, a + take))
        if b - a - take > 1e-9:
            judge.append((a + take, b))
    return train, judge


def without(spans: list[Span], cut: list[Span]) -> list[Span]:
    """The parts of `spans` outside `cut`.

    >>> without([(0.0, 10.0)], [(2.0, 4.0)])
    [(0.0, 2.0), (4.0, 10.0)]
    """
    out = list(spans)
    for c0, c1 in cut:
        pieces = [((a, min(b, c0)), (max(a, c1), b)) for a, b in out]
        out = [p for pair in pieces for p in pair if p[1] - p[0] > 1e-9]
    return out


def inside(spans: list[Span], window: Span) -> list[Span]:
    """The parts of `spans` within one window."""
    cut = [(max(a, window[0]), min(b, window[1])) for a, b in spans]
    return [s for s in cut if s[1] - s[0] > 1e-9]
