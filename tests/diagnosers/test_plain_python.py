"""The kernels of methods A to D give the same without the compiler."""

import os
import subprocess
import sys

import numpy as np

CODE = """
import sys, numpy as np
from aerofdi.core import Sample, run
from aerofdi.papers.vireo_comparison import joint, methods
random = np.random.default_rng(4)
out = {}
made = {"A": methods.method_a, "B": methods.method_b, "C": methods.method_c, "D": joint.method_d}
for name, make in made.items():
    d = make()
    n = 560
    z = np.cumsum(0.01 * random.standard_normal((n, len(d.inputs.names))), axis=0)
    for j, channel in enumerate(d.inputs.names):
        z[:, j] += {"airspeed": 15.4}.get(channel, 0.0)
        z[:, j] *= {"event.reset": 0.0}.get(channel, 1.0)
    z[350:353, 0] = np.nan
    sample = Sample(d.dt_s * np.arange(n), z, np.zeros_like(z), np.zeros(z.shape[1]))
    for field, value in run(d, sample)[1]._asdict().items():
        out[f"{name}.{field}"] = value
np.savez(sys.argv[1], **out)
"""


def verdicts(path, disable):
    env = {**os.environ, "NUMBA_DISABLE_JIT": disable, "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-c", CODE, str(path)], env=env, check=True, timeout=300)
    return dict(np.load(path))


def test_compiled_and_plain_agree(tmp_path):
    compiled, plain = verdicts(tmp_path / "a.npz", "0"), verdicts(tmp_path / "b.npz", "1")
    assert set(compiled) == set(plain) and len(plain) == 40
    for name, value in plain.items():
        if value.dtype.kind == "f":
            np.testing.assert_allclose(compiled[name], value, rtol=1e-9, atol=1e-9, err_msg=name)
        else:
            np.testing.assert_array_equal(compiled[name], value, err_msg=name)
    # Something happened: all four came to judge, and something moved.
    assert all((plain[f"{m}.status"] == 0).any() for m in "ABCD")
    assert all(np.nanmax(np.abs(plain[f"{m}.residual"])) > 0 for m in "ABCD")
