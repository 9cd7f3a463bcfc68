"""Aerosonde of the AeroSim block set: model-predictive guidance every 2 s, PI altitude hold.

The moving-horizon fault study states a state-feedback model-predictive guidance that solves a constrained
quadratic program every 2 s for the yaw-rate command and follows north-east waypoints in wind, and a PI
altitude hold; no matrices, horizon or gains. Here (all numbers assumed), with T = 2 s, horizon N = 10,
heading psi, wind w = ground velocity minus V (cos psi, sin psi), yaw rate r_k held over each T and followed
by the bank with a lag tau:

    psi_{k+1} = psi_k + (T - tau) r_k + tau r_{k-1}
    pos_{k+1} = pos_k + T (V (cos, sin)((psi_k + psi_{k+1})/2) + w)

is linearised about the nominal sequence that turns to the path as fast as |r| <= r_max allows. With y_k the
distance right of the leg that is k T of flight ahead on the path and e_k the heading minus the one that
holds that leg's course in the wind, the program is

    minimise  sum_{k=1..N} (y_k/track_scale)^2 + (e_k/heading_scale)^2 + ((r_{k-1} - r_{k-2})/rate_scale)^2
    over      r_0 .. r_{N-1} in [-r_max, r_max],   r_max = g tan(bank_max)/V,   r_{-1} the last command

solved exactly (`parts.box_qp`); r_0 is flown for T. To hold a heading or course there is no leg and y_k is
left out. The yaw rate is flown as the bank of a coordinated turn. Inner loops (aileron positive rolls left,
elevator trailing edge down, rudder trailing edge left positive):

    phi_ref  = atan(V r_0 / g)
    da       = (k_phi + k_iphi/s) (phi_ref - phi) + k_p p
    dr       = k_r (r - g sin(phi)/V)                    damper on the rate beyond that of the turn
    de       = (k_theta + k_itheta/s) (theta_ref - theta) + k_q q + lift feed-forward
    theta_ref, throttle: PI on altitude (with climb rate) and airspeed

Criteria: at least 18 dB up and 60 deg from 22 to 30 m/s and from a full to an empty tank. Margins at 25
m/s, each loop broken at its command with the others closed, with the 50 rad/s servo and the 20 Hz hold:
aileron 20 dB, 89 deg; elevator 26 dB up, 20 dB down, 72 deg; throttle 73 deg. Bandwidths: bank 3.1,
altitude 0.7, airspeed 0.4 rad/s.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.types import Array
from ..parts.box_qp import solve_box_qp
from ..parts.ops import atan2, clip, cos, jit, maximum, sin, sqrt, tan
from . import loops
from .loops import GRAVITY, airspeed_hold, altitude_hold, bank_hold, control, pitch_hold, wrap
from .signals import BANK, HEADING, TRACK, Measured, Reference

RATE_HZ = 20.0
HORIZON = 10


class Gains(NamedTuple):
    """Gains in SI and rad, units in UNITS. Limits are of the commands. guidance_period is T, bank_lag tau."""

    guidance_period: float
    bank_lag: float
    track_scale: float
    heading_scale: float
    rate_scale: float
    bank_kp: float
    bank_ki: float
    roll_rate_kp: float
    yaw_rate_kp: float
    pitch_kp: float
    pitch_ki: float
    pitch_rate_kp: float
    lift_elevator: float
    altitude_kp: float
    altitude_ki: float
    climb_kp: float
    lift_pitch: float
    trim_airspeed: float
    altitude_error_max: float
    pitch_min: float
    pitch_max: float
    airspeed_kp: float
    airspeed_ki: float
    energy_kp: float
    bank_max: float
    elevator_max: float
    aileron_max: float
    rudder_max: float


UNITS = loops.UNITS | {
    "guidance_period": "s",
    "bank_lag": "s",
    "track_scale": "m",
    "heading_scale": "rad",
    "rate_scale": "rad/s",
    "yaw_rate_kp": "rad/(rad/s)",
    "elevator_max": "rad",
    "aileron_max": "rad",
    "rudder_max": "rad",
}


class Command(NamedTuple):
    """elevator, ailerons (trailing edge down), rudder (trailing edge left): rad. throttle: 0 to 1."""

    elevator: float
    aileron_left: float
    aileron_right: float
    rudder: float
    throttle: float


class State(NamedTuple):
    """bank_ref, pitch_ref: references of the inner loops at the last step, rad. The integrals hold the trim.

    yaw_rate_ref: r_0 of the last program, rad/s. wait: s until the next. rudder: trim.
    """

    bank_ref: float
    pitch_ref: float
    bank_integral: float
    pitch_integral: float
    altitude_integral: float
    airspeed_integral: float
    rudder: float
    yaw_rate_ref: float
    wait: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    return State(
        bank_ref=z.phi,
        pitch_ref=z.theta,
        bank_integral=trim.aileron_right - gains.roll_rate_kp * z.p,
        pitch_integral=trim.elevator - loops.pitch_feed(gains, z.airspeed, z),
        altitude_integral=z.theta - loops.altitude_feed(gains, z.airspeed, z),
        airspeed_integral=trim.throttle,
        rudder=trim.rudder - gains.yaw_rate_kp * _yaw_beyond_turn(z),
        yaw_rate_ref=GRAVITY * tan(z.phi) / max(z.airspeed, 1.0),
        wait=0.0,
    )


@jit
def _yaw_beyond_turn(z: Measured) -> float:
    """Yaw rate beyond that of a coordinated level turn, rad/s."""
    return z.r - GRAVITY * sin(z.phi) / maximum(z.airspeed, 1.0)


@jit
def _leg_heading(course: float, speed: float, wind_north: float, wind_east: float) -> float:
    """Heading that makes good a course in this wind, rad (held within 45 deg of it)."""
    across = -wind_north * sin(course) + wind_east * cos(course)
    s = clip(across / speed, -0.7071, 0.7071)
    return course - atan2(s, sqrt(1.0 - s * s))


@jit
def _leg_ahead(ref: Reference, z: Measured, ahead: float) -> tuple[float, float, float]:
    """North and east of a point of the leg `ahead` metres further along the path, and the leg's course."""
    if ref.lateral != TRACK:
        return z.north, z.east, ref.course
    course = atan2(ref.to_east - ref.from_east, ref.to_north - ref.from_north)
    left = (ref.to_north - z.north) * cos(course) + (ref.to_east - z.east) * sin(course)
    if ahead <= left:
        return ref.to_north, ref.to_east, course
    return ref.to_north, ref.to_east, atan2(ref.next_east - ref.to_east, ref.next_north - ref.to_north)


