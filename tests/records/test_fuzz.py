"""Damaged files: whatever bits are cut or flipped, a reader gives a Flight or an error of ours, in bounded time."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aerofdi import records
from aerofdi.core import AerofdiError, Flight

FORMATS = (
    "a.ulg",
    "old.ulg",
    "a.BIN",
    "a.log",
    "a.tlog",
    "a.bag",
    "a.mcap",
    "a.data",
    "a.mat",
    "a.csv",
    "a.csv.gz",
    "a.parquet",
    "flight.parquet",
)


class Samples(dict):
    """Bytes by file name; its repr stays short in reports."""

    def __repr__(self):
        return "samples"


@pytest.fixture(scope="session")
def samples(tiny, tmp_path_factory):
    """One small intact log of every format, as bytes."""
    import pyarrow as pa
    from pyarrow import parquet

    folder = tmp_path_factory.mktemp("samples")
    (folder / "a.data").write_bytes(tiny.paparazzi())
    flight = records.read(folder / "a.data")
    parquet.write_table(pa.table({"t_s": np.arange(20.0), "p": np.arange(20.0)}), folder / "a.parquet")
    return Samples(
        {
            "a.ulg": tiny.ulog("servos", n=10),
            "old.ulg": tiny.ulog("controls", n=10),
            "a.BIN": tiny.dataflash(n=8),
            "a.log": tiny.dataflash_text(n=8),
            "a.tlog": tiny.tlog(n=10, servo=True),
            "a.bag": tiny.bag(folder / "a.bag", 1, n=5).read_bytes(),
            "a.mcap": next(tiny.bag(folder / "mcap", 3, n=5).glob("*.mcap")).read_bytes(),
            "a.data": tiny.paparazzi(n=10),
            "a.mat": tiny.mat(folder / "a.mat", n=10).read_bytes(),
            "a.csv": tiny.csv(n=10),
            "a.csv.gz": tiny.csv_gz(),
            "a.parquet": (folder / "a.parquet").read_bytes(),
            "flight.parquet": records.write_flight(flight, folder / "f.parquet").read_bytes(),
        }
    )


@st.composite
def damage(draw):
    """A function that damages bytes: cut, flip bits, overwrite a field with extreme values, drop a piece."""
    cut = draw(st.one_of(st.none(), st.floats(0.0, 1.0)))
    flips = draw(st.lists(st.tuples(st.floats(0.0, 0.9999), st.integers(0, 7)), max_size=8))
    fields = draw(
        st.lists(
            st.tuples(st.floats(0.0, 0.99), st.sampled_from([b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0" * 8])),
            max_size=2,
        )
    )
    dropped = draw(st.one_of(st.none(), st.tuples(st.floats(0.0, 0.99), st.integers(1, 64))))

    def apply(data: bytes) -> bytes:
        out = bytearray(data)
        for at, bit in flips:
            out[int(at * len(out))] ^= 1 << bit
        for at, value in fields:
            k = int(at * len(out))
            out[k : k + len(value)] = value
        if dropped:
            k = int(dropped[0] * len(out))
            del out[k : k + dropped[1]]
        return bytes(out if cut is None else out[: int(cut * len(out))])

    return apply


def check(path) -> bool:
    """True where it could be read; the Flight then keeps its promises."""
    try:
        flight = records.read(path)
    except AerofdiError as error:
        assert path.name in str(error) or "a" in str(error)
        assert "\n" not in str(error)
        return False
    assert isinstance(flight, Flight)
    for table in (flight.measured, flight.output, flight.truth):
        for series in table.values():
            assert series.t_s.shape == series.value.shape
            assert np.isfinite(series.t_s).all()
            assert (np.diff(series.t_s) >= 0).all()
    records.describe(flight)
    return True


@pytest.mark.parametrize("name", FORMATS)
def test_intact_samples_are_readable(samples, tmp_path, name):
    (tmp_path / name).write_bytes(samples[name])
    assert check(tmp_path / name)


@pytest.mark.parametrize("name", FORMATS)
@settings(
    max_examples=40,
    deadline=5000,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(damaged=damage())
def test_damaged_files_never_surprise(samples, tmp_path, name, damaged):
    (tmp_path / name).write_bytes(damaged(samples[name]))
    check(tmp_path / name)


@settings(
    max_examples=30,
    deadline=5000,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(damaged=damage(), which=st.integers(0, 6))
def test_damaged_alfa_folders_never_surprise(tiny, tmp_path_factory, damaged, which):
    folder = tiny.alfa(tmp_path_factory.mktemp("alfa") / "carbonZ_1", n=10, stuck_from=5)
    file = sorted(folder.glob("*.csv"))[which]
    file.write_bytes(damaged(file.read_bytes()))
    check(folder)


@pytest.mark.parametrize(
    "suffix", [".ulg", ".BIN", ".log", ".tlog", ".bag", ".mcap", ".db3", ".data", ".mat", ".csv", ".parquet"]
)
@settings(
    max_examples=15,
    deadline=5000,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(data=st.binary(max_size=400), head=st.booleans())
def test_foreign_bytes_never_surprise(tmp_path, suffix, data, head):
    magic = {".ulg": b"ULog\x01\x12\x35", ".BIN": b"\xa3\x95", ".bag": b"#ROSBAG V2.0\n", ".parquet": b"PAR1"}
    path = tmp_path / f"a{suffix}"
    path.write_bytes((magic.get(suffix, b"") if head else b"") + data)
    check(path)
