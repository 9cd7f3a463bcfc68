"""Behaviour is committed: the verdicts of every diagnoser on a fixed flight, compared with the stored trace."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

import synthetic as syn

from aerofdi.aircraft.identified import load_identified, save_identified
from aerofdi.core import Flight, bind, run
from aerofdi.diagnosers import effectiveness_setup, parity_setup
from aerofdi.identify import identify

HERE = Path(__file__).parent
EVERY_S = 0.5


def flight() -> Flight:
    return syn.fly(60.0, seed=100, stuck={"aileron": 0.1}, start_s=30.0)


def model():
    return load_identified(HERE / "synthetic.aircraft.toml")


def effectiveness():
    m = model()
    return effectiveness_setup.from_identified(m, dict.fromkeys(m.channels, 0.2)), flight()


def parity():
    m = model()
    return parity_setup.from_identified(m, dict.fromkeys(m.channels, 0.2), (0.5, 0.3)), flight()


def vireo():
    from aerofdi.simulate import fly

    return fly("demo")


def lpv_observer():
    from aerofdi.papers.vireo_comparison import methods

    return methods.method_b(), vireo()


def mmae():
    from aerofdi.papers.vireo_comparison import methods

    return methods.method_c(), vireo()


def smac():
    """The right elevator stuck at 2 deg from 15 to 25 s, SMAC on board."""
    from aerofdi.aircraft import load_aircraft
    from aerofdi.design.smac import level_flight
    from aerofdi.dynamics.faults import Fault
    from aerofdi.dynamics.trim import trim
    from aerofdi.papers.smac import methods
    from aerofdi.simulate import fly_with

    aircraft = load_aircraft(methods.AIRCRAFT)
    fault = Fault("elevator_right", "stuck", 15.0, 25.0, 0.035, "trim")
    d = methods.diagnoser("together")
    return d, fly_with(level_flight(aircraft, trim(aircraft), 32.0, faults=(fault,), seed=4), [d]).flight


TRACES = {
    "effectiveness": effectiveness,
    "parity": parity,
    "lpv_observer": lpv_observer,
    "mmae": mmae,
    "smac": smac,
}


def trace(name):
    d, f = TRACES[name]()
    sample = bind(f, d.inputs, d.dt_s, who=d.name)
    _, v = run(d, sample)
    rows = []
    for t in np.arange(sample.t_s[0] + EVERY_S, sample.t_s[-1], EVERY_S):
        k = int(np.searchsorted(sample.t_s, t))
        active = int(v.active[k].argmax()) if v.active[k].any() else -1
        values = np.concatenate(
            ([t, v.status[k], v.detected[k], active], v.score[k], v.estimate[k], v.residual[k])
        )
        rows.append([f"{x:.6g}" for x in values])
    head = ["t_s", "status", "detected", "active"]
    head += [f"{what}.{h.fault}.{h.mode}" for what in ("score", "estimate") for h in d.hypotheses]
    return [head + [f"residual.{r}" for r in d.residuals], *rows]


@pytest.mark.parametrize("name", sorted(TRACES))
def test_verdicts_are_the_committed_ones(name):
    stored = list(csv.reader((HERE / f"{name}.csv").read_text().splitlines()))
    now = trace(name)
    assert now[0] == stored[0] and len(now) == len(stored)
    a, b = (np.array(x[1:], float) for x in (now, stored))
    np.testing.assert_allclose(a, b, rtol=2e-3, atol=2e-3)
    assert b[:, 2].any(), "something happened on this flight"


if __name__ == "__main__":
    save_identified(
        identify([(syn.fly(120.0, seed=101), 0.0, 120.0)], "synthetic"), HERE / "synthetic.aircraft.toml"
    )
    for each in TRACES:
        with (HERE / f"{each}.csv").open("w", newline="") as file:
            csv.writer(file).writerows(trace(each))
        print("wrote", each)
