"""The fault isolator of Figure 6 as a state machine: which surface to excite next, and what its answer means.

| mode  | does                  | goes to | when                                                     |
|-------|-----------------------|---------|----------------------------------------------------------|
| WATCH | nothing               | TEST    | suspicion, or a sweep is due (`sweep_every`)             |
| TEST  | excites the surfaces  | TEST    | all of the slot decided, or `test_max`: the next slot    |
|       | of one slot (and the  | TRACK   | the round is over and a surface is declared              |
|       | declared, if apart)   | REST    | the round is over and none is; or the slot is decided,   |
|       |                       |         | none is, the suspicion has fallen, and it is no sweep    |
| TRACK | excites the declared  | TEST    | another axis shows a residual (after `rest`), or         |
|       | surfaces              |         | `retest`: its twins again                                |
|       |                       | REST    | every declared surface answers again                     |
| REST  | nothing               | WATCH   | after `rest` (TRACK where a surface is declared)         |
| HALT  | nothing;              | REST    | attitude back in the envelope for `rest` (altitude and   |
|       | OUT_OF_ENVELOPE       |         | track count from there); entered from TEST, TRACK at once|
| SPENT | nothing; labels stay, | WATCH   | `event.reset` only; entered when the seconds of          |
|       | fall after `settle`   |         | excitation are used up                                   |
|       | without suspicion     |         |                                                          |

Suspicion is ThereIsaFault in still air or with fixed thresholds; in gusts it comes at a share of the
threshold (see `smac.detect`).

A decision needs `test_min` samples of excitation and evidence beyond `odds` (see `smac_health`): for "does
not answer" the surface is declared, for "sound" it is acquitted. The evidence is weighed with the noise
heard before the test, so in wind a test takes longer instead of guessing. A surface still undecided after
`test_max` is not declared and is tried again next round. A declared surface recovers when the evidence for
its answer, from then on, passes `odds`.

Order: the axis whose |LP2(LP1(residual))| / threshold is largest comes first, its surfaces in the order of
the aircraft file. Once a surface is declared its axis is explained: of that axis only the untested twins
are tested, other axes only where their own residual passes its threshold (p, q, r thresholds chosen by
(12)). So several simultaneous faults are found one after the other. event.reset clears labels and seconds
from any mode.

The text of the paper gives the purpose of Figure 6 but not its timeouts, and its drawing is not used here.
"""

from __future__ import annotations

from ..core import Array
from ..parts.ops import inline, lean, maximum, sin
from .smac_health import excite, loss_std, needed_odds, remaining, silence
from .smac_types import (
    AIRSPEED,
    ALTITUDE,
    AXIS,
    DELTA,
    DRIFT,
    EFFORT,
    EVIDENCE,
    FOREIGN,
    HEARD,
    HOME_ALTITUDE,
    HOME_PSI,
    HOME_THETA,
    LABEL,
    LEVEL,
    MODE,
    PHASE,
    PHI,
    PSI,
    ROUND,
    SINCE,
    SLOT,
    SUSPECT,
    SWEEP,
    SWEEP_AGE,
    TEST_SCALE,
    THETA,
    Ints,
    Params,
    State,
)

WATCH, TEST, TRACK, REST, HALT, SPENT = range(6)
UNTESTED, SOUND, UNDECIDED = range(3)


@inline
def enter(s: State, mode: int) -> None:
    """Change mode; what was excited goes quiet, but declared surfaces stay excited through TEST and TRACK."""
    s.clock[MODE] = mode
    s.clock[SINCE] = 0
    s.clock[FOREIGN] = 0
    for i in range(len(s.count)):
        if mode not in (TEST, TRACK) or s.count[i, LABEL] == 0:
            silence(s, i)


@inline
def reset(s: State) -> None:
    """`event.reset`: forget labels, round and used seconds; the filters stay."""
    s.count[:, LABEL] = 0
    s.count[:, ROUND] = UNTESTED
    s.clock[EFFORT] = 0
    s.clock[SWEEP] = 0
    s.clock[SWEEP_AGE] = 0
    enter(s, WATCH)


@inline
def labelled(s: State) -> bool:
    """Whether any surface is declared."""
    found = False
    for i in range(len(s.count)):
        found = found or s.count[i, LABEL] > 0
    return found


@inline
def go_home(s: State, z: Array) -> None:
    """Remember the straight and level flight that the excitation must not leave."""
    s.misc[HOME_THETA] = z[THETA]
    s.misc[HOME_ALTITUDE] = z[ALTITUDE]
    s.misc[HOME_PSI] = z[PSI]
    s.misc[DRIFT] = 0.0


