"""Design files: what is read is what was written, and nothing else is taken for it."""

import numpy as np
import pytest

from aerofdi.core import Design, UnreadableFile, WrongUse
from aerofdi.design.io import load_design, save_design


@pytest.fixture
def design():
    arrays = {"lat.A": np.arange(8.0).reshape(2, 2, 2), "bound": np.array(8.0), "on": np.array([True, False])}
    certificate = {
        "gamma": np.float64(0.1),
        "nodes": np.array([1.0, 2.0]),
        "nothing": None,
        "ok": np.bool_(True),
    }
    return Design(
        "lpv_observer",
        {"kind": "robust_lpv", "mixing": [[1, -1]], "deep": {"a": (1.0, 2.0)}},
        "abc",
        arrays,
        certificate,
    )


def test_round_trip(tmp_path, design):
    back = load_design(save_design(design, tmp_path / "a" / "x.toml"))
    assert back.method == design.method and back.aircraft_hash == "abc"
    assert back.spec == {"kind": "robust_lpv", "mixing": [[1, -1]], "deep": {"a": [1.0, 2.0]}}
    assert back.certificate == {"gamma": 0.1, "nodes": [1.0, 2.0], "ok": True}
    assert set(back.params) == set(design.params)
    for k, v in design.params.items():
        np.testing.assert_array_equal(back.params[k], v)
        assert back.params[k].dtype == v.dtype and back.params[k].shape == v.shape
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["x.npz", "x.toml"]


def test_same_design_same_bytes(tmp_path, design):
    one, two = (save_design(design, tmp_path / n / "x.toml") for n in ("a", "b"))
    for s in (".toml", ".npz"):
        assert one.with_suffix(s).read_bytes() == two.with_suffix(s).read_bytes()


def test_damaged_foreign_and_mismatched_files_are_refused(tmp_path, design):
    path = save_design(design, tmp_path / "x.toml")
    other = save_design(design._replace(params={"lat.A": np.zeros(3)}), tmp_path / "y.toml")
    good = path.with_suffix(".npz").read_bytes()
    path.with_suffix(".npz").write_bytes(other.with_suffix(".npz").read_bytes())
    with pytest.raises(UnreadableFile, match="arrays are not those"):
        load_design(path)
    path.with_suffix(".npz").write_bytes(good[: len(good) // 2])
    with pytest.raises(UnreadableFile, match="not a design"):
        load_design(path)
    path.with_suffix(".npz").unlink()
    with pytest.raises(UnreadableFile, match="npz"):
        load_design(path)
    other.write_text("format = 99\n")
    with pytest.raises(UnreadableFile, match="not a design of format 1"):
        load_design(other)


def test_pickles_are_neither_written_nor_read(tmp_path, design):
    with pytest.raises(WrongUse, match="not arrays of numbers"):
        save_design(design._replace(params={"f": np.array([print], dtype=object)}), tmp_path / "x.toml")
    with pytest.raises(WrongUse, match=r"spec.kind"):
        save_design(design._replace(spec={"kind": print}), tmp_path / "x.toml")
    path = save_design(design, tmp_path / "x.toml")
    np.savez(path.with_suffix(".npz"), allow_pickle=True, evil=np.array([{"a": 1}], dtype=object))
    with pytest.raises(UnreadableFile):
        load_design(path)
