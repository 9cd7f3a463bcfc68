"""Trims, linear models and modes against published and independently computed numbers."""

import math
import os
import tomllib
from pathlib import Path

import numpy as np
import pytest

from aerofdi.aircraft import Aircraft, load_aircraft
from aerofdi.core import WrongUse
from aerofdi.dynamics.build import plant_params
from aerofdi.dynamics.linearise import (
    LATERAL,
    LONGITUDINAL,
    lateral_modes,
    linearise,
    longitudinal_modes,
    lpv_grid,
    modes,
)
from aerofdi.dynamics.plant import PlantParams, derivative, outputs, step
from aerofdi.dynamics.stuck_range import trimmable_range
from aerofdi.dynamics.trim import NoTrim, trim
from aerofdi.dynamics.types import HEALTHY_EFFECTS, STILL_AIR

DEG = math.pi / 180.0
ALL = ("vireo", "aerosonde", "aerosonde_aerosim", "ducard", "ultrastick120")


def rounds_to(value: float, printed: str) -> bool:
    """Whether the value gives the printed digits when rounded as many places."""
    places = len(printed.split(".")[1]) if "." in printed else 0
    return abs(value - float(printed)) <= 0.5 * 10.0**-places + 1e-9


# (15) and (16) of the comparison of methods on the Vireo, as printed.
A_LON = [["-5.487", "-12.86"], ["13.85", "-5.688"]]
B_LON = ["-185.7", "-24.52"]
A_LAT = [
    ["-0.574", "1.12", "-15.3", "9.78"],
    ["-3.99", "-11.3", "2.5", "0"],
    ["0.311", "-1.49", "-0.944", "0"],
    ["0", "1", "0.0683", "0"],
]
B_LAT = ["-0.49", "-201", "-9.61", "0"]


def test_vireo_equals_the_published_matrices_to_every_digit_but_one() -> None:
    a = load_aircraft("vireo")
    lon = linearise(a, 15.4, states=["q", "w"], inputs=["elevator"])
    lat = linearise(a, 15.4, states=["v", "p", "r", "phi"], inputs=["aileron"], outputs=["phi", "p", "r"])
    off = []
    for ours, printed in ((lon.A, A_LON), (lat.A, A_LAT)):
        off += [
            (i, j)
            for i, row in enumerate(printed)
            for j, text in enumerate(row)
            if not rounds_to(ours[i, j], text)
        ]
    for ours, column in ((lon.B, B_LON), (lat.B, B_LAT)):
        off += [(i, 0) for i, text in enumerate(column) if not rounds_to(ours[i, 0], text)]
    assert off == []
    # The one number that is not there to the digits printed elsewhere: g cos(theta), 9.784 against 9.78.
    assert lat.A[0, 3] == pytest.approx(9.7839, abs=5e-5)
    assert np.array_equal(lat.C, np.eye(4)[[3, 1, 2]]) and not lat.D.any()
    assert lon.state_units == ("rad/s", "m/s") and lon.input_units == ("rad",)


def test_vireo_elevons_are_half_elevator_half_aileron() -> None:
    a = load_aircraft("vireo")
    m = linearise(a, 15.4, states=["p", "q"], inputs=["elevon_left", "elevon_right", "elevator", "aileron"])
    left, right, de, da = m.B.T
    assert np.allclose(left + right, de) and np.allclose(right - left, da)
    assert left[0] > 0.0 > right[0]


# V, alpha, elevator, short period wn/zeta, phugoid, Dutch roll, roll, spiral; computed apart from this package.
VIREO_TABLE = """
12.000 9.804 -9.878 11.164 0.393 1.107 0.105 3.429 0.164  -8.789 -0.0769
13.263 7.096 -6.984 12.409 0.390 1.005 0.116 3.658 0.150  -9.846 -0.0993
14.526 5.046 -4.792 13.631 0.387 0.920 0.130 3.895 0.139 -10.893 -0.1133
15.368 3.945 -3.615 14.438 0.386 0.871 0.140 4.057 0.134 -11.586 -0.1194
16.632 2.593 -2.170 15.640 0.385 0.807 0.158 4.305 0.128 -12.619 -0.1251
17.895 1.514 -1.016 16.835 0.385 0.751 0.177 4.558 0.123 -13.647 -0.1279
20.000 0.146  0.445 18.818 0.384 0.674 0.215 4.988 0.117 -15.351 -0.1284
"""


