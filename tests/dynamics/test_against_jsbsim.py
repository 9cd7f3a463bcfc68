"""An independent judge: the Ultra Stick in JSBSim, from its public description, mode by mode.

JSBSim flies other aerodynamics than the aircraft file: its tables look like a vortex lattice's, the file's come from a
wind tunnel. So two questions are kept apart. Do our equations of motion, given JSBSim's coefficients, have JSBSim's
modes? And do the modes of the two sets of aerodynamics differ as the coefficients that rule them do?
"""

import math
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from aerofdi.aircraft import load_aircraft
from aerofdi.dynamics.aero import ControlDerivatives, DerivativeAero, Derivatives
from aerofdi.dynamics.atmosphere import Air
from aerofdi.dynamics.build import plant_params
from aerofdi.dynamics.linearise import (
    LATERAL,
    LONGITUDINAL,
    Mode,
    lateral_modes,
    linearise,
    longitudinal_modes,
    modes,
)
from aerofdi.dynamics.plant import Body, MassProperties, PlantParams, Wing, thrust
from aerofdi.dynamics.propulsion import ThrustLaw
from aerofdi.dynamics.rigid_body import Inertia
from aerofdi.dynamics.trim import trim
from aerofdi.dynamics.types import HEALTHY_EFFECTS, STILL_AIR

FT, LBF = 0.3048, 4.4482216152605
DEG = math.pi / 180.0
V, H, G = 23.0, 100.0, 9.80665
COEFFICIENTS = {"CD": "CD", "CY": "CY", "CL": "CL", "Cl": "CMl", "Cm": "CMm", "Cn": "CMn"}
AREA, CHORD, SPAN = 0.785946, 0.382588, 1.92405

PLAIN = """<?xml version="1.0"?>
<fdm_config name="us" version="2.0" release="ALPHA">
 <metrics file="Metrics.xml"/> <mass_balance file="Mass.xml"/> <ground_reactions file="Gear.xml"/>
 <external_reactions><force name="thrust" frame="BODY"><location unit="M"><x>0</x><y>0</y><z>0</z></location>
  <direction><x>1</x><y>0</y><z>0</z></direction></force></external_reactions>
 <system name="surfaces">{surfaces}</system>
 <aerodynamics file="Aero.xml"/>
</fdm_config>"""
SURFACES = [f"fcs/pos{s}_rad" for s in ("Elev", "AilL", "AilR", "FlapL", "FlapR", "Rud")]


class JSBSim:
    """The public model without its actuators and motor: surfaces and thrust are set directly."""

    def __init__(self, root: Path, source: Path) -> None:
        import jsbsim

        home = root / "aircraft" / "us"
        for folder in (home, root / "engine", root / "systems"):
            folder.mkdir(parents=True)
        for name in ("Aero.xml", "Metrics.xml", "Mass.xml", "Gear.xml"):
            shutil.copy(source / name, home)
        surfaces = "".join(f'<property value="0">{s}</property>' for s in SURFACES)
        (home / "us.xml").write_text(PLAIN.format(surfaces=surfaces))
        self.fdm = jsbsim.FGFDMExec(str(root))
        self.fdm.set_debug_level(0)
        for part in ("aircraft", "engine", "systems"):
            getattr(self.fdm, f"set_{part}_path")(part)
        assert self.fdm.load_model("us")

    def set(self, x: np.ndarray, elevator: float, thrust: float) -> None:
        """x: u, v, w, p, q, r, phi, theta in SI."""
        u, v, w, p, q, r, phi, theta = (float(a) for a in x)
        f = self.fdm
        f["ic/h-sl-ft"] = H / FT
        f["ic/phi-rad"], f["ic/theta-rad"], f["ic/psi-true-rad"] = phi, theta, 0.0
        f["ic/p-rad_sec"], f["ic/q-rad_sec"], f["ic/r-rad_sec"] = p, q, r
        f["ic/u-fps"], f["ic/v-fps"], f["ic/w-fps"] = u / FT, v / FT, w / FT
        f["fcs/posElev_rad"] = elevator
        f["external_reactions/thrust/magnitude"] = thrust / LBF
        f.run_ic()

    def rates(self, x: np.ndarray, elevator: float, thrust: float) -> np.ndarray:
        self.set(x, elevator, thrust)
        f = self.fdm
        linear = [f[f"accelerations/{k}dot-ft_sec2"] * FT for k in "uvw"]
        angular = [f[f"accelerations/{k}dot-rad_sec2"] for k in "pqr"]
        p, q, r, phi, theta = x[3:]
        attitude = [
            p + math.tan(theta) * (q * math.sin(phi) + r * math.cos(phi)),
            q * math.cos(phi) - r * math.sin(phi),
        ]
        return np.array([*linear, *angular, *attitude])

    def coefficients(self, x: np.ndarray, elevator: float, thrust: float) -> np.ndarray:
        self.set(x, elevator, thrust)
        return np.array([self.fdm[f"aero/coefficient/{name}"] for name in COEFFICIENTS.values()])


