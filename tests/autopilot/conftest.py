"""The closed loop as a linear one, from the controllers' own code: nothing here knows a control law."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from aerofdi.aircraft import Aircraft, load_aircraft
from aerofdi.autopilot import HEADING, Autopilot, Measured, Reference, autopilot_of
from aerofdi.dynamics.linearise import LinearModel, linearise
from aerofdi.dynamics.trim import Trim, trim

PAIRS = {
    "vireo": "vireo",
    "ultrastick": "ultrastick120",
    "aerosonde": "aerosonde",
    "aerosim_mpc": "aerosonde_aerosim",
    "ducard": "ducard",
}
SEEN = ("p", "q", "r", "phi", "theta", "psi", "airspeed", "alpha", "beta", "altitude", "climb_rate")
CLASSIC = ("elevator", "aileron", "rudder")


class Margins(NamedTuple):
    """Of one loop: gain margins upwards and downwards in dB, phase margin in deg, max |S|, gain crossover rad/s."""

    gain_up: float
    gain_down: float
    phase: float
    peak: float
    crossover: float


class Discrete(NamedTuple):
    """x' = A x + B z, u = C x + D z at the control period: a controller linearised about trim."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


def trimmed_measurement(t: Trim) -> Measured:
    return Measured(
        0.0, 0.0, 0.0, t.phi, t.theta, 0.0, t.airspeed, t.alpha, t.beta, t.altitude,
        0.0, 0.0, 0.0, t.airspeed, 0.0,
    )  # fmt: skip


def trimmed_command(aircraft: Aircraft, pilot: Autopilot, t: Trim) -> Any:
    names = [s.name for s in aircraft.surfaces]
    values = {n: float(t.surfaces[names.index(n)]) for n in pilot.module.Command._fields if n != "throttle"}
    return pilot.module.Command(throttle=float(t.throttle), **values)


