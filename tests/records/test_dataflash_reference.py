"""Our decoder of dataflash logs against pymavlink's DFReader, value by value."""

import contextlib
import io

import numpy as np
import pytest

from aerofdi.records.dataflash import read_dataflash


def compare(path, limit=None):
    """Every message of every type that pymavlink decodes, in order; returns how many values were compared."""
    from pymavlink import DFReader

    log = read_dataflash(path, None)
    with contextlib.redirect_stdout(io.StringIO()):
        reader = DFReader.DFReader_binary(str(path))
    seen: dict[str, int] = {}
    compared = 0
    try:
        while (message := reader.recv_msg()) is not None and (limit is None or compared < limit):
            name = message.get_type()
            k = seen[name] = seen.get(name, -1) + 1
            if name not in log.tables:
                continue
            for field in message.get_fieldnames():
                column = log.tables[name].columns.get(field)
                if column is None:
                    continue
                want = getattr(message, field)
                if isinstance(want, str):
                    assert column.dtype.kind == "U"
                elif isinstance(want, (int, float)):
                    assert column[k] == pytest.approx(want, rel=1e-12, abs=1e-12, nan_ok=True), (
                        name,
                        k,
                        field,
                    )
                    compared += 1
    finally:
        reader.close()
    counts = {name: n + 1 for name, n in seen.items() if name != "FMT"}
    if limit is None:
        assert {n: c for n, c in log.seen.items() if n in counts} == counts
    return compared


def test_tiny_log_agrees(tmp_path, tiny):
    path = tmp_path / "a.BIN"
    path.write_bytes(tiny.dataflash())
    assert compare(path) > 900


@pytest.mark.data
def test_real_logs_agree(flights):
    assert compare(flights / "formats" / "arduplane_test.BIN") > 5000
    assert compare(flights / "arduplane_sitl" / "right_aileron_gain03.BIN", limit=60_000) >= 60_000


@pytest.mark.data
def test_commands_agree_with_what_the_autopilot_says_it_sent(flights):
    """AETR holds aileron, elevator and rudder before the output stage (4500 = full): an independent witness."""
    from aerofdi import records

    path = flights / "arduplane_sitl" / "right_aileron_gain03.BIN"
    flight = records.read(path)
    aetr = read_dataflash(path, frozenset(("AETR",))).tables["AETR"]
    for field, name in (("Ail", "aileron_servo1"), ("Elev", "elevator"), ("Rudd", "rudder")):
        command = flight.measured[f"command.{name}"]
        want = np.interp(command.t_s, aetr.t_s, aetr.columns[field]) / 4500.0
        assert np.std(want) > 0.02
        # One microsecond of 400 is 0.0025; the two messages are written up to one loop apart.
        assert np.median(np.abs(command.value - want)) < 0.003
        assert np.corrcoef(command.value, want)[0, 1] > 0.99