def level(alpha: float) -> np.ndarray:
    return np.array([V * math.cos(alpha), 0.0, V * math.sin(alpha), 0.0, 0.0, 0.0, 0.0, alpha])


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> tuple[JSBSim, float, float, float]:
    """The model and its trim: angle of attack, elevator, thrust."""
    pytest.importorskip("jsbsim")
    if "AEROFDI_DATA" not in os.environ:
        pytest.skip("AEROFDI_DATA is not set")
    source = Path(os.environ["AEROFDI_DATA"]) / "facts" / "jsbsim_ultrastick120"
    model = JSBSim(tmp_path_factory.mktemp("jsbsim"), source)

    def residual(z: np.ndarray) -> np.ndarray:
        return model.rates(level(z[0]), z[1], z[2])[[0, 2, 4]]

    z = np.array([0.07, -0.04, 25.0])
    for _ in range(8):
        J = np.array(
            [(residual(z + d) - residual(z - d)) / (2 * d.max()) for d in np.diag([1e-4, 1e-4, 1e-2])]
        ).T
        z = z - np.linalg.solve(J, residual(z))
    assert np.abs(residual(z)).max() < 1e-7
    return model, *z


def jsbsim_modes(judge: tuple[JSBSim, float, float, float]) -> dict[str, Mode]:
    model, alpha, elevator, thrust = judge
    x0, h = level(alpha), np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4])
    A = np.array(
        [
            (model.rates(x0 + d, elevator, thrust) - model.rates(x0 - d, elevator, thrust)) / (2 * d.max())
            for d in np.diag(h)
        ]
    ).T
    order = ("u", "v", "w", "p", "q", "r", "phi", "theta")
    lon, lat = ([order.index(n) for n in names] for names in (LONGITUDINAL, LATERAL))
    return {m.name: m for m in longitudinal_modes(A[np.ix_(lon, lon)]) + lateral_modes(A[np.ix_(lat, lat)])}


def its_coefficients(judge: tuple[JSBSim, float, float, float]) -> dict[str, float]:
    """JSBSim's coefficients and slopes at its trim, as our names."""
    model, alpha, elevator, thrust = judge

    def C(
        da: float = 0.0, db: float = 0.0, p: float = 0.0, q: float = 0.0, r: float = 0.0, de: float = 0.0
    ) -> np.ndarray:
        a = alpha + da
        x = np.array(
            [
                V * math.cos(a) * math.cos(db),
                V * math.sin(db),
                V * math.sin(a) * math.cos(db),
                p,
                q,
                r,
                0.0,
                a,
            ]
        )
        return model.coefficients(x, elevator + de, thrust)

    def slope(h: float, scale: float = 1.0, **which: float) -> np.ndarray:
        (name,) = which
        return (C(**{name: h}) - C(**{name: -h})) / (2 * h) * scale

    rate, pitch_rate = 2 * V / SPAN, 2 * V / CHORD
    slopes = {
        "alpha": slope(1e-4, da=1), "beta": slope(1e-4, db=1), "p": slope(1e-3, rate, p=1),
        "q": slope(1e-3, pitch_rate, q=1), "r": slope(1e-3, rate, r=1), "de": slope(1e-4, de=1),
    }  # fmt: skip
    out = {f"{c}_{k}": float(s[i]) for k, s in slopes.items() for i, c in enumerate(COEFFICIENTS)}
    here = C()
    for i, c in enumerate(COEFFICIENTS):
        if c in ("CY", "Cl", "Cn"):
            assert abs(here[i]) < 1e-4  # residues of the lattice; nothing here to trim them with
            continue
        out[f"{c}_0"] = float(here[i] - slopes["alpha"][i] * alpha - slopes["de"][i] * elevator)
    return out