def test_vireo_over_airspeed() -> None:
    a = load_aircraft("vireo")
    grid = {round(V, 3): float(V) for V in np.linspace(12.0, 20.0, 20)}
    for line in VIREO_TABLE.strip().split("\n"):
        V, *expected = (float(x) for x in line.split())
        t = trim(a, grid[V])
        # Short period as published: of q and w alone.
        lon = linearise(a, t, states=["q", "w"], inputs=["elevator"])
        short = max(np.linalg.eigvals(lon.A), key=lambda e: e.imag)
        m = {x.name: x for x in modes(a, t)}
        ours = [
            t.alpha / DEG, t.commands["elevator"] / DEG, abs(short), -short.real / abs(short),
            m["phugoid"].wn, m["phugoid"].zeta, m["Dutch roll"].wn, m["Dutch roll"].zeta,
            m["roll"].eigenvalue.real, m["spiral"].eigenvalue.real,
        ]  # fmt: skip
        tolerance = [5e-4, 5e-4, 5e-4, 5e-4, 2.5e-3, 5e-4, 5e-4, 5e-4, 5e-4, 5e-5]
        assert (np.abs(np.array(ours) - expected) <= np.array(tolerance) * 1.02).all(), (V, ours, expected)


def values(
    a: Aircraft, V: float, h: float | None = None, params: PlantParams | None = None, **steps: float
) -> dict:
    t = trim(a, V, h, params=params)
    return {
        "alpha": t.alpha / DEG,
        "throttle": t.throttle,
        "engine": t.state.engine,
        **{k: v / DEG for k, v in t.commands.items()},
        **{m.name: m.eigenvalue for m in modes(a, t, params=params, steps=steps or None)},
    }


def test_aerosonde_of_the_textbook() -> None:
    a = load_aircraft("aerosonde")
    v = values(a, 18.0, 50.0)
    assert v["alpha"] == pytest.approx(13.1131, abs=5e-4)
    assert v["elevator"] == pytest.approx(-12.6451, abs=5e-4)
    assert v["throttle"] == pytest.approx(0.254048, abs=1e-6)
    assert v["short period"] == pytest.approx(-1.0651 + 2.5979j, abs=1e-4)
    assert v["phugoid"] == pytest.approx(-0.1524 + 0.6848j, abs=1e-4)
    assert v["roll"] == pytest.approx(-7.6965, abs=2e-4)
    assert v["Dutch roll"] == pytest.approx(-3.0663 + 6.6768j, abs=1e-4)
    assert v["spiral"] == pytest.approx(0.0577, abs=1e-4)
    v = values(a, 25.0, 50.0)
    assert (v["alpha"], v["elevator"], v["throttle"]) == pytest.approx((4.712, -6.260, 0.33495), abs=5e-4)


def test_aerosonde_of_the_blockset() -> None:
    a = load_aircraft("aerosonde_aerosim")
    p = plant_params(a)
    # The independent numbers leave the alpha-dot derivatives out.
    p = p._replace(body=p.body._replace(wing=p.body.wing._replace(CL_alpha_dot=0.0, Cm_alpha_dot=0.0)))
    v = values(a, 25.0, 0.0, p)
    assert v["alpha"] == pytest.approx(4.016, abs=5e-4)
    assert v["elevator"] == pytest.approx(1.061, abs=5e-4)
    assert v["engine"] == pytest.approx(546.7, abs=0.05)
    assert v["short period"] == pytest.approx(-4.2670 + 7.9216j, abs=1e-4)
    assert v["phugoid"] == pytest.approx(-0.0974 + 0.3723j, abs=1e-4)
    assert v["roll"] == pytest.approx(-20.8683, abs=1e-4)
    assert v["Dutch roll"] == pytest.approx(-1.4974 + 5.4935j, abs=1e-4)
    assert v["spiral"] == pytest.approx(0.0885, abs=1e-4)
    assert values(a, 23.0, 0.0)["elevator"] == pytest.approx(-1.05, abs=5e-3)
    with pytest.raises(NoTrim):
        trim(a, 25.0, 0.0, fuel=0.0)  # nothing left to burn
    empty = trim(a, 25.0, 0.0, fuel=1e-6)
    assert (empty.alpha / DEG, empty.commands["elevator"] / DEG) == pytest.approx((1.56, 5.38), abs=5e-3)
    with_alpha_dot = {m.name: m for m in modes(a, trim(a, 25.0, 0.0))}
    assert with_alpha_dot["short period"].zeta > 0.474 + 0.05  # they damp the short period


