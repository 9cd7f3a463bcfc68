"""The published Vireo matrices at 15.4 m/s and their derived dependence on airspeed, as a fixture of its own.

Trim alpha(V) = theta_n + K ((15.4/V)^2 - 1); aerodynamic state derivatives grow with V, control derivatives with V^2.
"""

import math

import numpy as np
import pytest

from aerofdi.design.lpv import gridded
from aerofdi.design.lpv_observer_models import Axis
from aerofdi.design.lpv_observer_plants import Controller, Ratio, Weights

DEG = math.pi / 180.0
THETA = math.atan(0.0683)
A_LAT = np.array(
    [[-0.574, 1.12, -15.3, 9.78], [-3.99, -11.3, 2.5, 0], [0.311, -1.49, -0.944, 0], [0, 1, 0.0683, 0]]
)
B_LAT = np.array([[-0.49], [-201.0], [-9.61], [0.0]])
A_LON, B_LON = np.array([[-5.487, -12.86], [13.85, -5.688]]), np.array([[-185.7], [-24.52]])
# (18)
A_ACT = np.array([
    [-2.409, 26.09, 7.284, -7.204, 12.42], [-26.09, -7.319, -49.17, 8.948, -32.95],
    [7.284, 49.17, -26.57, 60.33, -56.4], [7.204, 8.948, -60.33, -15.56, 150.4], [12.42, 32.95, -56.4, -150.4, -184.1],
])  # fmt: skip
B_ACT = np.array([[-2.097], [-3.114], [4.485], [2.465], [5.982]])
C_ACT, D_ACT = np.array([[-2.097, 3.114, 4.485, -2.465, 5.982]]), np.array([[-0.06135]])


def alpha(V):
    z_trim = -5.688 * 15.4 + 24.52 * (-12.86 * 15.4) / -185.7
    return THETA - 9.80665 * math.cos(THETA) / z_trim * ((15.4 / V) ** 2 - 1.0)


def lateral(V):
    V = np.atleast_1d(np.asarray(V, float))
    r, a = V / 15.4, alpha(V)
    A = np.zeros((len(V), 4, 4))
    A[:, :3, :3] = A_LAT[:3, :3] * r[:, None, None]
    A[:, 0, 1] = (1.12 - 15.4 * math.sin(THETA)) * r + V * np.sin(a)
    A[:, 0, 2] = (-15.3 + 15.4 * math.cos(THETA)) * r - V * np.cos(a)
    A[:, 0, 3] = 9.78 * np.cos(a) / math.cos(THETA)
    A[:, 3, 1], A[:, 3, 2] = 1.0, np.tan(a)
    return A, B_LAT * (r**2)[:, None, None]


def longitudinal(V):
    V = np.atleast_1d(np.asarray(V, float))
    r = V / 15.4
    A = A_LON * r[:, None, None]
    A[:, 1, 0] = (13.85 - 15.4 * math.cos(THETA)) * r + V * np.cos(alpha(V))
    return A, B_LON * (r**2)[:, None, None]


LAT_WEIGHTS = Weights(
    3 * DEG,
    (6 * DEG, 6 * DEG),
    30 * DEG,
    Ratio((1.0, 3.924), (1.0, 392.4)),
    Ratio((1.0, 4.0), (1.122, 0.07113)),
)
LON_WEIGHTS = Weights(
    4 * DEG,
    (10 * DEG,),
    0.0,
    Ratio((1.0, 53.43, 213.5), (1.0, 436.0, 427.0)),
    Ratio((1.0, 14.5), (1.122, 9.149)),
)


@pytest.fixture(scope="session")
def actuator():
    return gridded([0.0], A_ACT, B_ACT, C_ACT, D_ACT, ("u",), ("y",))


@pytest.fixture(scope="session")
def axes(actuator):
    """Axis objects of the fixture aircraft."""
    return {
        "lat": Axis("lat", lateral, actuator, LAT_WEIGHTS, Controller(-0.34, -0.086, 0.06)),
        "lon": Axis("lon", longitudinal, actuator, LON_WEIGHTS, Controller(kq=0.05)),
    }
