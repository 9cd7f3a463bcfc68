"""The fault isolator of Figure 6 as a state machine: which surface to excite next, and what its answer means.

| mode  | does                          | goes to | when                                                                     |
|-------|-------------------------------|---------|--------------------------------------------------------------------------|
| WATCH | nothing                       | TEST    | ThereIsaFault, or a sweep is due (`sweep_every`)                         |
| TEST  | excites the surfaces of one   | TEST    | all of the slot decided, or `test_max`: next slot of the round           |
|       | slot                          | TRACK   | the round is over and a surface is declared                              |
|       |                               | REST    | the round is over and none is                                            |
|       |                               | WATCH   | ThereIsaFault has fallen and nothing is declared (and it is no sweep)    |
| TRACK | excites the declared surfaces | TEST    | another axis shows a residual (after `rest`), or `retest`: twins again   |
|       |                               | REST    | every declared surface has answered again for `recover`: recovered       |
| REST  | nothing                       | WATCH   | after `rest` (TRACK where a surface is declared)                         |
| HALT  | nothing; OUT_OF_ENVELOPE      | REST    | back in the envelope for `rest`; entered from TEST and TRACK at once     |
| SPENT | nothing; labels stay, fall    | WATCH   | `event.reset` only; entered when the seconds of excitation are used up   |
|       | after `settle` without a flag |         |                                                                          |

A decision needs `test_min` samples of excitation and `confirm` samples on one side of the threshold: Lambda above it =
declared, below = sound; `margin` standard deviations are added on both sides, so in wind a test takes longer instead of
guessing. A surface still undecided after `test_max` is undecided, is not declared, and is tried again next round.

Order: the axis whose |LP2(LP1(residual))| / threshold is largest comes first, its surfaces in the order of the aircraft
file. Once a surface is declared its axis is explained: of that axis only the untested twins are tested, other axes only
where their own residual passes its threshold (p, q, r thresholds chosen by (12)). So several simultaneous faults are
found one after the other. event.reset clears labels and seconds from any mode.

The text of the paper gives the purpose of Figure 6 but not its timeouts, and its drawing is not used here.
"""

from __future__ import annotations

from ..parts.ops import jit, sin
from .smac_health import doubt, excite, quiet, remaining
from .smac_types import (
    AIRSPEED,
    ALTITUDE,
    DRIFT,
    EFFORT,
    FLAG,
    FOREIGN,
    HOME_ALTITUDE,
    HOME_PSI,
    HOME_THETA,
    MODE,
    PHI,
    PSI,
    SINCE,
    SLOT,
    SWEEP,
    SWEEP_AGE,
    THETA,
    Array,
    Params,
    State,
)

WATCH, TEST, TRACK, REST, HALT, SPENT = range(6)
UNTESTED, SOUND, UNDECIDED = range(3)


@jit
def enter(s: State, mode: int) -> None:
    """Change mode; whatever was excited goes quiet (the new mode starts its own)."""
    s.clock[MODE] = mode
    s.clock[SINCE] = 0
    s.clock[FOREIGN] = 0
    quiet(s)


@jit
def reset(s: State) -> None:
    """`event.reset`: forget labels, round and used seconds; the filters stay."""
    s.label[:] = 0
    s.verdict[:] = UNTESTED
    s.clock[EFFORT] = 0
    s.clock[SWEEP] = 0
    s.clock[SWEEP_AGE] = 0
    enter(s, WATCH)


@jit
def labelled(s: State) -> bool:
    """Whether any surface is declared."""
    return bool(s.label.max() > 0)


@jit
def go_home(s: State, z: Array) -> None:
    """Remember the straight and level flight that the excitation must not leave."""
    s.home[HOME_THETA] = z[THETA]
    s.home[HOME_ALTITUDE] = z[ALTITUDE]
    s.home[HOME_PSI] = z[PSI]
    s.home[DRIFT] = 0.0


