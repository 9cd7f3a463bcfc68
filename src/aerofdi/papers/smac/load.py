"""Computing load: states, arithmetic operations and measured time a step of SMAC and of the banks (section
5.1).
"""

from __future__ import annotations

import ast
import inspect
import statistics
import textwrap
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ...core import Diagnoser, bind, copy_state, empty_verdict
from ...diagnosers import smac_ekf
from ...diagnosers.mmae import state_count
from ..claims import Findings, Ours
from . import banks
from .flights import flown
from .methods import diagnoser


def operations(function: Callable[..., Any]) -> int:
    """Additions, multiplications, divisions a straight-line function writes down (indices and loops not
    followed).
    """
    source = textwrap.dedent(inspect.getsource(getattr(function, "py_func", function)))
    counted = (ast.Add, ast.Sub, ast.Mult, ast.Div)
    nodes = list(ast.walk(ast.parse(source)))
    indices = {id(n) for s in nodes if isinstance(s, ast.Subscript) for n in ast.walk(s.slice)}
    found = [n for n in nodes if isinstance(n, ast.BinOp | ast.AugAssign) and isinstance(n.op, counted)]
    return sum(id(n) not in indices for n in found)


def filter_operations(surfaces: int) -> int:
    """Of one cycle of the three-state filter with this many surfaces: update, F, prediction, covariances,
    inputs.
    """
    e = smac_ekf
    straight: tuple[Any, ...] = (
        e._measurement_update,
        e.transition,
        e.rate_derivative,
        e.process_noise,
        e.ekf_step,
    )
    return sum(operations(f) for f in straight) + 3 * operations(e._times) + 3 * (8 + 3 * surfaces)


def bank_operations(design: Any) -> int:
    """Of one step of a bank: predictions, residuals, quadratic forms and corrections of every filter."""
    models, n, nu = design.params["B"].shape
    ns = design.params["H"].shape[1]
    return int(models * (2 * n * (n + nu) + 2 * ns * n + ns + 3 * ns * ns + 2 * n * ns + 6))


def step_us(diagnosers: dict[str, tuple[Diagnoser, Any, Any]], repeats: int) -> dict[str, float]:
    """Median time of a compiled step over a whole flight, microseconds, runs interleaved."""
    times: dict[str, list[float]] = {name: [] for name in diagnosers}
    for _ in range(repeats + 1):
        for name, (d, z, age) in diagnosers.items():
            state, out = copy_state(d.init(d.params)), empty_verdict(d, len(z))
            began = time.perf_counter()
            d.run_into(d.params, state, z, age, out)
            times[name].append((time.perf_counter() - began) / len(z) * 1e6)
    return {name: statistics.median(found[1:]) for name, found in times.items()}


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Counts and times, all on one flight."""
    progress("timing", 0.0)
    flight = flown("ordered").flight
    made = {"smac": diagnoser("ordered"), **{k: banks.diagnoser(k) for k in ("lateral", "extended")}}
    inputs = {}
    for name, d in made.items():
        sample = bind(flight if name == "smac" else banks.with_sums(flight), d.inputs, d.dt_s, who=d.name)
        inputs[name] = (d, np.ascontiguousarray(sample.z), np.ascontiguousarray(sample.age))
    times = step_us(inputs, 5 if quick else 15)
    surfaces = len(made["smac"].outputs.names)
    table: dict[str, dict[str, float]] = {
        "smac": {
            "filters": 1,
            "filter_states": 3,
            "operations": filter_operations(surfaces),
            "step_us": times["smac"],
        }
    }
    for kind in ("lateral", "extended"):
        design = banks.bank(kind)
        table[kind] = {
            "filters": len(design.params["prior"]), "filter_states": state_count(design)["filters"],
            "operations": bank_operations(design), "step_us": times[kind],
        }  # fmt: skip
    ratio = table["extended"]["operations"] / table["smac"]["operations"]
    ours = {"filter_states": Ours(3.0), "operations_ratio": Ours(float(ratio))}
    return Findings(ours, {"load": table})