@inline
def outside(p: Params, s: State, z: Array) -> bool:
    """Whether attitude, altitude or track have left the envelope since the isolator began.

    The track deviation is the integral of V sin(psi - psi0): what the aircraft strays sideways from the
    straight flight it had, wind apart.
    """
    s.misc[DRIFT] += p.model.dt * z[AIRSPEED] * sin(z[PSI] - s.misc[HOME_PSI])
    b = p.budget
    return bool(
        abs(z[PHI]) > b.bank
        or abs(z[THETA] - s.misc[HOME_THETA]) > b.pitch
        or abs(z[ALTITUDE] - s.misc[HOME_ALTITUDE]) > b.altitude
        or abs(s.misc[DRIFT]) > b.track
    )


@inline
def _axis_ratio(p: Params, s: State, axis: int) -> float:
    """|LP2(LP1(residual))| over its threshold, less what the declared surfaces explain of it."""
    rest = s.axes[axis, LEVEL]
    for i in range(len(s.count)):
        if s.count[i, LABEL] > 0:
            rest -= p.detector.sensitivity[axis, i] * s.surface[i, DELTA]
    return abs(rest) / (p.detector.axis[axis] * s.misc[TEST_SCALE + axis])


@inline
def _explained(p: Params, s: State, axis: int) -> bool:
    """Whether a declared surface belongs to this axis."""
    found = False
    for i in range(len(s.count)):
        found = found or (s.count[i, LABEL] > 0 and p.probe.place[i, AXIS] == axis)
    return found


@inline
def _wanted(p: Params, s: State, i: int, any_label: bool) -> float:
    """Urgency of testing surface i, -1 where it should not be tested now."""
    if s.count[i, LABEL] > 0 or s.count[i, ROUND] != UNTESTED:
        return -1.0
    ratio = _axis_ratio(p, s, p.probe.place[i, AXIS])
    if any_label and s.clock[SWEEP] == 0:
        if _explained(p, s, p.probe.place[i, AXIS]):
            return 1e3 + ratio
        if ratio < 1.0:
            return -1.0
    return ratio


@lean
def _next_slot(p: Params, s: State) -> int:
    """The most urgent slot of this round, -1 when there is none left."""
    best, urgency = -1, -1.0
    any_label = labelled(s)
    for k in range(len(p.probe.slots)):
        for i in range(len(s.count)):
            if p.probe.slots[k, i] > 0:
                want = _wanted(p, s, i, any_label)
                if want > urgency:
                    best, urgency = k, want
    return best


@lean
def _advance_round(p: Params, s: State) -> None:
    """Next slot of the round, or its end."""
    k = _next_slot(p, s)
    if k >= 0:
        enter(s, TEST)
        s.clock[SLOT] = k
        return
    s.clock[SWEEP] = 0
    s.clock[SWEEP_AGE] = 0
    enter(s, TRACK if labelled(s) else REST)


@lean
def _watch(p: Params, s: State, z: Array) -> None:
    due = p.timing.sweep_every > 0 and s.clock[SWEEP_AGE] >= p.timing.sweep_every
    if s.clock[SUSPECT] > 0 or due:
        s.clock[SWEEP] = 1 if due and s.clock[SUSPECT] == 0 else 0
        s.count[:, ROUND] = UNTESTED
        go_home(s, z)
        _advance_round(p, s)


@inline
def _decide(p: Params, s: State, i: int) -> None:
    """Declared or sound, once the evidence is strong enough."""
    evidence, odds = s.surface[i, EVIDENCE], needed_odds(p, s)
    if evidence >= odds:
        s.count[i, LABEL], s.count[i, ROUND] = 1, SOUND  # tested; the label says the rest
        s.surface[i, EVIDENCE] = 0.0
    elif evidence <= -odds:
        s.count[i, ROUND] = SOUND


@inline
def _apart(p: Params, slot: Ints, i: int) -> bool:
    """Whether a declared surface may stay excited during a test: no surface of the slot shares axis and
    frequency.
    """
    apart = True
    for j in range(len(slot)):
        same = p.probe.place[j, AXIS] == p.probe.place[i, AXIS]
        if j != i and slot[j] > 0 and same and p.probe.surface[j, PHASE] == p.probe.surface[i, PHASE]:
            apart = False
    return apart


