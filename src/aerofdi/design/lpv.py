"""Linear parameter-varying systems on a grid of airspeeds, small enough to read.

    x' = A(V) x + B(V) u,   y = C(V) x + D(V) u

given at nodes of V and linear in V between them. Frozen (time-invariant) systems have one node. All blocks of
one interconnection are given on the same nodes, or on one node, which then holds everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core import Array, WrongUse


class Gridded(NamedTuple):
    """A linear parameter-varying system on nodes of the airspeed.

    V: (N,) increasing, m/s. A: (N, n, n), B: (N, n, m), C: (N, p, n), D: (N, p, m). inputs: m names. outputs:
    p names.
    """

    V: Array
    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[1])

    def columns(self, names: Sequence[str]) -> list[int]:
        """Positions of the named inputs."""
        return [_index(self.inputs, name, "input") for name in names]

    def rows(self, names: Sequence[str]) -> list[int]:
        """Positions of the named outputs."""
        return [_index(self.outputs, name, "output") for name in names]

    def select(self, inputs: Sequence[str], outputs: Sequence[str]) -> Gridded:
        """The same states with only these inputs and outputs, in this order."""
        i, o = self.columns(inputs), self.rows(outputs)
        return self._replace(
            B=self.B[:, :, i],
            C=self.C[:, o],
            D=self.D[:, o][:, :, i],
            inputs=tuple(inputs),
            outputs=tuple(outputs),
        )

    def at(self, V: float | Array) -> Gridded:
        """The system at other airspeeds, matrices linear in V between nodes and held beyond the ends."""
        v = np.atleast_1d(np.asarray(V, float))
        A, B, C, D = (interpolate(self.V, m, v) for m in (self.A, self.B, self.C, self.D))
        return self._replace(V=v, A=A, B=B, C=C, D=D)


def _index(names: tuple[str, ...], name: str, what: str) -> int:
    if name not in names:
        raise WrongUse(f"no {what} {name!r}; there are {', '.join(names) or 'none'}")
    return names.index(name)


def interpolate(V: Array, table: Array, v: Array) -> Array:
    """Linear interpolation along the first axis of a table (N, ...) at v (k,), held beyond the ends: (k,
    ...).

    >>> interpolate(np.array([0.0, 1.0]), np.array([[0.0], [2.0]]), np.array([0.25, 3.0])).ravel()
    array([0.5, 2. ])
    """
    if len(V) == 1:
        return np.repeat(table, len(v), axis=0)
    k = np.clip(np.searchsorted(V, v, side="right") - 1, 0, len(V) - 2)
    w = np.clip((v - V[k]) / (V[k + 1] - V[k]), 0.0, 1.0)
    w = w.reshape(-1, *([1] * (table.ndim - 1)))
    return np.asarray((1.0 - w) * table[k] + w * table[k + 1])


def gridded(
    V: Sequence[float] | Array,
    A: Any,
    B: Any,
    C: Any,
    D: Any,
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> Gridded:
    """A system from lists or arrays; matrices without a leading node axis hold at every node.

    Raises WrongUse where shapes, names or the order of the nodes do not fit together.
    """
    v = np.atleast_1d(np.asarray(V, float))
    if v.ndim != 1 or not len(v) or np.any(np.diff(v) <= 0):
        raise WrongUse(f"airspeed nodes must increase strictly; given {v}")
    mats = []
    for matrix in (A, B, C, D):
        m = np.asarray(matrix, float)
        m = np.broadcast_to(m, (len(v), *m.shape)) if m.ndim == 2 else m
        mats.append(np.array(m))
    a, b, c, d = mats
    n, k, p = a.shape[1], len(inputs), len(outputs)
    want = [(len(v), n, n), (len(v), n, k), (len(v), p, n), (len(v), p, k)]
    if [m.shape for m in mats] != want:
        raise WrongUse(
            f"matrices of shapes {[m.shape for m in mats]} do not fit {len(v)} nodes, {k} inputs, {p} outputs"
        )
    if len(set(inputs)) != k or len(set(outputs)) != p:
        raise WrongUse(f"names repeat: inputs {tuple(inputs)}, outputs {tuple(outputs)}")
    return Gridded(v, a, b, c, d, tuple(inputs), tuple(outputs))


def transfer(num: Sequence[float], den: Sequence[float], inp: str, out: str) -> Gridded:
    """num(s)/den(s), highest power first, as a one-node system in controllable form.

    >>> g = transfer([1.0], [1.0, 2.0], "u", "y")
    >>> float(abs(response(g, [0.0])[0, 0, 0, 0]))
    0.5
    """
    d = np.trim_zeros(np.asarray(den, float), "f")
    k = np.asarray(num, float)
    n = len(d) - 1
    if n < 0 or len(k) > n + 1:
        raise WrongUse(f"{num} / {den} is not a proper transfer function")
    k = np.concatenate((np.zeros(n + 1 - len(k)), k)) / d[0]
    d = d / d[0]
    A = np.zeros((n, n))
    B = np.zeros((n, 1))
    if n:
        A[0], B[0, 0] = -d[1:], 1.0
        A[1:, :-1] = np.eye(n - 1)
    C = (k[1:] - k[0] * d[1:])[None, :]
    return gridded([0.0], A, B, C, [[k[0]]], (inp,), (out,))


def gain(out: str, terms: Mapping[str, float]) -> Gridded:
    """out = sum of coefficient * signal."""
    e = np.zeros((0, 0))
    names = tuple(terms)
    return gridded(
        [0.0], e, np.zeros((0, len(names))), np.zeros((1, 0)), [[terms[k] for k in names]], names, (out,)
    )


def _stack(blocks: Sequence[Gridded], V: Array) -> tuple[Array, Array, Array, Array]:
    """Block-diagonal matrices of all blocks over the nodes V."""
    full = [b.at(V) if len(b.V) == 1 else b for b in blocks]
    out = []
    for pick in ("A", "B", "C", "D"):
        mats = [getattr(b, pick) for b in full]
        big = np.zeros((len(V), sum(m.shape[1] for m in mats), sum(m.shape[2] for m in mats)))
        r = c = 0
        for m in mats:
            big[:, r : r + m.shape[1], c : c + m.shape[2]] = m
            r, c = r + m.shape[1], c + m.shape[2]
        out.append(big)
    return out[0], out[1], out[2], out[3]


def connect(blocks: Sequence[Gridded], inputs: Sequence[str], outputs: Sequence[str]) -> Gridded:
    """Blocks joined where an input carries the name of an output; what is left must be an external input.

    Outputs may name any block output or external input. Loops through direct terms are solved:
    with u = S y + E r and y = C x + D u it follows u = (I - S D)^-1 (S C x + E r).
    Raises WrongUse for unknown or doubly produced signals, different nodes, or an ill-posed algebraic loop.

    >>> g = transfer([1.0], [1.0, 1.0], "e", "y")
    >>> loop = connect([g, gain("e", {"r": 1.0, "y": -1.0})], ["r"], ["y"])
    >>> loop.A[0, 0, 0].item()
    -2.0
    """
    grids = [b.V for b in blocks if len(b.V) > 1]
    V = grids[0] if grids else blocks[0].V
    if any(len(g) != len(V) or not np.array_equal(g, V) for g in grids):
        raise WrongUse(
            "the blocks are given on different airspeed nodes; evaluate them at the same ones first"
        )
    A, B, C, D = _stack(blocks, V)
    made = [name for b in blocks for name in b.outputs]
    taken = [name for b in blocks for name in b.inputs]
    double = {name for name in made if made.count(name) > 1} | (set(made) & set(inputs))
    if double:
        raise WrongUse(f"signals made more than once: {', '.join(sorted(double))}")
    unknown = sorted((set(taken) | set(outputs)) - set(made) - set(inputs))
    if unknown:
        raise WrongUse(f"signals nobody makes: {', '.join(unknown)}; add a block or an external input")
    S, E = np.zeros((len(taken), len(made))), np.zeros((len(taken), len(inputs)))
    for i, name in enumerate(taken):
        if name in made:
            S[i, made.index(name)] = 1.0
        else:
            E[i, list(inputs).index(name)] = 1.0
    loop = np.eye(len(taken)) - S @ D
    if np.linalg.cond(loop).max() > 1e12:
        raise WrongUse("the interconnection has an algebraic loop without a solution")
    ux, ur = np.linalg.solve(loop, S @ C), np.linalg.solve(loop, np.broadcast_to(E, (len(V), *E.shape)))
    P, R = np.zeros((len(outputs), len(made))), np.zeros((len(outputs), len(inputs)))
    for i, name in enumerate(outputs):
        if name in made:
            P[i, made.index(name)] = 1.0
        else:
            R[i, list(inputs).index(name)] = 1.0
    return Gridded(V, A + B @ ux, B @ ur, P @ (C + D @ ux), P @ (D @ ur) + R, tuple(inputs), tuple(outputs))


def response(g: Gridded, w_rad_s: Sequence[float] | Array) -> Array:
    """Frozen frequency responses, complex (N, k, p, m) at w (k,) rad/s."""
    w = np.asarray(w_rad_s, float)
    n = g.order
    if n == 0:
        return np.repeat(g.D[:, None].astype(complex), len(w), axis=1)
    big = 1j * w[None, :, None, None] * np.eye(n) - g.A[:, None]
    x = np.linalg.solve(big, np.repeat(g.B[:, None].astype(complex), len(w), axis=1))
    return np.asarray(g.C[:, None] @ x + g.D[:, None])


def poles(g: Gridded) -> Array:
    """Frozen poles, complex (N, n), rad/s."""
    return np.linalg.eigvals(g.A)


def _imaginary_crossings(A: Array, B: Array, C: Array, D: Array, level: float) -> Array:
    """Frequencies at which a singular value equals `level`: imaginary eigenvalues of the Hamiltonian."""
    R = level**2 * np.eye(D.shape[1]) - D.T @ D
    K = np.linalg.solve(R, D.T @ C)
    H = np.block(
        [
            [A + B @ K, B @ np.linalg.solve(R, B.T)],
            [-C.T @ (C + D @ K), -(A + B @ K).T],
        ]
    )
    e = np.linalg.eigvals(H)
    # Eigenvalues on the axis come out within rounding of the matrix norm.
    return np.sort(np.abs(e.imag[np.abs(e.real) <= 1e-9 * (1.0 + np.abs(e))]))


def hinf_norm(g: Gridded, node: int = 0, tol: float = 1e-9) -> tuple[float, float]:
    """Largest singular value over all frequencies of one frozen node, and where (rad/s); inf if not stable.

    Bruinsma and Steinbuch (1990): a level is raised until the Hamiltonian has no imaginary eigenvalue.
    """
    A, B, C, D = (np.asarray(m[node], float) for m in (g.A, g.B, g.C, g.D))
    if g.order == 0:
        return float(np.linalg.norm(D, 2)), 0.0
    p = np.linalg.eigvals(A)
    if p.real.max() >= 0.0:
        return np.inf, float(np.abs(p[np.argmax(p.real)].imag))
    one = Gridded(g.V[node : node + 1], A[None], B[None], C[None], D[None], g.inputs, g.outputs)

    def sigma(w: Array) -> Array:
        return np.linalg.svd(response(one, w)[0], compute_uv=False)[:, 0]

    w = np.unique(np.concatenate(([0.0], np.abs(p), np.logspace(-4, 5, 181))))
    s = sigma(w)
    best, where = float(s.max()), float(w[np.argmax(s)])
    best, where = max((best, where), (float(np.linalg.norm(D, 2)), np.inf))
    for _ in range(50):
        cross = _imaginary_crossings(A, B, C, D, best * (1.0 + 2.0 * tol)) if best > 0 else np.array([])
        if len(cross) == 0:
            break
        mid = np.unique(np.concatenate((cross, 0.5 * (cross[1:] + cross[:-1]))))
        s = sigma(mid)
        if s.max() <= best * (1.0 + tol):
            break
        best, where = float(s.max()), float(mid[np.argmax(s)])
    return best, where


class Basis(NamedTuple):
    """Powers 1, s, s^2, ... of s = (V - centre) / half_width, the functions a storage matrix is made of."""

    degree: int
    centre: float
    half_width: float

    def values(self, V: Array) -> Array:
        """(N, degree + 1)."""
        s = (np.asarray(V, float) - self.centre) / self.half_width
        return np.power(s[:, None], np.arange(self.degree + 1)[None, :])

    def slopes(self, V: Array) -> Array:
        """d/dV of the values, (N, degree + 1), 1/(m/s)."""
        s = (np.asarray(V, float) - self.centre) / self.half_width
        k = np.arange(self.degree + 1)
        return k * np.power(s[:, None], np.maximum(k - 1, 0)[None, :]) / self.half_width


def basis_for(V: Array, degree: int = 2) -> Basis:
    """The basis that spans the nodes; degree 0 where there is one node."""
    lo, hi = float(V[0]), float(V[-1])
    return Basis(0, lo, 1.0) if hi == lo else Basis(degree, 0.5 * (lo + hi), 0.5 * (hi - lo))


def to_control(g: Gridded) -> list[Any]:
    """One `control.StateSpace` for each node, with signal names."""
    try:
        import control
    except ImportError as error:
        from ..core import MissingExtra

        raise MissingExtra("to_control needs python-control; pip install 'aerofdi[design]'") from error
    return [
        control.ss(g.A[k], g.B[k], g.C[k], g.D[k], inputs=list(g.inputs), outputs=list(g.outputs))
        for k in range(len(g.V))
    ]


def from_control(V: Sequence[float] | Array, systems: Sequence[Any]) -> Gridded:
    """The inverse of `to_control`: continuous systems of equal size, one for each airspeed."""
    if any(not getattr(s, "isctime", lambda: True)() for s in systems):
        raise WrongUse("from_control takes continuous-time systems; convert discrete ones first")
    first = systems[0]
    A, B, C, D = (np.array([np.asarray(getattr(s, k), float) for s in systems]) for k in "ABCD")
    return gridded(V, A, B, C, D, list(first.input_labels), list(first.output_labels))
