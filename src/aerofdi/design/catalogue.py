"""The designs that need nothing but an aircraft file: name -> function, for the command line and campaigns."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ..aircraft import load_aircraft
from ..aircraft.types import Aircraft
from ..core.errors import WrongUse
from ..core.types import Design

Progress = Callable[[str, float], None]
METHODS = ("lpv_observer", "smac")


def make(
    method: str,
    aircraft: str | Aircraft,
    settings: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Design:
    """A Design of one of METHODS for an aircraft (name, path or loaded).

    settings: fields of the method's Spec that differ from its defaults. Raises WrongUse for an unknown method, setting
    or aircraft, CannotJudge where no design exists, MissingExtra where a solver is not installed.

    >>> make("smac", "vireo", {"smallest_fault_deg": 5.0}).method  # doctest: +SKIP
    'smac'
    """
    if method not in METHODS:
        raise WrongUse(f"design {method!r} is not known; there are {', '.join(METHODS)}")
    subject = aircraft if isinstance(aircraft, Aircraft) else load_aircraft(aircraft)
    if subject.kind != "full":
        raise WrongUse(
            f"design {method!r} needs a full aircraft model, but {subject.name!r} is identified from flights; "
            f"give an aircraft file of kind 'full', see `aerofdi info`"
        )
    if method == "smac":
        from .smac import design_smac

        return design_smac(subject, settings, progress)
    from .lpv_observer import Spec, design_lpv_observer

    unknown = sorted(set(settings or {}) - set(Spec._fields))
    if unknown:
        raise WrongUse(f"lpv_observer has no setting {unknown[0]!r}; it has {', '.join(Spec._fields)}")
    return design_lpv_observer(subject, Spec(**(settings or {})), progress)


def settings(texts: Iterable[str]) -> dict[str, Any]:
    """Settings from 'key=value' texts, the value as in TOML; what is not TOML is a word.

    >>> settings(["kind=nominal_lti", "nodes=8", "airspeeds=[13.0, 20.0]"])
    {'kind': 'nominal_lti', 'nodes': 8, 'airspeeds': [13.0, 20.0]}
    """
    out: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise WrongUse(f"setting {text!r} is not KEY=VALUE; give for example nodes=8")
        try:
            out[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            out[key.strip()] = value.strip()
    return out
