"""Requirements of sections 2.2 and 2.3: the stuck angles one can trim with, and how soon a fault must be found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

from ...aircraft import load_aircraft
from ...dynamics.faults import Fault
from ...dynamics.stuck_range import trimmable_range
from ...evaluate.requirements import (
    Allowable,
    Envelope,
    allowable,
    fly_exits,
    load_envelopes,
    scaled,
    widened,
)
from ...scenarios import Guidance, Turbulence, load_scenario
from ...simulate import fly
from ..claims import Findings, Ours
from .flights import HERE, METHODS, points

DEG = math.pi / 180.0
SIZES_DEG = (-7, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5)
QUICK_DEG = (-7, -5, -3, -1, 0, 1, 3, 5)
# Onsets spread over one round of the track, whose corners come every 6 and 11 s.
ONSETS_S = (60.0, 62.5, 65.0, 67.5, 70.0, 72.5, 75.0, 77.5)


@cache
def envelopes() -> tuple[Envelope, ...]:
    """The shipped ones at the aircraft's scale, widened to what it does healthy on this track, to 5 m/s of wind."""
    track = load_scenario(HERE / "track.toml")
    wind = track.wind._replace(speed=5.0, turbulence=Turbulence("dryden", 5.0))
    healthy = [fly(replace(track, duration_s=120.0, wind=w)) for w in (track.wind, wind)]
    return widened(scaled(load_envelopes(), load_aircraft("vireo").number("reference.span")), healthy)


@cache
def allowed(quick: bool, progress: Callable[[str, float], None] | None = None) -> Allowable:
    """Allowable detection time (s) over the stuck angle about trim (rad), either elevon, calm air."""
    track = load_scenario(HERE / "track.toml")
    fault = Fault("elevon_right", "stuck", 0.0, about="trim")
    sizes = [x * DEG for x in (QUICK_DEG if quick else SIZES_DEG)]
    onsets = ONSETS_S[::4] if quick else ONSETS_S
    return allowable(fly_exits(track, fault, sizes, onsets, envelopes(), progress=progress))


def straight(sizes_deg: tuple[float, ...] = (-1.0, 1.0)) -> dict[float, float]:
    """Exit times (s) from straight and level flight in calm air, by angle about trim (deg)."""
    track = load_scenario(HERE / "track.toml")
    level = replace(track, guidance=Guidance("heading", track.guidance.points))
    fault = Fault("elevon_right", "stuck", 0.0, about="trim")
    found = fly_exits(level, fault, [x * DEG for x in sizes_deg], [20.0], envelopes(), after_s=60.0)
    return {x: t for x, (t,) in zip(sizes_deg, found.values(), strict=True)}


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Trimmable range by the nonlinear trim; allowable times by flight; every detection of Table 4 against them."""
    reach = trimmable_range(load_aircraft("vireo"), "elevon_right", 15.4)
    limit = allowed(quick, progress)
    level = straight()
    ours = {
        "stuck_low": Ours((reach.low - reach.nominal) / DEG, reason=_REACH),
        "stuck_high": Ours((reach.high - reach.nominal) / DEG, reason=_REACH),
        "allowable_time": Ours(_near_trim(limit), reason=_time_reason(limit, level)),
    }
    rows = []
    for p in points("trim"):
        seconds = limit.at(p.angle_deg * DEG)
        row = {"point": f"{p.flight} {p.name}", "allowed_s": _plain(seconds)}
        rows.append(row | {f"{m}_in_time": bool(p.ours[m].delay_s <= seconds) for m in METHODS})
    table = [
        {"about_trim_deg": round(float(s) / DEG, 3), "allowed_s": _plain(t)}
        for s, t in zip(limit.sizes, limit.seconds, strict=True)
    ]
    flat = [{"about_trim_deg": x, "exit_s": _plain(t)} for x, t in level.items()]
    used = [
        {
            "envelope": e.name, "phi_deg": [_plain(x / DEG) for x in e.phi],
            "theta_deg": [_plain(x / DEG) for x in e.theta], "horizon_s": e.horizon_s, "assumed": e.assumed,
        }
        for e in envelopes()
    ]  # fmt: skip
    return Findings(ours, {"allowable": table, "straight": flat, "in_time": rows, "envelopes": used})


def _plain(x: float) -> float | None:
    return round(float(x), 2) if math.isfinite(x) else None


_REACH = (
    "The aircraft with constant derivatives and an assumed thrust trims over another range than the trim analysis of "
    "the paper's own nonlinear model, whose thrust, stall and limits are not in the paper."
)


def _near_trim(limit: Allowable) -> float:
    """Allowable time of faults within 1 deg of trim, the worst onset on the track."""
    return min(t for size, t in zip(limit.sizes, limit.seconds, strict=True) if abs(size) < 1.01 * DEG)


def _time_reason(limit: Allowable, level: dict[float, float]) -> str:
    said = ", ".join(
        f"{x:+.0f} deg {f'{t:.1f} s' if math.isfinite(t) else 'never'}" for x, t in level.items()
    )
    return (
        f"Ours is the worst onset on the track (in a corner, where trim is a jump of its own); up of trim, the side "
        f"the paper injects, it is {limit.at(-1.0 * DEG):.1f} s, and from straight flight {said}. The altitude and "
        f"airspeed loops, which decide how the attitude departs, and the numbers of the envelopes are not in the paper."
    )
