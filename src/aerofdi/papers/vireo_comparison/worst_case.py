"""Worst-case gains of the four lateral filters (section 3.2.4, Figure 13): bounds kept as certificates that
are checked, not believed.

`python -m aerofdi.papers.vireo_comparison.worst_case` solves the upper bounds again (about half an hour on
two cores) and writes designs/worst_case.npz. Everybody else loads the storage and multiplier of each bound
and evaluates its inequalities again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...aircraft import load_aircraft
from ...core import Array, CannotJudge
from ...design.certificates import LIMIT
from ...design.io import load_design
from ...design.lpv import basis_for
from ...design.lpv_observer_check import analysis_loop, saved_filter
from ...design.lpv_observer_models import Axis, axes_of, linear_models
from ...design.worst_case_gain import Frozen, UpperBound, at_rate, check_upper_bound, frozen_gain, upper_bound

Progress = Callable[[str, float], None]
FOLDER = Path(__file__).parent / "designs"
KINDS = ("nominal_lti", "robust_lti", "nominal_lpv", "robust_lpv")
NORMS = (0.25, 0.5, 0.75, 1.0)
POLES = (0.031,)
RATE = 8.0
# The bound the text speaks of on the paper's twenty airspeeds; the curve of Figure 13 (left) below it on five.
NODES = {n: np.linspace(12.0, 20.0, 20 if n == 1.0 else 5) for n in NORMS}
SPEEDS = np.linspace(12.0, 20.0, 20)
DENSE = np.linspace(12.0, 20.0, 161)


class Bound(NamedTuple):
    """An upper bound and how far its inequality is from holding: largest scaled eigenvalue on its nodes and
    on 161 airspeeds.
    """

    gain: float
    status: str
    nodes: float
    dense: float


@cache
def axes() -> Mapping[str, Axis]:
    """Both axes of the Vireo with the paper's weights."""
    vireo = load_aircraft("vireo")
    models = linear_models(vireo, np.unique(np.append(np.linspace(12.0, 20.0, 41), 15.4)))
    return axes_of(vireo, models, 15.4)


@cache
def lower_bounds(kind: str, axis: str = "lat") -> tuple[Frozen, ...]:
    """Exact frozen worst-case gain at each of the twenty airspeeds, ||Delta|| <= 1."""
    f = saved_filter(load_design(FOLDER / f"{kind}.toml"), axis)
    g = at_rate(analysis_loop(axes()[axis], f, SPEEDS))
    return tuple(frozen_gain(g, k) for k in range(len(SPEEDS)))


def solve_bound(kind: str, norm: float, time_limit_s: float = 1200.0) -> UpperBound:
    """The upper bound of one lateral filter at one norm of Delta."""
    f = saved_filter(load_design(FOLDER / f"{kind}.toml"), "lat")
    return upper_bound(
        analysis_loop(axes()["lat"], f, NODES[norm]), norm, RATE, POLES, time_limit_s=time_limit_s
    )


def make(path: Path = FOLDER / "worst_case.npz", progress: Progress | None = None) -> None:
    """Solve every bound that is not there or no longer holds for the saved filter, and save what proves it, one by
    one.
    """
    arrays: dict[str, Array] = {}
    if path.exists():
        with path.open("rb") as old, np.load(old, allow_pickle=False) as z:
            arrays = {k: z[k] for k in z.files}
    held = {k for k, b in bounds().items() if b.nodes <= LIMIT and b.status == "solved"}
    jobs = [("stuck_lpv", 1.0), *((k, n) for n in reversed(NORMS) for k in reversed(KINDS))]
    say = progress or (lambda text, share: None)
    for i, (kind, norm) in enumerate(jobs):
        if (kind, norm) in held:
            continue
        key = f"{kind}.{norm}"
        arrays = {k: v for k, v in arrays.items() if not k.startswith(f"{key}.")}
        try:
            u = solve_bound(kind, norm)
        except CannotJudge as error:
            say(f"{kind}, ||Delta|| <= {norm}: {error}", i / len(jobs))
            continue
        say(f"{kind}, ||Delta|| <= {norm}: {u.gain:.4f} ({u.status}, {u.seconds:.0f} s)", (i + 1) / len(jobs))
        arrays |= {
            f"{key}.P": u.P,
            f"{key}.T": u.T,
            f"{key}.multiplier": u.multiplier,
            f"{key}.gain": np.array(u.gain),
        }
        arrays[f"{key}.solved"] = np.array(u.status == "solved")
        with path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)


@cache
def bounds() -> dict[tuple[str, float], Bound]:
    """(kind, norm) -> the stored upper bound with its inequalities evaluated again; missing where the solver
    found none.
    """
    out: dict[tuple[str, float], Bound] = {}
    if not (FOLDER / "worst_case.npz").exists():
        return out
    with np.load(FOLDER / "worst_case.npz", allow_pickle=False) as z:
        for kind in (*KINDS, "stuck_lpv"):
            f = saved_filter(load_design(FOLDER / f"{kind}.toml"), "lat")
            wide = analysis_loop(axes()["lat"], f, DENSE)
            for norm in NORMS:
                g = analysis_loop(axes()["lat"], f, NODES[norm])
                key = f"{kind}.{norm}"
                if f"{key}.gain" not in z.files:
                    continue
                u = UpperBound(
                    float(z[f"{key}.gain"]), "solved" if z[f"{key}.solved"] else "almost solved", 0.0,
                    z[f"{key}.multiplier"], z[f"{key}.P"], z[f"{key}.T"], basis_for(NODES[norm], 2),
                )  # fmt: skip
                worst = [float(check_upper_bound(s, u, norm, RATE, POLES, s.V).max()) for s in (g, wide)]
                out[kind, norm] = Bound(u.gain, u.status, *worst)
    return out


if __name__ == "__main__":
    make(progress=lambda text, share: print(f"{share:5.0%} {text}", flush=True))
