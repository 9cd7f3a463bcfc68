"""Thinning hides nothing: every extreme of every part survives, gaps stay gaps, packing keeps 16 bits."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.report.traces import LEVELS, Packer, Trace, line, thin


def unpack(packed: dict, clocks: list[str], t0: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the script of the page makes of a packed curve."""
    t = t0 + np.frombuffer(base64.b64decode(clocks[packed["clock"]]), "<f4").astype(float)

    def values(text: str) -> np.ndarray:
        steps = np.frombuffer(base64.b64decode(text), "<i2").astype(float)
        return np.where(steps == -LEVELS - 1, np.nan, packed["zero"] + packed["unit"] * steps)

    low = values(packed["low"])
    return t, low, values(packed["high"]) if "high" in packed else low


@given(st.integers(0, 2**32 - 1), st.integers(10, 4000), st.integers(5, 300))
@settings(max_examples=40, deadline=None)
def test_every_extreme_survives(seed: int, n: int, points: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.008, 0.012, n))
    value = rng.standard_normal(n)
    value[rng.integers(n)] = 50.0
    span = (0.0, float(t[-1]))
    at, low, high = thin(line("x", t, value, "1"), span, points)
    good = np.isfinite(low)
    assert np.nanmax(high) == 50.0 and np.nanmin(low) == value.min()
    assert len(at) <= max(2 * points, points + 2) and (np.diff(at) > 0).all()
    # Any stretch of time keeps its largest value to within one part of the span.
    part = span[1] / points
    for _ in range(5):
        a = rng.uniform(0, span[1])
        inside = (t >= a) & (t <= a + 3 * part)
        near = good & (at >= a - part) & (at <= a + 4 * part)
        if inside.any():
            assert high[near].max() >= value[inside].max() and low[near].min() <= value[inside].min()


def test_windows_keep_every_sample() -> None:
    t = 0.01 * np.arange(10_000)
    value = np.random.default_rng(0).standard_normal(len(t))
    at, low, high = thin(line("x", t, value, "1"), (0.0, 100.0), 50, [(40.0, 45.0)])
    inside = (t >= 40.0) & (t <= 45.0)
    kept = (at >= 40.0) & (at <= 45.0)
    assert np.array_equal(at[kept], t[inside]) and np.array_equal(low[kept], value[inside])
    assert np.array_equal(low[kept], high[kept]) and kept.sum() > 10 * (~kept).sum()


@pytest.mark.parametrize("points", [20, 5000])
def test_gaps_stay_gaps(points: int) -> None:
    t = 0.02 * np.arange(1000)
    value = np.ones(1000)
    value[300:330] = np.nan
    t[600:] += 5.0
    at, low, _ = thin(line("x", t, value, "1"), (0.0, t[-1]), points)
    holes = at[np.isnan(low)]
    assert len(holes) == 2 and 5.98 <= holes[0] <= 6.6 and 11.98 <= holes[1] <= 17.0


def test_nothing_to_draw_is_no_error() -> None:
    empty = line("x", np.zeros(0), np.zeros(0), "1")
    hollow = line("x", np.arange(5.0), np.full(5, np.nan), "1")
    for trace in (empty, hollow, line("x", np.ones(1), np.ones(1), "1")):
        packer = Packer((0.0, 10.0), 100)
        t, low, _ = unpack(packer.pack(trace), packer.clocks, 0.0)
        assert len(t) == len(low) <= 1


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=50))
@settings(max_examples=40, deadline=None)
def test_packing_keeps_sixteen_bits(values: list[float]) -> None:
    value = np.array(values)
    t = 2700.0 + 0.02 * np.arange(len(value))
    packer = Packer((2700.0, 2800.0), 1000)
    band = packer.pack(Trace("x", t, value - 1.0, value + 2.0, "band"))
    same = packer.pack(line("y", t, value, "1"))
    assert band["clock"] == same["clock"] == 0 and "high" not in same
    at, low, high = unpack(band, packer.clocks, 2700.0)
    step = (np.ptp(value) + 3.0) / (2 * LEVELS)
    assert np.allclose(at, t, atol=1e-5)
    assert np.abs(low - (value - 1.0)).max() <= 0.51 * step + 1e-9
    assert np.abs(high - (value + 2.0)).max() <= 0.51 * step + 1e-9
