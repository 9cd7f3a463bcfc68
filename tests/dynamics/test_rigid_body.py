"""Attitude and rotation: invariants of motion without torque, and two descriptions of attitude that must agree."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.aircraft import load_aircraft
from aerofdi.dynamics.build import plant_params
from aerofdi.dynamics.plant import PlantParams, derivative, step
from aerofdi.dynamics.rigid_body import (
    angular_acceleration,
    euler,
    quaternion,
    quaternion_rate,
    to_body,
    to_ned,
)
from aerofdi.dynamics.types import HEALTHY_EFFECTS, STILL_AIR, State

OFF = (0.0,) * 8
ULTRASTICK = plant_params(load_aircraft("ultrastick120"))
angle = st.floats(-3.1, 3.1)
pitch = st.floats(-1.5, 1.5)
rate = st.floats(-3.0, 3.0)


def adrift(name: str) -> PlantParams:
    """The aircraft without air and without weight: only its inertia is left."""
    p = plant_params(load_aircraft(name))
    air = p.body.air._replace(density0=0.0, gravity=0.0)
    return p._replace(body=p.body._replace(air=air))


def inertia(p: PlantParams) -> np.ndarray:
    j = p.body.mass.inertia
    return np.array([[j.Jx, 0.0, -j.Jxz], [0.0, j.Jy, 0.0], [-j.Jxz, 0.0, j.Jz]])


@pytest.mark.parametrize("rates", [(1.0, 0.0, 0.0), (0.05, 1.0, 0.05), (0.5, -0.6, 0.6), (-0.3, 0.2, 0.9)])
def test_tumbling_without_torque_conserves_energy_and_angular_momentum(
    rates: tuple[float, float, float],
) -> None:
    p = adrift("aerosonde")
    J = inertia(p)
    x = State(0.0, 0.0, 0.0, 3.0, -2.0, 1.0, *quaternion(0.3, 0.4, 0.5), *rates, 0.0, 0.0)

    def invariants(x: State) -> tuple[float, np.ndarray, np.ndarray]:
        w = np.array([x.p, x.q, x.r])
        attitude = (x.e0, x.e1, x.e2, x.e3)
        return (
            0.5 * w @ J @ w,
            np.array(to_ned(*attitude, *(J @ w))),
            np.array(to_ned(*attitude, x.u, x.v, x.w)),
        )

    energy, momentum, velocity = invariants(x)
    turned = 0.0
    for _ in range(6000):
        before = x
        x = step(p, x, OFF, 0.0, STILL_AIR, HEALTHY_EFFECTS, 0.01)
        turned = max(turned, abs(x.e0 - before.e0))
    assert turned > 1e-4  # it did tumble
    now = invariants(x)
    assert abs(now[0] / energy - 1.0) < 1e-9
    assert abs(np.linalg.norm(now[1]) / np.linalg.norm(momentum) - 1.0) < 1e-9
    # In fixed axes the phase error of the method adds up over 60 s; the drift of a vector shows it.
    assert np.linalg.norm(now[1] - momentum) / np.linalg.norm(momentum) < 1e-8
    assert np.linalg.norm(now[2] - velocity) / np.linalg.norm(velocity) < 1e-8
    distance = np.array([x.north, x.east, x.down])
    assert np.linalg.norm(distance - 60.0 * velocity) / np.linalg.norm(60.0 * velocity) < 1e-8


@settings(deadline=None)
@given(angle, pitch, angle)
def test_quaternion_and_euler_angles_agree(phi: float, theta: float, psi: float) -> None:
    e = quaternion(phi, theta, psi)
    assert sum(x * x for x in e) == pytest.approx(1.0, abs=1e-15)
    back = euler(*e)
    assert np.allclose(back, (phi, theta, psi), rtol=0.0, atol=1e-11 / math.cos(theta))
    # Yaw, pitch, roll as three elementary rotations.
    c, s = math.cos, math.sin
    Rz = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    Ry = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    Rx = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    v = np.array([1.0, -2.0, 0.5])
    assert np.allclose(to_ned(*e, *v), Rz @ Ry @ Rx @ v, atol=1e-14)
    assert np.allclose(to_body(*e, *to_ned(*e, *v)), v, atol=1e-14)


@settings(deadline=None)
@given(angle, pitch, angle, rate, rate, rate)
def test_quaternion_and_euler_rates_agree(
    phi: float, theta: float, psi: float, p: float, q: float, r: float
) -> None:
    e = np.array(quaternion(phi, theta, psi))
    rate_ = np.array(quaternion_rate(*e, p, q, r))
    h = 1e-6
    plus, minus = np.array(euler(*(e + h * rate_))), np.array(euler(*(e - h * rate_)))
    c, s = math.cos, math.sin
    expected = np.array(
        [
            p + math.tan(theta) * (q * s(phi) + r * c(phi)),
            q * c(phi) - r * s(phi),
            (q * s(phi) + r * c(phi)) / c(theta),
        ]
    )
    step_ = (plus - minus + math.pi) % (2 * math.pi) - math.pi
    assert np.allclose(step_ / (2 * h), expected, rtol=1e-6, atol=1e-6 / c(theta) ** 3)


@settings(deadline=None)
@given(rate, rate, rate, rate, rate, rate, st.floats(-1.0, 1.0))
def test_angular_acceleration_solves_the_equation_of_euler(
    p: float, q: float, r: float, L: float, M: float, N: float, h: float
) -> None:
    J = inertia(ULTRASTICK)
    w = np.array([p, q, r])
    dw = np.array(angular_acceleration(ULTRASTICK.body.mass.inertia, h, p, q, r, L, M, N))
    left = J @ dw + np.cross(w, J @ w + [h, 0.0, 0.0])
    assert np.allclose(left, [L, M, N], atol=1e-12)


def test_a_free_rotor_keeps_the_angular_momentum_of_the_whole() -> None:
    """Body and rotor spin without outside torque: the whole momentum stays, although the body nods."""
    J = ULTRASTICK.body.mass.inertia
    x = np.array([*quaternion(0.0, 0.0, 0.0), 0.1, 0.3, -0.2])
    h = 0.43

    def rates(x: np.ndarray) -> np.ndarray:
        return np.array([*quaternion_rate(*x), *angular_acceleration(J, h, *x[4:], 0.0, 0.0, 0.0)])

    def whole(x: np.ndarray) -> np.ndarray:
        w = x[4:]
        return np.array(
            to_ned(*x[:4], J.Jx * w[0] - J.Jxz * w[2] + h, J.Jy * w[1], J.Jz * w[2] - J.Jxz * w[0])
        )

    start, q0 = whole(x), x[5]
    for _ in range(1000):
        k1 = rates(x)
        k2 = rates(x + 0.005 * k1)
        k3 = rates(x + 0.005 * k2)
        k4 = rates(x + 0.01 * k3)
        x = x + 0.01 / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert abs(x[5] - q0) > 0.01
    assert np.allclose(whole(x), start, atol=1e-9)


def test_kinematics_of_the_plant_are_those_of_its_attitude() -> None:
    p = adrift("vireo")
    x = State(0.0, 0.0, 0.0, 15.0, 1.0, 2.0, *quaternion(0.2, 0.1, 0.7), 0.1, 0.2, 0.3, 0.0, 0.0)
    k = derivative(p, x, OFF, 0.0, STILL_AIR, HEALTHY_EFFECTS)
    assert np.allclose([k.north, k.east, k.down], to_ned(x.e0, x.e1, x.e2, x.e3, 15.0, 1.0, 2.0))
    assert np.allclose([k.u, k.v, k.w], -np.cross([0.1, 0.2, 0.3], [15.0, 1.0, 2.0]))
