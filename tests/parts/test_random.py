"""Numbers depend on (seed, run, channel, step) alone, have the published bits, are normal and independent."""

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy import special, stats

from aerofdi.parts.ops import jit
from aerofdi.parts.random import inverse_normal, normal4, philox, uniform4, words4

ONES = 0xFFFFFFFF


@pytest.mark.parametrize(
    ("key", "counter", "words"),
    [
        ((0, 0), (0, 0, 0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((ONES, ONES), (ONES,) * 4, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0xA4093822, 0x299F31D0),
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_known_answers_of_the_reference_implementation(key, counter, words):
    """The three philox4x32-10 vectors of Random123's kat_vectors."""
    assert tuple(philox(*key, *counter)) == words


def test_inverse_normal_agrees_with_scipy_into_the_tails():
    p = np.concatenate([10.0 ** -np.linspace(0.31, 11, 400), 1 - 10.0 ** -np.linspace(0.31, 9, 400)])
    ours = np.array([inverse_normal(x) for x in p])
    np.testing.assert_allclose(ours, special.ndtri(p), rtol=5e-14)
    assert inverse_normal(0.5) == 0.0


@jit
def _fill(out, seed, run, channel):
    for k in range(out.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = normal4(seed, run, channel, k)


def sample(n, seed, run, channel):
    out = np.empty((n, 4))
    _fill(out, seed, run, channel)
    return out


def test_normals_are_standard_and_independent_across_words_steps_channels_runs_and_seeds():
    n = 40_000
    columns = [sample(n, 7, 0, 0), sample(n, 7, 0, 1), sample(n, 7, 1, 0), sample(n, 8, 0, 0)]
    lagged = [columns[0][1:, :1], columns[0][2:, 1:2]]
    table = np.column_stack([c[: n - 2] for c in (*columns, *lagged)])
    # Fixed seeds make this deterministic; limits are five standard errors, Kolmogorov's at p = 1e-4.
    assert np.abs(table.mean(0)).max() < 5 / np.sqrt(n)
    assert np.abs(table.var(0) - 1).max() < 5 * np.sqrt(2 / n)
    off = np.corrcoef(table[:, :16].T) - np.eye(16)
    assert np.abs(off).max() < 5 / np.sqrt(n)
    assert np.abs(np.corrcoef(table[:, 0], table[:, 16])[0, 1]) < 5 / np.sqrt(n)
    for j in range(16):
        assert stats.kstest(table[:, j], "norm").pvalue > 1e-4


def test_wide_seeds_and_runs_all_count():
    base = tuple(words4(5, 3, 2, 1))
    for other in [
        (5 + 2**40, 3, 2, 1),
        (5, 3 + 2**40, 2, 1),
        (5, 3, 3, 1),
        (5, 3, 2, 2),
        (2**62 + 5, 3, 2, 1),
    ]:
        assert tuple(words4(*other)) != base
    assert all(0.0 < x < 1.0 for k in range(1000) for x in uniform4(1, 2, 3, k))


def test_plain_python_gives_the_same_bits():
    code = (
        "from aerofdi.parts.random import normal4;"
        "print([x.hex() for k in range(40) for x in normal4(2**61 + 9, 5, 77, k)])"
    )
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    plain = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert plain.stdout.strip() == str([x.hex() for k in range(40) for x in normal4(2**61 + 9, 5, 77, k)])