def test_ducards_aircraft() -> None:
    a = load_aircraft("ducard")
    v = values(a, 30.0)
    assert (v["alpha"], v["elevator"]) == pytest.approx((5.0522, -1.3496), abs=5e-5)
    assert v["engine"] / (2.0 * math.pi) == pytest.approx(60.637, abs=5e-4)
    assert v["short period"] == pytest.approx(-4.4592 + 2.1141j, abs=1e-4)
    assert v["phugoid"] == pytest.approx(-0.1369 + 0.1465j, abs=1e-4)
    assert v["roll"] == pytest.approx(-11.9546, abs=1e-4)
    assert v["Dutch roll"] == pytest.approx(-1.8636 + 4.7223j, abs=1e-4)
    assert v["spiral"] == pytest.approx(0.0328, abs=1e-4)
    B = linearise(a, 30.0, states=["p", "q", "r"]).B[:, :5]
    assert np.allclose(
        B,
        [
            [-41.14833, 41.14833, -5.87833, 5.87833, -2.86382],
            [2.05387, 2.05387, 14.38762, 14.38762, 0.0],
            [1.82072, -1.82072, 0.2601, -0.2601, 14.66274],
        ],
        atol=1e-5,
    )


def test_ultra_stick_needs_aileron_against_its_propeller() -> None:
    a = load_aircraft("ultrastick120")
    t = trim(a, 23.0)
    assert t.commands["aileron"] / DEG == pytest.approx(0.297, abs=5e-4)
    assert abs(t.commands["rudder"]) < 1e-6 and abs(t.phi) < 1e-6
    # The independent slopes were chords over 0.3 rad/s of roll rate and about 2 deg of sideslip.
    v = values(a, 23.0, p=0.3, v=0.8)
    assert (v["alpha"], v["elevator"]) == pytest.approx((4.644, -3.652), abs=5e-4)
    assert v["throttle"] == pytest.approx(0.5018, abs=5e-5)
    assert v["short period"] == pytest.approx(-7.1346 + 7.0203j, abs=1e-3)
    assert v["phugoid"] == pytest.approx(-0.1830 + 0.1451j, abs=2e-4)
    assert v["roll"] == pytest.approx(-9.1278, abs=1e-3)
    assert v["Dutch roll"] == pytest.approx(-1.2364 + 3.8905j, abs=1e-3)
    assert v["spiral"] == pytest.approx(-0.0391, abs=3e-4)
    v = values(a, 25.0)
    assert (v["alpha"], v["elevator"]) == pytest.approx((4.035, -3.278), abs=5e-4)
    assert v["throttle"] == pytest.approx(0.5779, abs=5e-5)
    m = linearise(a, 23.0, states=LATERAL, inputs=["aileron"])
    assert m.B[:, 0] == pytest.approx([0.0, -100.825, 11.254, 0.0], abs=1e-3)


def test_the_split_rudder_turns_by_both_halves_and_rolls_by_their_arms() -> None:
    a = load_aircraft("ultrastick120")
    chord = {"rudder_top": 20.0 * DEG, "rudder_bottom": 20.0 * DEG}
    B = linearise(a, 23.0, states=LATERAL, inputs=["rudder_top", "rudder_bottom"], steps=chord).B
    assert B[:, 0] == pytest.approx([1.42649, 2.28732, -5.61845, 0.0], rel=1e-2)
    assert B[:, 1] == pytest.approx([1.42649, 1.0247, -5.47751, 0.0], rel=1e-2)


