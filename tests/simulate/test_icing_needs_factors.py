"""Icing is flown only where the aircraft file says what ice does."""

from dataclasses import replace

import pytest

from aerofdi.core import WrongUse
from aerofdi.dynamics.faults import Fault
from aerofdi.scenarios import load_scenario
from aerofdi.simulate.prepare import prepare


def test_icing_of_an_aircraft_without_factors_is_refused() -> None:
    ice = Fault("airframe", "icing", 5.0, value=0.1)
    with pytest.raises(WrongUse, match=r"'vireo' has no \[aero\.icing\] factors"):
        prepare(replace(load_scenario("demo"), faults=(ice,)))
    iced = prepare(replace(load_scenario("aerosonde_elevator"), faults=(ice,)))
    assert iced.params.faults.rows.shape[0] == 1