@jit
def outside(p: Params, s: State, z: Array) -> bool:
    """Whether attitude, altitude or track have left the envelope since the isolator began.

    The track deviation is the integral of V sin(psi - psi0): what the aircraft strays sideways from the straight flight
    it had, wind apart.
    """
    s.home[DRIFT] += p.model.dt * z[AIRSPEED] * sin(z[PSI] - s.home[HOME_PSI])
    b = p.budget
    return bool(
        abs(z[PHI]) > b.bank
        or abs(z[THETA] - s.home[HOME_THETA]) > b.pitch
        or abs(z[ALTITUDE] - s.home[HOME_ALTITUDE]) > b.altitude
        or abs(s.home[DRIFT]) > b.track
    )


@jit
def _axis_ratio(p: Params, s: State, axis: int) -> float:
    """|LP2(LP1(residual))| over its threshold, less what the declared surfaces explain of it."""
    rest = s.axis[axis]
    for i in range(len(s.label)):
        if s.label[i] > 0:
            rest -= p.detector.sensitivity[axis, i] * s.delta[i]
    return abs(rest) / p.detector.axis[axis]


@jit
def _explained(p: Params, s: State, axis: int) -> bool:
    """Whether a declared surface belongs to this axis."""
    for i in range(len(s.label)):
        if s.label[i] > 0 and p.probe.axis[i] == axis:
            return True
    return False


@jit
def _wanted(p: Params, s: State, i: int, any_label: bool, scale: float) -> float:
    """Urgency of testing surface i, -1 where it should not be tested now."""
    if s.label[i] > 0 or s.verdict[i] != UNTESTED:
        return -1.0
    ratio = _axis_ratio(p, s, p.probe.axis[i])
    if any_label and s.clock[SWEEP] == 0:
        if _explained(p, s, p.probe.axis[i]):
            return 1e3 + ratio
        if ratio < scale:
            return -1.0
    return ratio


@jit
def _next_slot(p: Params, s: State, scale: float) -> int:
    """The most urgent slot of this round, -1 when there is none left."""
    best, urgency = -1, -1.0
    any_label = labelled(s)
    for k in range(len(p.probe.slots)):
        for i in range(len(s.label)):
            if p.probe.slots[k, i] > 0:
                want = _wanted(p, s, i, any_label, scale)
                if want > urgency:
                    best, urgency = k, want
    return best


@jit
def _advance_round(p: Params, s: State, scale: float) -> None:
    """Next slot of the round, or its end."""
    k = _next_slot(p, s, scale)
    if k >= 0:
        enter(s, TEST)
        s.clock[SLOT] = k
        return
    s.clock[SWEEP] = 0
    s.clock[SWEEP_AGE] = 0
    enter(s, TRACK if labelled(s) else REST)


@jit
def _watch(p: Params, s: State, z: Array, scale: float) -> None:
    due = p.timing.sweep_every > 0 and s.clock[SWEEP_AGE] >= p.timing.sweep_every
    if s.clock[FLAG] > 0 or due:
        s.clock[SWEEP] = 1 if due and s.clock[FLAG] == 0 else 0
        s.verdict[:] = UNTESTED
        go_home(s, z)
        _advance_round(p, s, scale)


@jit
def _decide(p: Params, s: State, i: int) -> None:
    """Declared or sound, once the answer has been on one side for `confirm` samples."""
    if s.excited[i] < p.timing.test_min or s.count[i] == 0:
        return
    margin = p.timing.margin * doubt(p, s, i)
    gap = s.lam[i] - p.probe.threshold[i]
    if gap > margin:
        s.hold[i] = max(s.hold[i], 0) + 1
    elif gap < -margin:
        s.hold[i] = min(s.hold[i], 0) - 1
    else:
        s.hold[i] = 0
    if s.hold[i] >= p.timing.confirm:
        s.label[i] = 1
        s.verdict[i] = SOUND  # tested; the label says the rest
        s.hold[i] = 0
    elif s.hold[i] <= -p.timing.confirm:
        s.verdict[i] = SOUND


