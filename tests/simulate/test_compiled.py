"""The loop is compiled once and loaded by the next process; uncompiled it flies the same flight."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from aerofdi.parts.ops import COMPILED

FLY = """
import json, sys
from dataclasses import replace
from aerofdi.scenarios import load_scenario
from aerofdi.simulate import fly
from aerofdi.simulate.loop import advance
s = replace(load_scenario(sys.argv[1]), duration_s=float(sys.argv[2]))
f = fly(s, seed=4)
names = ("p", "theta", "airspeed", "altitude", "wind_down", "throttle")
stats = getattr(advance, "stats", None)
print(json.dumps({
    "truth": {n: [x.hex() for x in f.truth[n].value.tolist()] for n in names},
    "hits": sum(stats.cache_hits.values()) if stats else -1,
    "misses": sum(stats.cache_misses.values()) if stats else -1,
}))
"""


def process(scenario, duration, **env):
    out = subprocess.run(
        [sys.executable, "-c", FLY, scenario, str(duration)],
        env={**os.environ, **env}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return json.loads(out.stdout)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_the_second_process_compiles_nothing():
    process("vireo_track", 0.5)
    again = process("vireo_track", 0.5)
    assert (again["hits"], again["misses"]) == (1, 0)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("scenario", ["demo", "aerosonde_elevator", "ultrastick120_rudder"])
def test_plain_python_flies_the_same_flight(scenario):
    """Equal to rounding: the compiler may contract or reorder nothing, so in practice to the bit or nearly
    so.
    """
    compiled, plain = process(scenario, 2.0), process(scenario, 2.0, NUMBA_DISABLE_JIT="1")
    assert plain["hits"] == -1
    for name, values in compiled["truth"].items():
        a, b = (np.array([float.fromhex(x) for x in v]) for v in (values, plain["truth"][name]))
        assert np.ptp(a) > 0
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-10, err_msg=name)
