"""An identified aircraft -> the numbers of the `parity` diagnoser."""

from __future__ import annotations

import math

import numpy as np

from ..aircraft.identified import IdentifiedModel
from ..core.types import Diagnoser
from ..parts.servo import servo_coefficients
from .parity import from_linear

BANDWIDTH = 2.0


def from_identified(
    model: IdentifiedModel,
    max_age_s: dict[str, float],
    threshold: tuple[float, ...] | None = None,
    bandwidth: float = BANDWIDTH,
    behind_s: float = 0.0,
) -> Diagnoser:
    """Each rate on its own: predicted from commands, the other measured rates, air angles and the trim moment.

    threshold: rad/s for each axis of the model; None gives infinity-like limits, to see residuals before calibration.
    behind_s: how far behind the channels are read (`core.bind`).
    """
    rates = [a.rate for a in model.axes]
    channels = model.channels
    air = [n for n in channels if n in ("alpha", "beta")]
    surfaces = [(g, c, w) for g in model.groups for c, w in zip(g.channels, g.weights, strict=True)]
    exogenous = [*[n for n in channels if n in ("p", "q", "r")], *air, "1"]
    na, nu = len(rates), len(model.groups)
    a = np.diag([x.coefficient(x.rate) for x in model.axes])
    b = np.zeros((na, nu + len(exogenous)))
    for i, axis in enumerate(model.axes):
        for j, g in enumerate(model.groups):
            b[i, j] = axis.coefficient(f"command.{g.name}")
        for j, n in enumerate(exogenous):
            b[i, nu + j] = axis.coefficient("trim" if n == "1" else n) if n != axis.rate else 0.0
    mix = np.zeros((nu, len(surfaces)))
    for i, (g, _, w) in enumerate(surfaces):
        mix[model.groups.index(g), i] = w
    order, speed = (1, 1.0 / model.lag_s) if model.lag_s > 0 else (0, 1.0)
    servo = np.array(
        [
            servo_coefficients(order, speed, lower=g.lower, upper=g.upper, dt_s=model.dt_s)
            for g, _, _ in surfaces
        ]
    )
    d = from_linear(
        a,
        b,
        np.eye(na),
        dt_s=model.dt_s,
        commands=[c for _, c, _ in surfaces],
        servo=servo,
        delay_s=model.delay_s,
        mix=mix,
        outputs=rates,
        threshold=threshold or (1e6,) * na,
        bandwidth=min(bandwidth, 0.3 * math.pi / model.dt_s),
        exogenous=exogenous,
        units=channels,
        max_age_s=max_age_s,
        start=np.eye(na),
        airspeed=model.airspeed if math.isfinite(model.airspeed) else None,
    )
    return d._replace(inputs=d.inputs._replace(behind_s=behind_s))