@lean
def _test(p: Params, s: State) -> None:
    slot = p.probe.slots[s.clock[SLOT]]
    pending = 0
    for i in range(len(slot)):
        if s.count[i, LABEL] > 0:
            _follow(p, s, i)
        elif slot[i] > 0 and s.count[i, ROUND] == UNTESTED:
            _decide(p, s, i)
            if s.clock[SINCE] >= p.timing.test_max and s.count[i, ROUND] == UNTESTED:
                s.count[i, ROUND] = UNDECIDED
            pending += 1 if s.count[i, ROUND] == UNTESTED else 0
    if pending == 0:
        if s.clock[SUSPECT] == 0 and s.clock[SWEEP] == 0 and not labelled(s):
            enter(s, REST)
        else:
            _advance_round(p, s)
        return
    for i in range(len(slot)):
        if slot[i] > 0 or (s.count[i, LABEL] > 0 and _apart(p, slot, i)):
            excite(p.probe, s, i)
        elif s.count[i, LABEL] > 0:
            silence(s, i)


@lean
def _foreign(p: Params, s: State) -> bool:
    """Whether an axis without a declared surface has shown a residual for `confirm` samples."""
    seen = False
    for axis in range(3):
        if not _explained(p, s, axis) and _axis_ratio(p, s, axis) > 1.0:
            for i in range(len(s.count)):
                seen = seen or p.probe.place[i, AXIS] == axis
    s.clock[FOREIGN] = s.clock[FOREIGN] + 1 if seen else 0
    return bool(s.clock[FOREIGN] >= p.timing.confirm)


@inline
def _name_mode(p: Params, s: State, i: int) -> None:
    """Stuck or partly effective: changed once what is left is clear of the edge, by 0.05 and by the noise of
    the answer.
    """
    beyond = remaining(p.probe, s, i) - p.probe.stuck_below
    clear = maximum(0.05, 3.0 * loss_std(p.probe, s, i))
    if s.count[i, LABEL] == 1 and beyond > clear:
        s.count[i, LABEL] = 2
    elif s.count[i, LABEL] == 2 and beyond < -clear:
        s.count[i, LABEL] = 1


@lean
def _follow(p: Params, s: State, i: int) -> None:
    """A declared surface whose answer is back has recovered; else it is stuck or partly effective."""
    odds = needed_odds(p, s)
    if s.surface[i, EVIDENCE] >= odds:
        s.count[i, LABEL] = 0
        silence(s, i)
    elif s.count[i, HEARD] > 0 and s.surface[i, EVIDENCE] < 0.25 * odds:
        _name_mode(p, s, i)  # not while it is on the way back


@lean
def _track(p: Params, s: State) -> None:
    for i in range(len(s.count)):
        if s.count[i, LABEL] > 0:
            _follow(p, s, i)
    if not labelled(s):
        enter(s, REST)
        return
    again = s.clock[SINCE] >= p.timing.retest
    if again or (_foreign(p, s) and s.clock[SINCE] >= p.timing.rest):
        for i in range(len(s.count)):
            if again or not _explained(p, s, p.probe.place[i, AXIS]):
                s.count[i, ROUND] = UNTESTED
        if _next_slot(p, s) >= 0:
            _advance_round(p, s)
            return
        s.clock[SINCE] = 0
    for i in range(len(s.count)):
        if s.count[i, LABEL] > 0:
            excite(p.probe, s, i)


@lean
def _wait(p: Params, s: State, z: Array, mode: int) -> None:
    """REST, HALT and SPENT."""
    if mode == HALT:
        # Home is where the aircraft is once it flies level again; track and altitude do not hold it back.
        if abs(z[PHI]) > p.budget.bank or abs(z[THETA] - s.misc[HOME_THETA]) > p.budget.pitch:
            # A climb it has left for good is no home: what counts from now on is that the pitch stays.
            s.misc[HOME_THETA] = z[THETA]
            s.clock[SINCE] = 0
        elif s.clock[SINCE] >= p.timing.rest:
            go_home(s, z)
            s.clock[SWEEP] = 0
            enter(s, REST)
    elif mode == SPENT:
        if s.clock[SUSPECT] > 0:
            s.clock[SINCE] = 0
        elif s.clock[SINCE] >= p.timing.settle:
            s.count[:, LABEL] = 0
    elif s.clock[SINCE] >= p.timing.rest:
        enter(s, TRACK if labelled(s) else WATCH)


@lean
def isolate(p: Params, s: State, z: Array) -> None:
    """One sample of the machine."""
    s.clock[SINCE] += 1
    s.clock[SWEEP_AGE] += 1
    mode = int(s.clock[MODE])
    if mode in (TEST, TRACK):
        s.clock[EFFORT] += 1
        if s.clock[EFFORT] * p.model.dt > p.budget.seconds:
            enter(s, SPENT)
        elif outside(p, s, z):
            enter(s, HALT)
        elif mode == TEST:
            _test(p, s)
        else:
            _track(p, s)
    elif mode == WATCH:
        _watch(p, s, z)
    else:
        _wait(p, s, z, mode)
