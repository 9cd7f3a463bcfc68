"""An aircraft known from its own flights: how each angular rate answers commands, with the uncertainty kept.

Per axis, with V the airspeed over the training mean (1 where no airspeed was measured):

    w' = V (a w + sum_j c_j w_j) + V^2 (sum_s b_s delta_s + c_alpha alpha + c_beta beta + m) + gusts + trim wander

delta_s is the command of a surface or group, delayed by delay_s and lagged by lag_s. The numbers are what
`identify` fitted; the file is TOML, so a person can read and correct it.
"""

from __future__ import annotations

import math
import os
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import UnreadableFile, WrongUse
from ..core.types import Array
from ..parts.rate_filter import Disturbance

FORMAT = 1


class SurfaceGroup(NamedTuple):
    """Surfaces whose commands were collinear in training, judged as one.

    delta = sum_i weight_i * command_i, weight_i = +-1/n. lower, upper: the command range (unit of the channels).
    deviation: standard deviation of delta in training. identifiable: whether any axis answers it significantly.
    """

    name: str
    channels: tuple[str, ...]
    weights: tuple[float, ...]
    unit: str
    lower: float
    upper: float
    mean: float
    deviation: float
    identifiable: bool


class AxisModel(NamedTuple):
    """One angular rate. names: the regressors ("p", "command.<group>", "alpha", "trim"), value and covariance theirs.

    r2: share of the rate that commands and other signals alone explain (simulated, no feedback of the rate);
    r2_held_out: the same on the last part of the training, trim and effects fitted without it (damping and delay with
    it). The covariance of the damping is assumed (10 %), not fitted. r2_acceleration: of the equation-error
    stage, on the low-passed angular acceleration. innovation_std: rad/s.
    """

    rate: str
    names: tuple[str, ...]
    value: Array
    covariance: Array
    noise: Disturbance
    innovation_std: float
    r2: float
    r2_acceleration: float
    r2_held_out: float

    def coefficient(self, name: str) -> float:
        """The fitted value of one regressor, 0 where it was not used."""
        return float(self.value[self.names.index(name)]) if name in self.names else 0.0

    def deviation(self, name: str) -> float:
        """Its standard deviation."""
        if name not in self.names:
            return math.nan
        i = self.names.index(name)
        return float(math.sqrt(max(self.covariance[i, i], 0.0)))


class IdentifiedModel(NamedTuple):
    """What `identify` knows: sample period, delay, lag, groups, axes, and the conditions of training.

    airspeed: training mean in m/s, NaN where not measured. envelope: channel -> (low, high) seen in training; the
    range of groundspeed says when the aircraft no longer flies as in training (a glide without engine).
    notes: what a reader should know (collinear commands, contradicted signs, weak excitation). calibration: thresholds
    of diagnosers set on healthy flight with this model, empty before that.
    """

    name: str
    dt_s: float
    delay_s: float
    lag_s: float
    airspeed: float
    groups: tuple[SurfaceGroup, ...]
    axes: tuple[AxisModel, ...]
    trained_s: float
    envelope: dict[str, tuple[float, float]]
    notes: tuple[str, ...]
    calibration: dict[str, tuple[float, ...]] = {}  # noqa: RUF012

    @property
    def channels(self) -> dict[str, str]:
        """Every channel the model reads, with its unit, in binding order."""
        out = {axis.rate: "rad/s" for axis in self.axes}
        for axis in self.axes:
            out |= {n: "rad/s" for n in axis.names if n in ("p", "q", "r")}
        for group in self.groups:
            out |= {c: group.unit for c in group.channels}
        if math.isfinite(self.airspeed):
            out["airspeed"] = "m/s"
        if "groundspeed" in self.envelope:
            out["groundspeed"] = "m/s"
        for axis in self.axes:
            out |= {n: "rad" for n in axis.names if n in ("alpha", "beta")}
        return out


