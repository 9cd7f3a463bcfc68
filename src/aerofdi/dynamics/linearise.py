"""Linear models of the plant about a trim, named; modes; grids over airspeed.

States   u v w p q r phi theta psi north east altitude engine fuel (Euler angles instead of the quaternion)
Inputs   any surface, any classic command (elevator, aileron, rudder, flap; moves its surfaces as the aircraft
         file says), throttle, wind_north wind_east wind_down, gust_u gust_v gust_w gust_p gust_q gust_r (the
         air's velocity and rotation), lift_left lift_right drag_left drag_right icing thrust (effects of faults)
Outputs  any state, airspeed alpha beta ax ay az climb_rate groundspeed
A model of fewer states is cut out of the full one: the others stay at trim.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.ops import cos, tan
from .build import plant_params, surfaces_tuple
from .plant import PlantParams, derivative, outputs
from .rigid_body import quaternion
from .trim import Trim, trim
from .types import HEALTHY_EFFECTS, STILL_AIR, Effects, State, Wind

STATES = {
    "u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s",
    "phi": "rad", "theta": "rad", "psi": "rad", "north": "m", "east": "m", "altitude": "m", "engine": "1", "fuel": "kg",
}  # fmt: skip
COMMANDS = ("elevator", "aileron", "rudder", "flap")
_WIND = {"wind_north": "north", "wind_east": "east", "wind_down": "down"} | {f"gust_{c}": c for c in "uvwpqr"}
OUTPUTS = {
    "airspeed": "m/s", "alpha": "rad", "beta": "rad", "ax": "m/s2", "ay": "m/s2", "az": "m/s2",
    "climb_rate": "m/s", "groundspeed": "m/s",
}  # fmt: skip

LONGITUDINAL = ("u", "w", "q", "theta")
LATERAL = ("v", "p", "r", "phi")


class LinearModel(NamedTuple):
    """x' = A x + B u, y = C x + D u, deviations from trim.

    A (nx, nx), B (nx, nu), C (ny, nx), D (ny, nu); names and units of states, inputs and outputs in order.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    trim: Trim

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearModel:
        """The model with fewer states, inputs and outputs, in the order asked for; left-out states stay at trim."""
        s = _places(self.states, states, "state")
        i = _places(self.inputs, inputs, "input")
        o = _places(self.outputs, outputs, "output")

        def take(names: tuple[str, ...], places: list[int]) -> tuple[str, ...]:
            return tuple(names[k] for k in places)

        return LinearModel(
            A=self.A[np.ix_(s, s)],
            B=self.B[np.ix_(s, i)],
            C=self.C[np.ix_(o, s)],
            D=self.D[np.ix_(o, i)],
            states=take(self.states, s),
            inputs=take(self.inputs, i),
            outputs=take(self.outputs, o),
            state_units=take(self.state_units, s),
            input_units=take(self.input_units, i),
            output_units=take(self.output_units, o),
            trim=self.trim,
        )


class LPVGrid(NamedTuple):
    """The same model at several airspeeds: A (n, nx, nx), B (n, nx, nu), C (n, ny, nx), D (n, ny, nu).

    airspeeds (n,) m/s, rising; rate_bounds: lowest and highest airspeed rate, m/s2.
    """

    airspeeds: Array
    rate_bounds: tuple[float, float]
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    trims: tuple[Trim, ...]


class Mode(NamedTuple):
    """One natural mode. eigenvalue rad/s (the upper of a pair), wn rad/s, zeta (below 0 where unstable)."""

    name: str
    eigenvalue: complex
    wn: float
    zeta: float


def _places(have: tuple[str, ...], want: Sequence[str] | None, what: str) -> list[int]:
    if want is None:
        return list(range(len(have)))
    for name in want:
        if name not in have:
            raise WrongUse(f"{what} {name!r} is not in the model; it has {', '.join(have)}")
    return [have.index(name) for name in want]


def linearise(
    aircraft: Aircraft,
    condition: Trim | float | None = None,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    steps: Mapping[str, float] | None = None,
    params: PlantParams | None = None,
) -> LinearModel:
    """The linear model about a Trim, or about level flight at an airspeed in m/s (the reference airspeed if None).

    states: of STATES, all but psi, north, east, fuel unless given. inputs: see the top of this file; surfaces and
    throttle unless given. outputs: of STATES and OUTPUTS; the states unless given.
    steps: name -> amplitude, for slopes of a chord instead of a tangent: with tables, whose slope jumps at every
    entry, the chord over the usual amplitude is the better model.

    >>> from aerofdi.aircraft import load_aircraft
    >>> m = linearise(load_aircraft("vireo"), 15.4, states=["q", "w"], inputs=["elevator"])
    >>> [round(float(x), 2) for x in m.A.ravel()]
    [-5.49, -12.86, 13.85, -5.69]
    """
    params = plant_params(aircraft) if params is None else params
    if not isinstance(condition, Trim):
        condition = trim(aircraft, condition, params=params)
    states = tuple(states or (s for s in STATES if s not in ("psi", "north", "east", "fuel")))
    inputs = tuple(inputs or (*(s.name for s in aircraft.surfaces), "throttle"))
    outputs_ = tuple(outputs or states)
    _places(tuple(STATES), states, "state")
    _places((*STATES, *OUTPUTS), outputs_, "output")
    point = _Point(aircraft, params, condition)
    steps = steps or {}
    _places((*states, *inputs), tuple(steps), "state or input of steps")
    A, C = point.columns({s: point.state_direction(s) for s in states}, steps, states, outputs_)
    B, D = point.columns({i: point.input_direction(i) for i in inputs}, steps, states, outputs_)
    units = STATES | OUTPUTS
    return LinearModel(
        A, B, C, D, states, inputs, outputs_,
        tuple(units[s] for s in states),
        tuple(_input_unit(aircraft, name) for name in inputs),
        tuple(units[o] for o in outputs_),
        condition,
    )  # fmt: skip