@jit
def predict(
    g: Gains, ref: Reference, z: Measured, last: float, Y: Array, E: Array, y: Array, e: Array
) -> None:
    """Fill the linear model: cross-track errors y + Y r and heading errors e + E r at the N period ends.

    Y, E: (N, N), row k the derivatives of error k to the yaw rates. y, e: (N,), m and rad. last: yaw rate
    before.
    """
    n, T, V = len(y), g.guidance_period, maximum(z.airspeed, 1.0)
    r_max = GRAVITY * tan(g.bank_max) / V
    wind_n, wind_e = z.velocity_north - V * cos(z.psi), z.velocity_east - V * sin(z.psi)
    ahead = T * sqrt(z.velocity_north**2 + z.velocity_east**2)
    psi, north, east, before = z.psi, z.north, z.east, last
    dn, de, dpsi, r_bar = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        point_n, point_e, course = _leg_ahead(ref, z, ahead * (k + 1))
        wanted = course if ref.lateral == HEADING else _leg_heading(course, V, wind_n, wind_e)
        # The bank follows with a lag, so that part of each period is still flown at the rate before.
        late = g.bank_lag * before
        r_bar[k] = clip((wrap(wanted - psi) - late) / (T - g.bank_lag), -r_max, r_max)
        turned = (T - g.bank_lag) * r_bar[k] + late
        vn, ve = V * cos(psi + 0.5 * turned), V * sin(psi + 0.5 * turned)
        for j in range(k + 1):
            now = T - g.bank_lag if j == k else T
            dn[j] -= T * ve * 0.5 * (dpsi[j] + now)
            de[j] += T * vn * 0.5 * (dpsi[j] + now)
            dpsi[j] = now
        psi, before = psi + turned, r_bar[k]
        north, east = north + T * (vn + wind_n), east + T * (ve + wind_e)
        s, c = sin(course), cos(course)
        y[k] = -(north - point_n) * s + (east - point_e) * c
        e[k] = wrap(psi - wanted)
        for j in range(n):
            Y[k, j] = -dn[j] * s + de[j] * c
            E[k, j] = dpsi[j]
            y[k] -= Y[k, j] * r_bar[j]
            e[k] -= E[k, j] * r_bar[j]