def transplanted(c: dict[str, float]) -> PlantParams:
    """Our plant with JSBSim's mass, geometry and coefficients, thrust constant at the nose."""
    zero = (0.0,) * 8
    clean = Derivatives(*(c.get(n, 0.0) for n in Derivatives._fields))
    # Drag is ours per |rad| and the elevator is up; what the lattice gives sideways is residue.
    de = [(k, *zero[1:]) for k in (-c["CD_de"], 0.0, c["CL_de"], 0.0, c["Cm_de"], 0.0)]
    mass = MassProperties(
        7.411, Inertia(0.8568, 1.0095, 1.7005, -0.18981451275), Inertia(*zero[:4]), 0.315, 0.072, 0.0, 0.0
    )
    wing = Wing(AREA, CHORD, SPAN, 0.307975, 0.0, 0.48, 1.0, 0.0, 0.0, 0.0, 0.0)
    ice = Derivatives(*([0.0] * len(clean)))
    return PlantParams(
        ControlDerivatives(tuple(de), (zero,) * 6),  # type: ignore[arg-type]
        Body(
            Air(1.2132, 0.0, 0.0, G),
            mass,
            wing,
            DerivativeAero(clean, ice, 0.0, 0.0, 0.0, 0.0),
            ThrustLaw(50.0, V, 0.0, 5.0, 0.1),
        ),
    )


@pytest.mark.data
def test_with_its_coefficients_our_equations_have_the_modes_of_jsbsim(judge: tuple) -> None:
    theirs = jsbsim_modes(judge)
    c = its_coefficients(judge)
    a = load_aircraft("ultrastick120")
    p = transplanted(c)
    t = trim(a, V, H, params=p)
    assert t.alpha / DEG == pytest.approx(judge[1] / DEG, abs=0.02)
    assert t.commands["elevator"] / DEG == pytest.approx(judge[2] / DEG, abs=0.02)
    assert t.throttle * 50.0 == pytest.approx(judge[3], rel=2e-3)
    ours = {m.name: m for m in modes(a, t, params=p)}
    assert set(ours) == set(theirs) == {"short period", "phugoid", "roll", "spiral", "Dutch roll"}
    for name in ("short period", "phugoid", "roll", "Dutch roll"):
        assert ours[name].eigenvalue == pytest.approx(theirs[name].eigenvalue, rel=5e-3), name
    # A pole near the origin is a small difference of large numbers.
    assert ours["spiral"].eigenvalue == pytest.approx(theirs["spiral"].eigenvalue, abs=3e-3)


@pytest.mark.data
def test_the_modes_differ_as_the_two_sets_of_aerodynamics_do(judge: tuple) -> None:
    theirs, c = jsbsim_modes(judge), its_coefficients(judge)
    a = load_aircraft("ultrastick120")
    t = trim(a, V, H)
    ours = {m.name: m for m in modes(a, t)}
    # Trim: the lattice has 2.5 times the drag of the wind tunnel.
    drag = judge[3] * math.cos(judge[1])
    mine = thrust(plant_params(a), t.state, t.throttle, STILL_AIR, HEALTHY_EFFECTS) * math.cos(t.alpha)
    assert drag / mine == pytest.approx(2.5, abs=0.1)
    # Short period and roll agree within 20 %; roll goes with the damping in roll and its reference size.
    for name in ("short period", "roll"):
        assert theirs[name].wn == pytest.approx(ours[name].wn, rel=0.2), name
    tables = a.tables
    i = np.searchsorted(tables["roll_rate.alpha"], t.alpha) - 1
    f = (t.alpha - tables["roll_rate.alpha"][i]) / np.diff(tables["roll_rate.alpha"])[i]
    Clp = ((1 - f) * tables["roll_rate.data"][i, 1, 1] + f * tables["roll_rate.data"][i + 1, 1, 1]) / 0.01
    size = (AREA * SPAN**2) / (a.number("reference.wing_area") * a.number("reference.span") ** 2)
    assert theirs["roll"].wn / ours["roll"].wn == pytest.approx(c["Cl_p"] / Clp * size, rel=0.05)
    # Dutch roll: nearly the same frequency; its decay goes with the sum of side-force and yaw damping.
    assert theirs["Dutch roll"].wn == pytest.approx(ours["Dutch roll"].wn, rel=0.12)
    p = transplanted(c)
    A_theirs = linearise(a, trim(a, V, H, params=p), states=LATERAL, inputs=["aileron"], params=p).A
    A_ours = linearise(a, t, states=LATERAL, inputs=["aileron"]).A
    decay = (A_theirs[0, 0] + A_theirs[2, 2]) / (A_ours[0, 0] + A_ours[2, 2])
    assert decay < 0.75
    found = theirs["Dutch roll"].eigenvalue.real / ours["Dutch roll"].eigenvalue.real
    assert found == pytest.approx(decay, rel=0.15)
    # Spiral: of opposite sign, both slower than 15 s.
    assert theirs["spiral"].eigenvalue.real > 0.0 > ours["spiral"].eigenvalue.real
    assert max(theirs["spiral"].wn, ours["spiral"].wn) < 1.0 / 15.0