def _input_unit(aircraft: Aircraft, name: str) -> str:
    if name in COMMANDS or any(s.name == name for s in aircraft.surfaces):
        return "rad"
    if name in _WIND:
        return "rad/s" if name in ("gust_p", "gust_q", "gust_r") else "m/s"
    return "1"


class _Point(NamedTuple):
    """The plant around one trim as functions of a flat vector: 14 states, surfaces, throttle, wind, effects."""

    aircraft: Aircraft
    params: PlantParams
    trim: Trim

    def start(self) -> Array:
        t, s = self.trim, self.trim.state
        x = [s.u, s.v, s.w, s.p, s.q, s.r, t.phi, t.theta, 0.0, s.north, s.east, -s.down, s.engine, s.fuel]
        return np.array([*x, *t.surfaces, t.throttle, *STILL_AIR, *HEALTHY_EFFECTS])

    def _direction(self, place: int, size: float) -> tuple[Array, float]:
        d = np.zeros(14 + 8 + 1 + len(Wind._fields) + len(Effects._fields))
        d[place] = 1.0
        return d, size

    def state_direction(self, name: str) -> tuple[Array, float]:
        """Unit vector along a state and the size of its difference step."""
        size = {
            "u": 1e-3,
            "v": 1e-3,
            "w": 1e-3,
            "north": 1.0,
            "east": 1.0,
            "altitude": 1.0,
            "fuel": 1e-3,
        }.get(name, 1e-5)
        if name == "engine" and self.trim.state.engine > 1.0:
            size = 1e-5 * self.trim.state.engine
        return self._direction(list(STATES).index(name), size)

    def input_direction(self, name: str) -> tuple[Array, float]:
        """The same along an input; a classic command moves its surfaces together."""
        mixed = [s.command.get(name, 0.0) for s in self.aircraft.surfaces]
        surface = [s.name for s in self.aircraft.surfaces]
        d, _ = self._direction(0, 0.0)
        d[0] = 0.0
        if name in COMMANDS and any(mixed):
            d[14 : 14 + len(mixed)] = mixed
            return d, 1e-5
        if name in surface:
            return self._direction(14 + surface.index(name), 1e-5)
        if name == "throttle":
            return self._direction(22, 1e-5)
        if name in _WIND:
            step = 1e-5 if name[-2:] in ("_p", "_q", "_r") else 1e-3
            return self._direction(23 + Wind._fields.index(_WIND[name]), step)
        if name in Effects._fields:
            return self._direction(23 + len(Wind._fields) + Effects._fields.index(name), 1e-4)
        raise WrongUse(
            f"input {name!r} is not known for aircraft {self.aircraft.name!r}; known are "
            f"{', '.join((*COMMANDS, *surface, 'throttle', *_WIND, *Effects._fields))}"
        )

    def evaluate(self, x: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Rates of the states, and all outputs."""
        phi, theta, psi = (float(v) for v in x[6:9])
        e = quaternion(phi, theta, psi)
        u, v, w, p, q, r = (float(a) for a in x[:6])
        s = State(float(x[9]), float(x[10]), -float(x[11]), u, v, w, *e, p, q, r, float(x[12]), float(x[13]))
        wind, effects = Wind(*x[23:32].tolist()), Effects(*x[32:38].tolist())
        k = derivative(self.params, s, surfaces_tuple(x[14:22]), float(x[22]), wind, effects)
        y = outputs(self.params, s, k, wind)._asdict()
        sf, cf = np.sin(phi), cos(phi)
        rates = {
            "u": k.u, "v": k.v, "w": k.w, "p": k.p, "q": k.q, "r": k.r,
            "phi": p + tan(theta) * (q * sf + r * cf),
            "theta": q * cf - r * sf,
            "psi": (q * sf + r * cf) / cos(theta),
            "north": k.north, "east": k.east, "altitude": -k.down, "engine": k.engine, "fuel": k.fuel,
        }  # fmt: skip
        now = dict(
            zip(STATES, (u, v, w, p, q, r, phi, theta, psi, x[9], x[10], x[11], x[12], x[13]), strict=True)
        )
        return rates, {**y, **now}

    def columns(
        self,
        directions: Mapping[str, tuple[Array, float]],
        steps: Mapping[str, float],
        states: Sequence[str],
        outputs_: Sequence[str],
    ) -> tuple[Array, Array]:
        """Slopes of state rates and outputs along each direction: of the chord where a step is given, else of the
        tangent by central differences of fourth order."""
        x0 = self.start()
        rates = np.zeros((len(states), len(directions)))
        measured = np.zeros((len(outputs_), len(directions)))
        for j, (name, (d, tangent)) in enumerate(directions.items()):
            h = steps.get(name, tangent)
            for n, weight in ((1, 0.5),) if name in steps else ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
                plus, minus = self.evaluate(x0 + n * h * d), self.evaluate(x0 - n * h * d)
                rates[:, j] += [weight / h * (plus[0][s] - minus[0][s]) for s in states]
                measured[:, j] += [weight / h * (plus[1][o] - minus[1][o]) for o in outputs_]
        return rates, measured


def lpv_grid(
    aircraft: Aircraft,
    airspeeds: Sequence[float] | Array,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    altitude: float | None = None,
    rate_bounds: tuple[float, float] | None = None,
) -> LPVGrid:
    """The same model linearised in level flight at each airspeed (m/s).

    rate_bounds of the airspeed in m/s2; plus and minus `envelope.airspeed_rate` of the aircraft file unless given.
    """
    speeds = np.asarray(airspeeds, float)
    if speeds.ndim != 1 or not len(speeds) or (np.diff(speeds) <= 0.0).any():
        raise WrongUse(f"airspeeds must be a list that rises, got {speeds.tolist()}")
    if rate_bounds is None:
        rate = aircraft.number("envelope.airspeed_rate")
        rate_bounds = (-rate, rate)
    params = plant_params(aircraft)
    models = [
        linearise(
            aircraft,
            trim(aircraft, float(V), altitude, params=params),
            states=states,
            inputs=inputs,
            outputs=outputs,
            params=params,
        )
        for V in speeds
    ]
    first = models[0]
    return LPVGrid(
        airspeeds=speeds,
        rate_bounds=rate_bounds,
        A=np.array([m.A for m in models]),
        B=np.array([m.B for m in models]),
        C=np.array([m.C for m in models]),
        D=np.array([m.D for m in models]),
        states=first.states,
        inputs=first.inputs,
        outputs=first.outputs,
        state_units=first.state_units,
        input_units=first.input_units,
        output_units=first.output_units,
        trims=tuple(m.trim for m in models),
    )


def _mode(name: str, eigenvalue: complex) -> Mode:
    wn = abs(eigenvalue)
    return Mode(name, complex(eigenvalue), float(wn), float(-eigenvalue.real / wn) if wn > 0.0 else 0.0)


def _upper(A: Array) -> list[complex]:
    """Eigenvalues with one of each complex pair, fastest first."""
    found = [complex(e) for e in np.linalg.eigvals(A) if e.imag >= 0.0]
    return sorted(found, key=abs, reverse=True)


def longitudinal_modes(A: Array) -> list[Mode]:
    """Modes of A over (u, w, q, theta): the faster pair is the short period, the slower the phugoid."""
    values = _upper(A)
    if len(values) == 2:
        return [_mode("short period", values[0]), _mode("phugoid", values[1])]
    pairs = [v for v in values if v.imag > 0.0]
    short = values[: 1 if pairs and values[0] is pairs[0] else 2]
    names = ["short period" if v in short else "phugoid" for v in values]
    return [_mode(n, v) for n, v in zip(names, values, strict=True)]


def lateral_modes(A: Array) -> list[Mode]:
    """Modes of A over (v, p, r, phi): Dutch roll (pair), roll (fast real), spiral (slow real)."""
    values = _upper(A)
    pairs = [v for v in values if v.imag > 0.0]
    real = [v for v in values if v.imag == 0.0]
    out = []
    if len(real) == 2:
        out = [_mode("roll", real[0]), _mode("spiral", real[1])]
    elif not real:
        # Roll and spiral joined: the better damped pair is theirs.
        pairs.sort(key=lambda e: -e.real / abs(e))
        out = [_mode("Dutch roll", pairs[0]), _mode("roll-spiral", pairs[1])]
        return out
    else:
        out = [_mode("lateral", v) for v in real]
    return [*out, *(_mode("Dutch roll", v) for v in pairs)]


def modes(
    aircraft: Aircraft,
    condition: Trim | float | None = None,
    *,
    steps: Mapping[str, float] | None = None,
    params: PlantParams | None = None,
) -> list[Mode]:
    """Natural modes about a trim with throttle and engine held: longitudinal and lateral taken apart.

    condition, steps, params as in `linearise`. For banked trims the split is an approximation.
    """
    full = linearise(
        aircraft,
        condition,
        states=(*LONGITUDINAL, *LATERAL),
        inputs=("throttle",),
        steps=steps,
        params=params,
    )
    return longitudinal_modes(full.select(LONGITUDINAL).A) + lateral_modes(full.select(LATERAL).A)


__all__ = [
    "LATERAL",
    "LONGITUDINAL",
    "LPVGrid",
    "LinearModel",
    "Mode",
    "lateral_modes",
    "linearise",
    "longitudinal_modes",
    "lpv_grid",
    "modes",
]