@jit
def guidance_qp(
    g: Gains, ref: Reference, z: Measured, last: float, H: Array, f: Array, lo: Array, hi: Array
) -> None:
    """Fill min 1/2 r'Hr + f'r, lo <= r <= hi, the program at the top. H: (N, N). f, lo, hi: (N,)."""
    n = len(f)
    w_y = 1.0 / (g.track_scale * g.track_scale) if ref.lateral == TRACK else 0.0
    w_e, w_r = 1.0 / (g.heading_scale * g.heading_scale), 1.0 / (g.rate_scale * g.rate_scale)
    Y, E, y, e = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    predict(g, ref, z, last, Y, E, y, e)
    for i in range(n):
        hi[i] = GRAVITY * tan(g.bank_max) / maximum(z.airspeed, 1.0)
        lo[i] = -hi[i]
        f[i] = 0.0
        for j in range(n):
            H[i, j] = 0.0
            for k in range(n):
                H[i, j] += w_y * Y[k, i] * Y[k, j] + w_e * E[k, i] * E[k, j]
        for k in range(n):
            f[i] += w_y * Y[k, i] * y[k] + w_e * E[k, i] * e[k]
        H[i, i] += w_r
        if i > 0:
            H[i - 1, i - 1] += w_r
            H[i, i - 1] -= w_r
            H[i - 1, i] -= w_r
    f[0] -= w_r * last


@jit
def guide(g: Gains, ref: Reference, z: Measured, last: float) -> float:
    """The yaw-rate command, rad/s: r_0 of the program, or of the best feasible point if steps ran out."""
    H, f, r = np.zeros((HORIZON, HORIZON)), np.zeros(HORIZON), np.zeros(HORIZON)
    lo, hi = np.zeros(HORIZON), np.zeros(HORIZON)
    guidance_qp(g, ref, z, last, H, f, lo, hi)
    solve_box_qp(H, f, lo, hi, r)
    return r[0]


@jit
def _bank_reference(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[float, float, float]:
    """(bank reference, yaw-rate command, wait):

    the guidance at its own period, at once after a spell of BANK.
    """
    if ref.lateral == BANK:
        bank = clip(ref.bank, -g.bank_max, g.bank_max)
        return bank, GRAVITY * tan(bank) / maximum(z.airspeed, 1.0), 0.0
    yaw_rate, wait = s.yaw_rate_ref, s.wait
    if wait < 0.5 * dt:
        yaw_rate, wait = guide(g, ref, z, s.yaw_rate_ref), g.guidance_period
    bank = atan2(z.airspeed * yaw_rate, GRAVITY)
    return clip(bank, -g.bank_max, g.bank_max), yaw_rate, wait - dt


@control.register(Gains)
@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    phi_ref, yaw_rate, wait = _bank_reference(g, s, ref, z, dt)
    ih, theta_ref = altitude_hold(g, s.altitude_integral, z.altitude, ref, z, dt)
    it, de = pitch_hold(g, s.pitch_integral, theta_ref, ref, z, -g.elevator_max, g.elevator_max, dt)
    ib, da = bank_hold(g, s.bank_integral, phi_ref, z.phi, z.p, g.aileron_max, dt)
    dr = clip(s.rudder + g.yaw_rate_kp * _yaw_beyond_turn(z), -g.rudder_max, g.rudder_max)
    iv, throttle = airspeed_hold(g, s.airspeed_integral, z.airspeed, z.altitude, ref, dt)
    return (
        State(phi_ref, theta_ref, ib, it, ih, iv, s.rudder, yaw_rate, wait),
        Command(de, -da, da, dr, throttle),
    )