@pytest.mark.data
def test_the_whole_grid_of_the_vireo_equals_the_independent_one() -> None:
    if "AEROFDI_DATA" not in os.environ:
        pytest.skip("AEROFDI_DATA is not set")
    facts = tomllib.loads((Path(os.environ["AEROFDI_DATA"]) / "facts/aircraft/vireo.toml").read_text())
    a = load_aircraft("vireo")
    speeds = [row["V"] for row in facts["lpv"]]
    lon = lpv_grid(a, speeds, states=["q", "w"], inputs=["elevator"], outputs=["q"])
    lat = lpv_grid(a, speeds, states=LATERAL, inputs=["aileron"], outputs=["phi", "p", "r"])
    assert lon.rate_bounds == (-8.0, 8.0) and len(speeds) == 20
    for k, row in enumerate(facts["lpv"]):
        assert np.allclose(lon.A[k], row["A_lon_qw"], rtol=1e-5, atol=1e-6)
        assert np.allclose(lon.B[k, :, 0], row["B_lon"], rtol=1e-5)
        assert np.allclose(lat.A[k], row["A_lat_vprphi"], rtol=1e-5, atol=1e-6)
        assert np.allclose(lat.B[k, :, 0], row["B_lat"], rtol=1e-5)
        assert lon.trims[k].state.engine * 6.0 * 15.4 / row["V"] == pytest.approx(row["T"], rel=1e-5)