@jit
def _test(p: Params, s: State, scale: float) -> None:
    if s.clock[FLAG] == 0 and s.clock[SWEEP] == 0 and not labelled(s):
        enter(s, WATCH)
        return
    slot = p.probe.slots[s.clock[SLOT]]
    pending = 0
    for i in range(len(slot)):
        if slot[i] > 0 and s.verdict[i] == UNTESTED and s.label[i] == 0:
            _decide(p, s, i)
            if s.clock[SINCE] >= p.timing.test_max and s.verdict[i] == UNTESTED:
                s.verdict[i] = UNDECIDED
            pending += 1 if s.verdict[i] == UNTESTED else 0
    if pending == 0:
        _advance_round(p, s, scale)
        return
    for i in range(len(slot)):
        if slot[i] > 0 and s.label[i] == 0:
            excite(p, s, i)


@jit
def _foreign(p: Params, s: State, scale: float) -> bool:
    """Whether an axis without a declared surface has shown a residual for `confirm` samples."""
    seen = False
    for axis in range(3):
        if not _explained(p, s, axis) and _axis_ratio(p, s, axis) > scale:
            for i in range(len(s.label)):
                seen = seen or p.probe.axis[i] == axis
    s.clock[FOREIGN] = s.clock[FOREIGN] + 1 if seen else 0
    return bool(s.clock[FOREIGN] >= p.timing.confirm)


@jit
def _name_mode(p: Params, s: State, i: int) -> None:
    """Stuck or partly effective, with hysteresis of 0.1 in what is left."""
    left = remaining(p.probe, s, i)
    edge = p.probe.stuck_below + (0.05 if s.label[i] == 1 else -0.05)
    s.label[i] = 1 if left < edge else 2


@jit
def _follow(p: Params, s: State, i: int) -> None:
    """A declared surface that answers again for `recover` samples has recovered."""
    if s.count[i] > 0 and s.excited[i] >= p.timing.test_min:
        s.hold[i] = s.hold[i] + 1 if s.lam[i] < p.probe.threshold[i] else 0
        _name_mode(p, s, i)
    if s.hold[i] >= p.timing.recover:
        s.label[i] = 0
        s.excited[i] = 0
        s.excitation[i] = 0.0


@jit
def _track(p: Params, s: State, scale: float) -> None:
    for i in range(len(s.label)):
        if s.label[i] > 0:
            _follow(p, s, i)
    if not labelled(s):
        enter(s, REST)
        return
    again = s.clock[SINCE] >= p.timing.retest
    if again or (_foreign(p, s, scale) and s.clock[SINCE] >= p.timing.rest):
        for i in range(len(s.label)):
            if again or not _explained(p, s, p.probe.axis[i]):
                s.verdict[i] = UNTESTED
        if _next_slot(p, s, scale) >= 0:
            _advance_round(p, s, scale)
            return
        s.clock[SINCE] = 0
    for i in range(len(s.label)):
        if s.label[i] > 0:
            excite(p, s, i)


@jit
def _wait(p: Params, s: State, z: Array, mode: int) -> None:
    """REST, HALT and SPENT."""
    if mode == HALT:
        # Home is where the aircraft is once it flies level again; track and altitude do not hold it back.
        if abs(z[PHI]) > p.budget.bank or abs(z[THETA] - s.home[HOME_THETA]) > p.budget.pitch:
            s.clock[SINCE] = 0
        elif s.clock[SINCE] >= p.timing.rest:
            go_home(s, z)
            enter(s, REST)
    elif mode == SPENT:
        if s.clock[FLAG] > 0:
            s.clock[SINCE] = 0
        elif s.clock[SINCE] >= p.timing.settle:
            s.label[:] = 0
    elif s.clock[SINCE] >= p.timing.rest:
        enter(s, TRACK if labelled(s) else WATCH)


@jit
def isolate(p: Params, s: State, z: Array, scale: float) -> None:
    """One sample of the machine; scale: how far wind raises the thresholds of the axes (1 in still air)."""
    s.clock[SINCE] += 1
    s.clock[SWEEP_AGE] += 1
    mode = int(s.clock[MODE])
    if mode == TEST or mode == TRACK:
        s.clock[EFFORT] += 1
        if s.clock[EFFORT] * p.model.dt > p.budget.seconds:
            enter(s, SPENT)
        elif outside(p, s, z):
            enter(s, HALT)
        elif mode == TEST:
            _test(p, s, scale)
        else:
            _track(p, s, scale)
    elif mode == WATCH:
        _watch(p, s, z, scale)
    else:
        _wait(p, s, z, mode)
