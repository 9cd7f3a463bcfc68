"""Steady flight: straight or turning, level or climbing, with every surface working or some stuck.

Solved for: angle of attack, sideslip, bank, pitch, throttle, engine state and the classic commands the free surfaces
still answer, so that all accelerations vanish and the path climbs at the given angle. With three independent commands
the sideslip is prescribed (zero unless given); with two it follows. With fewer, a condition must be given up: `free`,
which then takes the place of a command.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.ops import atan2, cos, pi, sin
from .build import fuel_capacity, plant_params, surfaces_tuple
from .plant import PlantParams, derivative
from .propulsion import ActuatorDisc, ThrustLaw
from .rigid_body import quaternion, to_body
from .types import HEALTHY_EFFECTS, STILL_AIR, Effects, State, Surfaces, Wind

TOLERANCE = 1e-8
FREE = ("airspeed", "turn_rate", "climb_angle")


class NoTrim(WrongUse):
    """No steady flight meets the conditions within the limits of surfaces, throttle and envelope."""


class Trim(NamedTuple):
    """A steady flight condition, heading north in still air; `placed` puts it elsewhere.

    surfaces: deflections in the aircraft's order, filled up with zeros, rad. commands: classic command -> rad.
    airspeed m/s, altitude m, climb_angle, alpha, beta, phi, theta rad, turn_rate rad/s.
    residual: largest remaining acceleration, m/s2 or rad/s2.
    """

    state: State
    surfaces: Surfaces
    throttle: float
    commands: dict[str, float]
    airspeed: float
    altitude: float
    climb_angle: float
    turn_rate: float
    alpha: float
    beta: float
    phi: float
    theta: float
    residual: float

    def placed(
        self, north: float = 0.0, east: float = 0.0, heading: float = 0.0, wind: Wind = STILL_AIR
    ) -> State:
        """The trimmed state at a place and heading (rad) in a wind; the flight through the air is the same."""
        e = quaternion(self.phi, self.theta, heading)
        u, v, w = to_body(*e, wind.north, wind.east, wind.down)
        s = self.state
        return s._replace(
            north=north, east=east, u=s.u + u, v=s.v + v, w=s.w + w, e0=e[0], e1=e[1], e2=e[2], e3=e[3]
        )


class _Unknown(NamedTuple):
    name: str
    start: float
    low: float
    high: float


def mixing(aircraft: Aircraft, stuck: Mapping[str, float]) -> tuple[Array, Array, list[str]]:
    """Deflections = base + matrix @ commands, with only independent commands of the free surfaces kept."""
    base = np.zeros(len(aircraft.surfaces))
    names = [c for c in ("elevator", "aileron", "rudder") if any(c in s.command for s in aircraft.surfaces)]
    matrix = np.array([[s.command.get(c, 0.0) for c in names] for s in aircraft.surfaces])
    for name, angle in stuck.items():
        base[aircraft.surface_index(name)] = angle
        matrix[aircraft.surface_index(name)] = 0.0
    keep: list[int] = []
    for j in range(len(names)):
        if np.linalg.matrix_rank(matrix[:, [*keep, j]], tol=1e-9) > len(keep):
            keep.append(j)
    return base, matrix[:, keep], [names[j] for j in keep]


def _engine_guess(params: PlantParams) -> tuple[float, float, float] | None:
    """Start, low and high of the engine state; None where the kind has none."""
    prop = params.body.propulsion
    if isinstance(prop, ActuatorDisc):
        return None
    if isinstance(prop, ThrustLaw):
        return 0.5, 0.0, 1.0
    top = float(prop.speed[-1]) if hasattr(prop, "speed") else prop.max_speed
    return 0.6 * top, 0.02 * top, 1.5 * top


def _unknowns(
    aircraft: Aircraft,
    params: PlantParams,
    fixed: Mapping[str, float | None],
    commands: list[str],
    free: tuple[str, ...],
) -> list[_Unknown]:
    """What to solve for, in order, with starting values and bounds."""
    guess = fixed["airspeed"] or aircraft.number("reference.airspeed")
    low = aircraft.number("envelope.min_alpha", -0.35)
    high = aircraft.number("envelope.max_alpha", 0.45)
    max_beta = aircraft.number("envelope.max_beta", 0.35)
    out = [
        _Unknown("alpha", 0.5 * max(low, 0.0) + 0.06, low, high),
        _Unknown("theta", 0.06 + (fixed["climb_angle"] or 0.0), -1.4, 1.4),
        _Unknown("throttle", 0.4, 0.0, 1.0),
    ]
    if fixed["bank"] is None:
        turn = fixed["turn_rate"] or 0.0
        out.append(_Unknown("phi", atan2(turn * guess, params.body.air.gravity), -1.4, 1.4))
    if fixed["sideslip"] is None:
        out.append(_Unknown("beta", 0.0, -max_beta, max_beta))
    engine = _engine_guess(params)
    if engine:
        out.append(_Unknown("engine", *engine))
    out += [_Unknown(c, 0.0, -1.5, 1.5) for c in commands]
    if "airspeed" in free:
        lo, hi = aircraft.number("envelope.min_airspeed"), aircraft.number("envelope.max_airspeed")
        out.append(_Unknown("airspeed", min(max(guess, lo), hi), lo, hi))
    if "turn_rate" in free or fixed["bank"] is not None:
        bank = fixed["bank"] or 0.0
        out.append(_Unknown("turn_rate", params.body.air.gravity * sin(bank) / cos(bank) / guess, -3.0, 3.0))
    if "climb_angle" in free:
        out.append(_Unknown("climb_angle", 0.0, -0.6, 0.6))
    return out


def _condition(value: Mapping[str, float], altitude: float, fuel: float) -> tuple[State, tuple[float, ...]]:
    """The state of a set of values, and its Euler angles."""
    V, alpha, beta = value["airspeed"], value["alpha"], value["beta"]
    phi, theta, turn = value["phi"], value["theta"], value["turn_rate"]
    e = quaternion(phi, theta, 0.0)
    state = State(
        0.0, 0.0, -altitude,
        V * cos(alpha) * cos(beta), V * sin(beta), V * sin(alpha) * cos(beta),
        *e,
        -turn * sin(theta), turn * sin(phi) * cos(theta), turn * cos(phi) * cos(theta),
        value["engine"], fuel,
    )  # fmt: skip
    return state, (phi, theta)


def trim(
    aircraft: Aircraft,
    airspeed: float | None = None,
    altitude: float | None = None,
    *,
    climb_angle: float = 0.0,
    turn_rate: float = 0.0,
    bank: float | None = None,
    sideslip: float | None = None,
    stuck: Mapping[str, float] | None = None,
    fuel: float | None = None,
    effects: Effects = HEALTHY_EFFECTS,
    free: tuple[str, ...] = (),
    params: PlantParams | None = None,
) -> Trim:
    """Steady flight at an airspeed (m/s) and altitude (m), in still air.

    climb_angle of the path and bank in rad, turn_rate in rad/s (give bank or turn_rate). stuck: surface -> angle in
    rad that it keeps. fuel: kg, a full tank unless given. free: conditions to give up where the remaining commands
    cannot meet all of them, of "airspeed" (then anywhere in the envelope), "turn_rate", "climb_angle".
    params: the plant's parameters, made from the aircraft unless given.

    Raises NoTrim where no such flight exists within the limits, naming the limit; WrongUse for too few commands.

    >>> from aerofdi.aircraft import load_aircraft
    >>> round(trim(load_aircraft("vireo"), 15.4).alpha * 57.29578, 3)
    3.907
    """
    params = plant_params(aircraft) if params is None else params
    _check_free(free, bank, turn_rate)
    stuck = stuck or {}
    base, matrix, commands = mixing(aircraft, stuck)
    fixed = {
        "airspeed": airspeed or aircraft.number("reference.airspeed"),
        "climb_angle": climb_angle,
        "turn_rate": turn_rate,
        "bank": bank,
        # Three commands, or two and a condition given up, leave the sideslip to choose.
        "sideslip": (sideslip or 0.0) if len(commands) + len(free) > 2 else None,
    }
    _check_count(aircraft, stuck, commands, free, sideslip)
    h = aircraft.number("reference.altitude") if altitude is None else altitude
    unknowns = _unknowns(aircraft, params, fixed, commands, free)
    known = {k: float(v) for k, v in fixed.items() if v is not None}
    known |= {"phi": known.pop("bank", 0.0), "beta": known.pop("sideslip", 0.0), "engine": 0.0}
    problem = _Problem(
        params,
        unknowns,
        known,
        h,
        fuel_capacity(aircraft) if fuel is None else fuel,
        base,
        matrix,
        commands,
        effects,
    )
    return problem.solve(aircraft, free)


def _check_free(free: tuple[str, ...], bank: float | None, turn_rate: float) -> None:
    for name in free:
        if name not in FREE:
            raise WrongUse(f"free has {name!r}; accepted: {', '.join(FREE)}")
    if bank is not None and (turn_rate != 0.0 or "turn_rate" in free):
        raise WrongUse("give bank or turn_rate, not both: the other follows")


def _check_count(
    aircraft: Aircraft,
    stuck: Mapping[str, float],
    commands: list[str],
    free: tuple[str, ...],
    sideslip: float | None,
) -> None:
    """As many unknowns as equations, sideslip counted where it is not prescribed."""
    who = f"aircraft {aircraft.name!r}"
    freedom = len(commands) + len(free)
    if freedom < 2:
        raise WrongUse(
            f"{who}: with {sorted(stuck)} stuck only the commands {commands} remain, too few to hold every condition; "
            f"free one of {', '.join(FREE)}"
        )
    if freedom > 3:
        raise WrongUse(
            f"{who}: the commands {commands} hold every condition; free must be shorter than {free}"
        )
    if freedom == 2 and sideslip:
        raise WrongUse(f"{who}: sideslip cannot be chosen with only the commands {commands}")


class _Problem(NamedTuple):
    """One trim: residuals of the equations as a function of the unknowns."""

    params: PlantParams
    unknowns: list[_Unknown]
    known: dict[str, float]
    altitude: float
    fuel: float
    base: Array
    matrix: Array
    commands: list[str]
    effects: Effects

    def values(self, x: Array) -> dict[str, float]:
        return self.known | {u.name: float(v) for u, v in zip(self.unknowns, x, strict=True)}

    def deflections(self, value: Mapping[str, float]) -> Array:
        return self.base + self.matrix @ np.array([value[c] for c in self.commands])

    def residual(self, x: Array) -> Array:
        value = self.values(x)
        state, _ = _condition(value, self.altitude, self.fuel)
        d = surfaces_tuple(self.deflections(value))
        k = derivative(self.params, state, d, value["throttle"], STILL_AIR, self.effects)
        climb = -k.down - value["airspeed"] * sin(value["climb_angle"])
        out = [k.u, k.v, k.w, k.p, k.q, k.r, climb]
        if any(u.name == "engine" for u in self.unknowns):
            # An engine speed answers in hundreds of rad/s per s; keep it in proportion.
            out.append(k.engine / max(1.0, abs(value["engine"])))
        return np.array(out)

    def solve(self, aircraft: Aircraft, free: tuple[str, ...]) -> Trim:
        from scipy.optimize import least_squares

        low, high = (np.array([getattr(u, k) for u in self.unknowns]) for k in ("low", "high"))
        start = np.clip([u.start for u in self.unknowns], low + 1e-9, high - 1e-9)
        scale = np.array([max(abs(u.start), 0.1) for u in self.unknowns])
        best = None
        for nudge in (0.0, 0.1, -0.1):
            x0 = np.clip(start + nudge * scale, low + 1e-9, high - 1e-9)
            found = least_squares(
                self.residual,
                x0,
                bounds=(low, high),
                x_scale=scale,
                jac="3-point",
                xtol=1e-15,
                ftol=1e-15,
                gtol=1e-15,
                # Where there is a trim a dozen steps find it; where there is none the search need not be long.
                max_nfev=40,
            )
            polished = self._newton(found.x, low, high, scale)
            size = float(np.abs(self.residual(polished)).max())
            if best is None or size < best[0]:
                best = (size, polished)
            if size < TOLERANCE:
                break
        assert best is not None
        if (
            free
            and best[0] < TOLERANCE
            and np.linalg.matrix_rank(self.slopes(best[1], scale), tol=1e-6) < len(scale)
        ):
            raise WrongUse(
                f"aircraft {aircraft.name!r}: the commands {self.commands} hold every condition, so freeing "
                f"{', '.join(free)} leaves the flight undetermined"
            )
        return self._result(aircraft, *best)

    def slopes(self, x: Array, scale: Array) -> Array:
        """Derivatives of the residual to the unknowns, each over its scale."""
        columns = []
        for j in range(len(x)):
            step = np.zeros(len(x))
            step[j] = 1e-6 * scale[j]
            columns.append((self.residual(x + step) - self.residual(x - step)) / 2e-6)
        return np.array(columns).T

    def _newton(self, x: Array, low: Array, high: Array, scale: Array) -> Array:
        """A few full Newton steps: a bounded least-squares solver stops short of the last digits."""
        for _ in range(4):
            r = self.residual(x)
            change = scale * np.linalg.lstsq(self.slopes(x, scale), r, rcond=None)[0]
            new = np.clip(x - change, low, high)
            if not np.abs(self.residual(new)).max() < np.abs(r).max():
                return x
            x = new
        return x

    def _result(self, aircraft: Aircraft, size: float, x: Array) -> Trim:
        value = self.values(x)
        deflections = self.deflections(value)
        over = [
            f"{s.name} {d * 180 / pi:.2f} deg outside [{s.lower * 180 / pi:.1f}, {s.upper * 180 / pi:.1f}]"
            for s, d in zip(aircraft.surfaces, deflections, strict=True)
            if not s.lower - 1e-9 <= d <= s.upper + 1e-9
        ]
        at = [
            f"{u.name} at its limit {v:.4g}"
            for u, v in zip(self.unknowns, x, strict=True)
            if min(v - u.low, u.high - v) < 1e-6 * (u.high - u.low)
        ]
        if size > TOLERANCE or over:
            raise NoTrim(
                f"aircraft {aircraft.name!r}: no steady flight at {value['airspeed']:.2f} m/s, {self.altitude:.0f} m, "
                f"climb {value['climb_angle']:.3f} rad, turn {value['turn_rate']:.3f} rad/s: "
                f"{'; '.join(over + at) or f'remaining acceleration {size:.2g}'}"
            )
        state, (phi, theta) = _condition(value, self.altitude, self.fuel)
        return Trim(
            state, surfaces_tuple(deflections), value["throttle"], {c: value[c] for c in self.commands},
            value["airspeed"], self.altitude, value["climb_angle"], value["turn_rate"],
            value["alpha"], value["beta"], phi, theta, size,
        )  # fmt: skip