@pytest.mark.parametrize("name", ALL)
def test_climbs_and_turns_are_steady(name: str) -> None:
    a = load_aircraft(name)
    p = plant_params(a)
    t = trim(a, climb_angle=0.05, turn_rate=0.1, params=p)
    x = t.placed(heading=1.0)
    k = derivative(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS)
    z = outputs(p, x, k, STILL_AIR)
    assert max(abs(v) for v in (k.u, k.v, k.w, k.p, k.q, k.r)) < 1e-7
    assert z.climb_rate == pytest.approx(t.airspeed * math.sin(0.05), rel=1e-6)
    assert t.phi > 0.05
    for _ in range(100):
        x = step(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
    after = outputs(p, x, k, STILL_AIR)
    assert after.psi - z.psi == pytest.approx(0.1, abs=2e-3)
    by_bank = trim(a, climb_angle=0.05, bank=t.phi, params=p)
    assert by_bank.turn_rate == pytest.approx(0.1, rel=1e-6)


def test_sideslip_is_flown_where_there_is_a_rudder() -> None:
    t = trim(load_aircraft("ducard"), 30.0, sideslip=5.0 * DEG)
    assert t.beta == pytest.approx(5.0 * DEG)
    assert abs(t.phi) > 0.5 * DEG and abs(t.commands["rudder"]) > DEG
    with pytest.raises(WrongUse, match="sideslip"):
        trim(load_aircraft("vireo"), sideslip=0.1)


def test_what_cannot_be_trimmed_says_why() -> None:
    a = load_aircraft("vireo")
    with pytest.raises(NoTrim, match="throttle at its limit"):
        trim(a, 19.0, climb_angle=0.4)
    with pytest.raises(NoTrim, match="elevon"):
        trim(a, 6.0)
    with pytest.raises(WrongUse, match="too few"):
        trim(a, stuck={"elevon_left": 0.0})
    with pytest.raises(WrongUse, match="undetermined"):
        trim(a, free=("airspeed",))  # both elevons work: any airspeed would do
    with pytest.raises(WrongUse, match="must be shorter"):
        trim(load_aircraft("ducard"), free=("airspeed",))
    with pytest.raises(WrongUse, match="accepted: airspeed"):
        trim(a, free=("heading",))
    with pytest.raises(WrongUse, match="not both"):
        trim(a, bank=0.1, turn_rate=0.1)


def test_stuck_surfaces_stay_where_they_are_and_the_others_hold_the_flight() -> None:
    a = load_aircraft("ultrastick120")
    t = trim(a, stuck={"rudder_top": 20.0 * DEG})
    assert t.surfaces[a.surface_index("rudder_top")] == 20.0 * DEG
    assert t.surfaces[a.surface_index("rudder_bottom")] == pytest.approx(-20.0 * DEG, abs=2.0 * DEG)
    assert t.commands["aileron"] / DEG > 0.297 + 0.1  # a top rudder stuck left rolls right


def test_a_stuck_elevon_can_be_flown_only_at_its_own_airspeed() -> None:
    """Wings level without sideslip both elevons must be equal, so the stuck one fixes angle of attack and speed."""
    a = load_aircraft("vireo")
    for degrees in (-8.0, -2.0):
        t = trim(a, stuck={"elevon_right": degrees * DEG}, free=("airspeed",))
        assert t.surfaces[0] == pytest.approx(degrees * DEG, abs=1e-6)
        assert t.airspeed == pytest.approx(trim(a, t.airspeed).airspeed)
        assert trim(a, t.airspeed).surfaces[0] == pytest.approx(degrees * DEG, abs=1e-6)


def test_range_of_stuck_elevon_angles_of_the_vireo() -> None:
    """The paper: about -7 to +5 deg about trim. The envelope of 12 to 20 m/s gives -6.3 to +4.0."""
    a = load_aircraft("vireo")
    found = trimmable_range(a, "elevon_right")
    low, high = (found.low - found.nominal) / DEG, (found.high - found.nominal) / DEG
    assert low == pytest.approx(-9.878 + 3.575, abs=0.02) and high == pytest.approx(0.445 + 3.575, abs=0.02)
    assert found.released == "airspeed"
    left = trimmable_range(a, "elevon_left")
    assert (left.low, left.high) == pytest.approx((found.low, found.high), abs=1e-3)


def test_range_of_stuck_elevator_angles_is_that_of_the_airspeeds() -> None:
    """Without its elevator an aircraft has one airspeed for each stuck angle: the range is that of the envelope."""
    a = load_aircraft("aerosonde")
    found = trimmable_range(a, "elevator")
    slow, fast = (trim(a, V).commands["elevator"] for V in (16.0, 35.0))
    assert (found.low, found.high) == pytest.approx((slow, fast), abs=2e-4)
    assert found.released == "airspeed"


def test_a_redundant_surface_may_be_stuck_anywhere() -> None:
    found = trimmable_range(load_aircraft("ultrastick120"), "rudder_bottom")
    assert found.released == ""
    assert found.low == pytest.approx(-25.0 * DEG) and found.high == pytest.approx(25.0 * DEG)


@pytest.mark.parametrize("name", ALL)
def test_linear_and_nonlinear_flight_agree_near_trim(name: str) -> None:
    """One second after a small kick; the linear model flown by its matrix exponential."""
    from scipy.linalg import expm

    a = load_aircraft(name)
    p = plant_params(a)
    t = trim(a, params=p)
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "altitude", "engine")
    m = linearise(a, t, states=names, params=p)
    kick = dict(zip(names, (0.01, 0.01, 0.01, 1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0, 0.0), strict=True))
    linear = expm(m.A * 1.0) @ np.array([kick[n] for n in names])
    x = t.state._replace(**{n: getattr(t.state, n) + kick[n] for n in names[:6]})
    for _ in range(100):
        x = step(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
    z = outputs(p, x, x, STILL_AIR)
    s = t.state
    real = [
        x.u - s.u,
        x.v - s.v,
        x.w - s.w,
        x.p - s.p,
        x.q - s.q,
        x.r - s.r,
        z.phi - t.phi,
        z.theta - t.theta,
        z.altitude - t.altitude,
    ]
    size = np.abs(linear[:9]).max()
    assert size > 1e-3 and abs(linear[8]) > 3e-4
    # The wind-tunnel drag has a kink at zero sideslip, which no linear model has.
    assert np.abs(np.array(real) - linear[:9]).max() < (0.08 if name == "ultrastick120" else 0.02) * size


def test_inputs_of_wind_and_faults_are_those_of_the_air() -> None:
    a = load_aircraft("vireo")
    m = linearise(
        a, 15.4, inputs=["gust_u", "wind_north", "gust_v", "gust_w", "thrust", "lift_left", "elevator"]
    )
    states = {n: i for i, n in enumerate(m.states)}
    aero_u = m.A[:, states["u"]].copy()
    assert m.B[states["u"], 0] == pytest.approx(-aero_u[states["u"]])  # a tail gust is a loss of airspeed
    g = 9.80665
    assert m.B[states["v"], 2] == pytest.approx(-m.A[states["v"], states["v"]])
    assert m.B[states["w"], 1] != m.B[states["w"], 0]  # along the nose or along the ground
    t = m.trim
    assert m.B[states["u"], 4] == pytest.approx(t.state.engine * 6.0 / 1.28)
    assert m.B[states["p"], 5] > 0.0  # more lift on the left rolls right
    assert g > 0


def test_selection_of_a_model_keeps_names_and_units() -> None:
    m = linearise(load_aircraft("vireo"), 15.4, outputs=["airspeed", "alpha", "ay", "q"])
    small = m.select(states=LATERAL, inputs=["elevon_left"], outputs=["ay"])
    assert small.A.shape == (4, 4) and small.B.shape == (4, 1) and small.C.shape == (1, 4)
    assert small.states == LATERAL and small.output_units == ("m/s2",) and small.input_units == ("rad",)
    assert small.D[0, 0] != 0.0  # an elevon pushes sideways at once
    # ay = v' + U r - W p - g cos(theta) phi.
    t = m.trim
    expected = small.A[0] + [0.0, -t.state.w, t.state.u, -9.80665 * math.cos(t.theta)]
    assert small.C[0] == pytest.approx(expected, abs=1e-6)
    for kind in ("states", "inputs", "outputs"):
        with pytest.raises(WrongUse, match="wing"):
            m.select(**{kind: ["wing"]})
    with pytest.raises(WrongUse, match="elevon_left"):
        linearise(load_aircraft("vireo"), 15.4, inputs=["rudder"])


def test_a_grid_carries_names_and_refuses_nonsense() -> None:
    a = load_aircraft("ultrastick120")
    g = lpv_grid(
        a,
        [20.0, 23.0, 26.0],
        states=LATERAL,
        inputs=["rudder", "aileron"],
        outputs=["beta", "r"],
        rate_bounds=(-3.0, 3.0),
    )
    assert (
        g.A.shape == (3, 4, 4)
        and g.B.shape == (3, 4, 2)
        and g.C.shape == (3, 2, 4)
        and g.D.shape == (3, 2, 2)
    )
    assert g.rate_bounds == (-3.0, 3.0) and g.output_units == ("rad", "rad/s")
    assert np.allclose(g.C[1, 0, 0], 1.0 / 23.0, rtol=1e-6)
    with pytest.raises(WrongUse, match="rises"):
        lpv_grid(a, [23.0, 20.0])
    with pytest.raises(WrongUse, match="airspeed_rate"):
        lpv_grid(a, [23.0])


def test_modes_are_named_by_what_they_are() -> None:
    def block(*pairs: complex) -> np.ndarray:
        A = np.zeros((4, 4))
        i = 0
        for e in pairs:
            if e.imag:
                A[i : i + 2, i : i + 2] = [[e.real, e.imag], [-e.imag, e.real]]
                i += 2
            else:
                A[i, i] = e.real
                i += 1
        return A

    assert [m.name for m in longitudinal_modes(block(-0.1 + 0.4j, -4 + 8j))] == ["short period", "phugoid"]
    assert [m.name for m in longitudinal_modes(block(-9, -4, -0.1 + 0.4j))] == [
        "short period",
        "short period",
        "phugoid",
    ]
    assert [m.name for m in longitudinal_modes(block(-4 + 8j, -0.3, -0.1))] == [
        "short period",
        "phugoid",
        "phugoid",
    ]
    assert [m.name for m in lateral_modes(block(-1 + 4j, 0.05, -11))] == ["roll", "spiral", "Dutch roll"]
    assert [m.name for m in lateral_modes(block(-1 + 4j, -3 + 1j))] == ["Dutch roll", "roll-spiral"]
    spiral = lateral_modes(block(-1 + 4j, 0.05, -11))[1]
    assert spiral.zeta == -1.0 and spiral.wn == pytest.approx(0.05)
    assert LONGITUDINAL == ("u", "w", "q", "theta")