def level(z: Measured, lateral: int = HEADING) -> Reference:
    return Reference(z.airspeed, z.altitude, lateral, z.phi, z.psi, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def linear_controller(pilot: Autopilot, command: Any, z: Measured, lateral: int = HEADING) -> Discrete:
    """Central differences of the step function about trim."""
    module, dt = pilot.module, 1.0 / pilot.module.RATE_HZ
    ref, start = level(z, lateral), module.init(pilot.gains, command, z)
    nx, nz = len(start), len(SEEN)

    def f(x: np.ndarray, dz: np.ndarray) -> np.ndarray:
        seen = z._replace(**{n: getattr(z, n) + float(d) for n, d in zip(SEEN, dz, strict=True)})
        state, out = module.step(pilot.gains, module.State(*map(float, x)), ref, seen, dt)
        return np.array([*state, *out])

    x0, h = np.array([float(v) for v in start]), 1e-6
    columns = []
    for i in range(nx + nz):
        d = np.zeros(nx + nz)
        d[i] = h
        columns.append((f(x0 + d[:nx], d[nx:]) - f(x0 - d[:nx], -d[nx:])) / (2.0 * h))
    J = np.array(columns).T
    return Discrete(J[:nx, :nx], J[:nx, nx:], J[nx:, :nx], J[nx:, nx:])


def servo(aircraft: Aircraft, name: str, s: np.ndarray) -> np.ndarray:
    """Frequency response of an actuator with its delay."""
    if name == "throttle":
        return np.ones_like(s)
    a = aircraft.surface(name)
    w = a.bandwidth
    lag = w * w / (s * s + 2.0 * a.damping * w * s + w * w) if a.actuator == "second_order" else w / (s + w)
    return lag * np.exp(-a.delay * s)


class Loop:
    """An aircraft with its autopilot, linear about level flight."""

    def __init__(self, name: str, airspeed: float | None = None, variant: str = "", **trimming: Any):
        self.aircraft = load_aircraft(PAIRS[name])
        self.pilot = autopilot_of(self.aircraft.autopilot, variant=variant, who=name)
        speed = airspeed or self.aircraft.number("reference.airspeed")
        self.trim = trim(self.aircraft, speed, self.aircraft.number("reference.altitude"), **trimming)
        self.z = trimmed_measurement(self.trim)
        self.command = trimmed_command(self.aircraft, self.pilot, self.trim)
        self.dt = 1.0 / self.pilot.module.RATE_HZ

    def model(self, **options: Any) -> LinearModel:
        states = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "altitude", "engine")
        commands = (*self.pilot.module.Command._fields,)
        return linearise(self.aircraft, self.trim, states=states, inputs=commands, outputs=SEEN, **options)

    def response(
        self, w: np.ndarray, lateral: int = HEADING, **options: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """(G, K): sensors from commands with servos, delays and the hold; commands from sensors. (n, ny, nu)."""
        m, c = self.model(**options), linear_controller(self.pilot, self.command, self.z, lateral)
        s = 1j * w
        A, B, C, D = (np.asarray(a) for a in (m.A, m.B, m.C, m.D))
        G = (
            C @ np.linalg.solve(s[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(w), *B.shape)))
            + D
        )
        hold = (1.0 - np.exp(-s * self.dt)) / (s * self.dt)
        G = G * np.stack([servo(self.aircraft, n, s) * hold for n in m.inputs], axis=1)[:, None, :]
        z = np.exp(s * self.dt)
        rhs = np.broadcast_to(c.B, (len(w), *c.B.shape))
        K = c.C @ np.linalg.solve(z[:, None, None] * np.eye(len(c.A)) - c.A, rhs) + c.D
        return G, K

    def loops(self, names: tuple[str, ...], **options: Any) -> dict[str, Margins]:
        """Each of the named classic commands broken in turn, the others and the throttle closed."""
        w = np.logspace(-2.3, np.log10(0.98 * np.pi / self.dt), 4000)
        G, K = self.response(w, **options)
        fields = self.pilot.module.Command._fields
        columns = []
        for n in names:
            if n == "throttle":
                columns.append([float(f == "throttle") for f in fields])
            else:
                columns.append(
                    [0.0 if f == "throttle" else self.aircraft.surface(f).command.get(n, 0.0) for f in fields]
                )
        mix = np.array(columns).T
        L = -np.linalg.pinv(mix) @ K @ G @ mix
        full = np.linalg.det(np.eye(len(names)) + L)
        out = {}
        for i, n in enumerate(names):
            rest = [j for j in range(len(names)) if j != i]
            others = np.linalg.det((np.eye(len(names)) + L)[:, rest][:, :, rest]) if rest else 1.0
            out[n] = margins(w, full / others - 1.0)
        return out

    def bandwidth(self, reference: str, output: str, lateral: int = HEADING) -> float:
        """-3 dB bandwidth of an output behind a field of the Reference, rad/s."""
        w = np.logspace(-2, 1, 600)
        G, K = self.response(w, lateral)
        module, ref, h = self.pilot.module, level(self.z, lateral), 1e-6
        start = module.init(self.pilot.gains, self.command, self.z)

        def f(d: float) -> np.ndarray:
            moved = ref._replace(**{reference: getattr(ref, reference) + d})
            state, out = module.step(self.pilot.gains, start, moved, self.z, self.dt)
            return np.array([*state, *out])

        slope = (f(h) - f(-h)) / (2.0 * h)
        bx, bu = slope[: len(start)], slope[len(start) :]
        c = linear_controller(self.pilot, self.command, self.z, lateral)
        z = np.exp(1j * w * self.dt)
        F = np.array([c.C @ np.linalg.solve(q * np.eye(len(c.A)) - c.A, bx) + bu for q in z])
        at = SEEN.index(output)
        eye = np.eye(len(SEEN))
        T = np.array([np.linalg.solve(eye - G[k] @ K[k], G[k] @ F[k])[at] for k in range(len(w))])
        return float(w[np.argmax(np.abs(T) < np.abs(T[0]) / np.sqrt(2.0))])


def margins(w: np.ndarray, L: np.ndarray) -> Margins:
    """Margins of 1 + L, from every crossing."""
    turn = np.unwrap(np.angle(L))
    cross = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1.0)))
    phase = [abs((np.degrees(turn[k]) + 180.0 + 180.0) % 360.0 - 180.0) for k in cross]
    axis = [k for k in np.flatnonzero(np.diff(np.sign(L.imag))) if L.real[k] < 0.0]
    gains = [-20.0 * np.log10(abs(L[k])) for k in axis]
    first = w[cross[np.argmin(phase)]] if phase else np.nan
    return Margins(
        min([g for g in gains if g > 0.0], default=np.inf),
        min([-g for g in gains if g < 0.0], default=np.inf),
        min(phase, default=np.inf),
        float(np.max(np.abs(1.0 / (1.0 + L)))),
        float(first),
    )


@pytest.fixture(scope="session")
def make_loop() -> Any:
    """Loop(name, airspeed, variant): built once per set of arguments."""
    built: dict[Any, Loop] = {}

    def make(name: str, airspeed: float | None = None, variant: str = "", **trimming: Any) -> Loop:
        key = (name, airspeed, variant, *sorted(trimming.items()))
        if key not in built:
            built[key] = Loop(name, airspeed, variant, **trimming)
        return built[key]

    return make


@pytest.fixture(scope="session")
def controller_of() -> Any:
    return linear_controller