def save_identified(model: IdentifiedModel, path: str | os.PathLike[str]) -> None:
    """Write the model as TOML, beside and renamed, so that a file is whole or not there."""
    import tomli_w

    document: dict[str, Any] = {
        "kind": "identified",
        "format": FORMAT,
        "name": model.name,
        "dt_s": model.dt_s,
        "delay_s": model.delay_s,
        "lag_s": model.lag_s,
        "airspeed_mps": model.airspeed,
        "trained_s": model.trained_s,
        "notes": list(model.notes),
        "calibration": {k: list(v) for k, v in model.calibration.items()},
        "envelope": {k: list(v) for k, v in model.envelope.items()},
        "group": [
            {**g._asdict(), "channels": list(g.channels), "weights": list(g.weights)} for g in model.groups
        ],
        "axis": [
            {
                "rate": a.rate,
                "names": list(a.names),
                "value": [float(x) for x in a.value],
                "covariance": [[float(x) for x in row] for row in a.covariance],
                "noise": {k: float(v) for k, v in a.noise._asdict().items()},
                "innovation_std": a.innovation_std,
                "r2": a.r2,
                "r2_acceleration": a.r2_acceleration,
                "r2_held_out": a.r2_held_out,
            }
            for a in model.axes
        ],
    }
    path = Path(path)
    beside = path.with_name(path.name + ".part")
    beside.write_text(tomli_w.dumps(document), encoding="utf-8")
    os.replace(beside, path)


def load_identified(path: str | os.PathLike[str]) -> IdentifiedModel:
    """Read a file written by `save_identified`; UnreadableFile or WrongUse names what is wrong with it."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(
            f"{path}: cannot be read ({error}); give a model made by `aerofdi identify`"
        ) from None
    try:
        return parse_identified(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise UnreadableFile(
            f"{path}: not valid TOML ({error}); make it again with `aerofdi identify`"
        ) from None
    except (KeyError, TypeError, ValueError) as error:
        raise WrongUse(
            f"{path}: not a complete identified aircraft ({type(error).__name__}: {error}); "
            f"make it again with `aerofdi identify`"
        ) from None


def parse_identified(document: dict[str, Any]) -> IdentifiedModel:
    """The model in an already parsed TOML document."""
    if document.get("kind") != "identified":
        raise ValueError(f"kind is {document.get('kind')!r}, expected 'identified'")
    if document["format"] != FORMAT:
        raise ValueError(f"format is {document['format']!r}, this version reads {FORMAT}")
    groups = tuple(
        SurfaceGroup(**{**g, "channels": tuple(g["channels"]), "weights": tuple(g["weights"])})
        for g in document["group"]
    )
    axes = tuple(_parse_axis(a) for a in document["axis"])
    return IdentifiedModel(
        name=str(document["name"]),
        dt_s=float(document["dt_s"]),
        delay_s=float(document["delay_s"]),
        lag_s=float(document["lag_s"]),
        airspeed=float(document["airspeed_mps"]),
        groups=groups,
        axes=axes,
        trained_s=float(document["trained_s"]),
        envelope={k: (float(v[0]), float(v[1])) for k, v in document["envelope"].items()},
        notes=tuple(document["notes"]),
        calibration={k: tuple(float(x) for x in v) for k, v in document.get("calibration", {}).items()},
    )


def _parse_axis(a: dict[str, Any]) -> AxisModel:
    names, value = tuple(a["names"]), np.array(a["value"], float)
    covariance = np.array(a["covariance"], float)
    if value.shape != (len(names),) or covariance.shape != (len(names), len(names)):
        raise ValueError(
            f"axis {a['rate']!r}: {len(names)} names, value {value.shape}, covariance {covariance.shape}"
        )
    return AxisModel(
        rate=str(a["rate"]),
        names=names,
        value=value,
        covariance=covariance,
        noise=Disturbance(**{k: float(v) for k, v in a["noise"].items()}),
        innovation_std=float(a["innovation_std"]),
        r2=float(a["r2"]),
        r2_acceleration=float(a["r2_acceleration"]),
        r2_held_out=float(a["r2_held_out"]),
    )
