"""Flight files: exact both ways, written beside and renamed, and honest about damage."""

import json
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from aerofdi import records
from aerofdi.core import AerofdiError, Event, Flight, Series, UnreadableFile, WrongUse

FLOATS = st.floats(allow_nan=True, allow_infinity=True, width=64)
NAMES = st.sampled_from(["p", "q", "command.elevator", "reference.phi", "mode", "truth/odd name", "é [x]"])
PLAIN = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(2**40), 2**40),
        st.floats(allow_nan=False),
        st.text(max_size=8),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


@st.composite
def series(draw, clocks):
    t = draw(st.sampled_from(clocks))
    value = draw(hnp.arrays(np.float64, len(t), elements=FLOATS))
    codes = draw(st.one_of(st.none(), st.dictionaries(st.integers(-5, 300), st.text(max_size=6), max_size=3)))
    return Series(t, value, draw(st.sampled_from(["rad/s", "1", "m/s2", ""])), codes, draw(st.booleans()))


@st.composite
def flights_of_any_kind(draw):
    clock = st.lists(st.floats(-1e9, 1e9), max_size=12).map(lambda x: np.array(sorted(x), dtype=float))
    clocks = draw(st.lists(clock, min_size=1, max_size=3))
    tables = [draw(st.dictionaries(NAMES, series(clocks), max_size=4)) for _ in range(3)]
    events = draw(
        st.lists(
            st.builds(Event, st.floats(-1e6, 1e6), st.text(max_size=5), st.text(max_size=20)), max_size=3
        )
    )
    parameters = draw(st.dictionaries(st.text(max_size=6), st.floats(allow_nan=False), max_size=3))
    return Flight(*tables, events, parameters, draw(st.dictionaries(st.text(max_size=5), PLAIN, max_size=3)))


def same_bits(a, b):
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


def assert_same(a: Flight, b: Flight) -> None:
    for table in ("measured", "output", "truth"):
        left, right = getattr(a, table), getattr(b, table)
        assert list(left) == list(right)
        for name in left:
            x, y = left[name], right[name]
            assert same_bits(x.t_s, y.t_s) and same_bits(x.value, y.value)
            assert (x.unit, x.codes, x.repeats) == (y.unit, y.codes, y.repeats)
    assert (a.events, a.parameters, a.meta) == (b.events, b.parameters, b.meta)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flight=flights_of_any_kind())
def test_round_trip_is_exact(tmp_path, flight):
    records.write_flight(flight, tmp_path / "f.parquet")
    assert_same(flight, records.read(tmp_path / "f.parquet"))


def test_a_read_log_survives_the_round_trip(tmp_path, tiny):
    (tmp_path / "a.BIN").write_bytes(tiny.dataflash())
    flight = records.read(tmp_path / "a.BIN")
    assert len(flight.measured) > 10 and flight.events and flight.parameters
    assert_same(flight, records.read(records.write_flight(flight, tmp_path / "f.parquet")))


def test_channels_on_the_same_stamps_share_one_clock(tmp_path):
    from pyarrow import parquet

    t = np.arange(5.0)
    flight = Flight(
        {"p": Series(t, t, "rad/s"), "q": Series(t.copy(), t, "rad/s"), "r": Series(t[:2], t[:2], "rad/s")}
    )
    schema = parquet.read_schema(records.write_flight(flight, tmp_path / "f.parquet"))
    assert [name for name in schema.names if name.startswith("clock/")] == ["clock/0", "clock/1"]
    assert schema.field("measured/p").metadata[b"unit"] == b"rad/s"


def test_nan_is_a_value_and_gaps_stay_gaps(tmp_path):
    t = np.array([0.0, 1.0, 50.0])
    flight = Flight({"p": Series(t, np.array([math.nan, -0.0, math.inf]), "rad/s")})
    back = records.read(records.write_flight(flight, tmp_path / "f.parquet")).measured["p"]
    assert math.isnan(back.value[0]) and math.copysign(1.0, back.value[1]) < 0 and back.value[2] == math.inf
    np.testing.assert_array_equal(back.t_s, t)


def test_a_broken_write_leaves_the_old_file_and_no_rubbish(tmp_path, monkeypatch):
    from pyarrow import parquet

    t = np.arange(3.0)
    path = records.write_flight(Flight({"p": Series(t, t, "rad/s")}), tmp_path / "f.parquet")
    before = path.read_bytes()

    def fail(table, where, **options):
        where.write(b"half a file")
        raise KeyboardInterrupt

    monkeypatch.setattr(parquet, "write_table", fail)
    with pytest.raises(KeyboardInterrupt):
        records.write_flight(Flight({"q": Series(t, t, "rad/s")}), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["f.parquet"]


def test_what_a_file_cannot_hold_is_refused_by_name(tmp_path):
    with pytest.raises(WrongUse, match=r"meta\.model is a complex"):
        records.write_flight(Flight({}, meta={"model": 1j}), tmp_path / "f.parquet")
    t = np.array([1.0, 0.0])
    with pytest.raises(WrongUse, match="'p' has stamps that decrease"):
        records.write_flight(Flight({"p": Series(t, t, "rad/s")}), tmp_path / "f.parquet")
    with pytest.raises(WrongUse, match="cannot write"):
        records.write_flight(Flight({}), tmp_path / "nowhere" / "f.parquet")
    assert not list(tmp_path.iterdir())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.floats(0.0, 0.9999), bit=st.integers(0, 7))
def test_a_flipped_bit_is_never_read_as_another_flight(tmp_path, at, bit):
    """Page checksums and the checksum of the description: the same flight, or an error."""
    t = np.linspace(0.0, 10.0, 200)
    flight = Flight(
        {"p": Series(t, np.sin(t), "rad/s"), "q": Series(t, np.cos(t), "rad/s")}, meta={"aircraft": "x"}
    )
    path = records.write_flight(flight, tmp_path / "f.parquet")
    data = bytearray(path.read_bytes())
    data[int(at * len(data))] ^= 1 << bit
    path.write_bytes(data)
    try:
        back = records.read_flight(path)
    except AerofdiError:
        return
    assert_same(flight, back)


def test_a_later_version_is_refused(tmp_path):
    import zlib

    import pyarrow as pa
    from pyarrow import parquet

    text = json.dumps({"version": 99}).encode()
    crc = str(zlib.crc32(text)).encode()
    table = pa.table({"x": [1.0]}).replace_schema_metadata({b"aerofdi": text, b"aerofdi.crc32": crc})
    parquet.write_table(table, tmp_path / "f.parquet")
    with pytest.raises(UnreadableFile, match="version 99"):
        records.read(tmp_path / "f.parquet")
