"""Does this surface still move the aircraft? The actuator health evaluators (AHE) of section 3.4, and the
excitation.

The controller answers an excitation delta_s = A sin(omega t) of a sound surface by moving its command
delta_c the other way. Two evaluators measure how much of that answer is there:

rectified (17)   Lambda = LP_i3 | delta_s(k - lambda) + (delta_c - mean)(k) / kappa |
synchronous      Lambda = 2A/pi (1 - Re(Rbar / R0)),   Rbar: mean over the test of R = C / E, C and E the Fourier
                 coefficients of delta_c and delta_s at omega over the last N samples (whole periods)

fused            Lambda = 2A/pi times the minimum-variance mean of 1 - Re(Rbar / R0) and Re(Qbar / Q0), Q the ratio of
                 the filter's residual to the excitation at omega, Q0 that of a surface that does not move

0 = answers as a sound surface, 2A/pi (20) = does not answer. kappa and R0 are measured on the healthy
closed loop (the paper has kappa = 1). kappa is needed because two twins share the work: with both sound
each answers at most half of A; with the twin stuck, nearly all of A. The synchronous one ignores noise at
all other frequencies, lets several surfaces be tested at once at different frequencies, and gives the
remaining effectiveness e of one surface with h sound twins:

    R/(1 + R) = -e L1 / (1 + h L1),   L1: loop gain through one such surface at omega

Not modelled: twins of unlike effect, and groups coupled through two axes (elevons), where e is approximate.
"""

from __future__ import annotations

from math import isfinite, nan

from ..core import Array
from ..parts.ops import clip, inline, maximum, pi, sin, sqrt
from .smac_types import (
    AMPLITUDE,
    ANSWER_IM,
    ANSWER_RE,
    AXIS,
    BUDGET,
    C_COS,
    C_POWER,
    C_SIN,
    C_SUM,
    CALM,
    CROSS_IM,
    CROSS_RE,
    DEAD_IM,
    DEAD_RE,
    E_COS,
    E_SIN,
    EVIDENCE,
    EXCITATION,
    EXCITED,
    FUSED,
    HEALTHY_IM,
    HEALTHY_RE,
    HEARD,
    INDEX,
    LABEL,
    LAG,
    LAMBDA,
    LISTENED,
    LOOP_IM,
    LOOP_RE,
    MEAN,
    NOISE,
    PHASE,
    R_COS,
    R_POWER,
    R_SIN,
    RECTIFIED,
    REPLY,
    RESIDUAL,
    SWEEP,
    THRESHOLD,
    WITNESS_IM,
    WITNESS_RE,
    Params,
    Probe,
    State,
)

# See `_under_way`: the share that leaks, and how many standard deviations of the ambient it must stand out.
LEAK, LEAK_FREE = 0.5, 4.0
# Variance of a lost share when nothing is heard: the linear answer itself is right to about 0.14, and once a
# surface is tracked wavers by half of that.
MODEL, WAVER = 0.02, 0.005


@inline
def watch_commands(probe: Probe, s: State, z: Array, first: int, n: int) -> None:
    """Mean removal, noise filter and the window of every command; z[first:] holds n commands and n
    excitations.
    """
    surface, ring, axes, waves, place = s.surface, s.ring, s.axes, probe.waves, probe.place
    j = int(s.clock[INDEX]) % probe.window
    a_mean, a_noise = probe.a_mean, probe.a_noise
    for i in range(n):
        c, e = float(z[first + i]), float(z[first + n + i])
        mean = float(surface[i, MEAN])
        mean += a_mean * (c - mean)
        high = c - mean
        noise = float(surface[i, NOISE])
        surface[i, MEAN], surface[i, NOISE] = mean, noise + a_noise * (high - noise)
        axis = int(place[i, AXIS])
        dc, de = high - float(ring[i, j]), e - float(ring[n + i, j])
        dr = float(axes[axis, RESIDUAL]) - float(ring[2 * n + axis, j])
        ring[i, j], ring[n + i, j] = high, e
        cosine, sine = float(waves[j, i]), float(waves[j, n + i])
        surface[i, C_SUM] += dc
        surface[i, C_COS] += dc * cosine
        surface[i, C_SIN] += dc * sine
        surface[i, E_COS] += de * cosine
        surface[i, E_SIN] += de * sine
        surface[i, R_COS] += dr * cosine
        surface[i, R_SIN] += dr * sine
    for i in range(3):
        ring[2 * n + i, j] = axes[i, RESIDUAL]


@inline
def listen(probe: Probe, s: State, a_ambient: float) -> None:
    """Without excitation: how much commands and residuals move at the test frequencies by themselves
    (ambient).

    The mean of all that was heard so far, later of the last while.
    """
    surface, scale = s.surface, 2.0 / probe.window
    share = maximum(a_ambient, 1.0 / (1.0 + int(s.clock[LISTENED])))
    s.clock[LISTENED] += 1
    for i in range(len(surface)):
        a, b = scale * float(surface[i, C_COS]), scale * float(surface[i, C_SIN])
        c, d = scale * float(surface[i, R_COS]), scale * float(surface[i, R_SIN])
        surface[i, C_POWER] += share * (a * a + b * b - float(surface[i, C_POWER]))
        surface[i, R_POWER] += share * (c * c + d * d - float(surface[i, R_POWER]))
        surface[i, CROSS_RE] += share * (a * c + b * d - float(surface[i, CROSS_RE]))
        surface[i, CROSS_IM] += share * (a * d - b * c - float(surface[i, CROSS_IM]))


@inline
def _rectified(probe: Probe, s: State, i: int) -> float:
    """(17): the AHE of the paper; returns the lost share Lambda / (2A/pi)."""
    n = len(s.surface)
    delayed = float(s.ring[n + i, (int(s.clock[INDEX]) - int(probe.place[i, LAG])) % probe.window])
    gap = abs(delayed + float(s.surface[i, NOISE]) / float(probe.surface[i, REPLY]))
    s.surface[i, LAMBDA] += probe.a_lambda * (gap - float(s.surface[i, LAMBDA]))
    s.count[i, HEARD] += 1
    return float(s.surface[i, LAMBDA]) * pi / (2.0 * float(probe.surface[i, AMPLITUDE]))


@inline
def _covariance(probe: Probe, s: State, i: int) -> tuple[float, float, float]:
    """Variances of one window's lost share from the command and from the residual, and their covariance.

    From what both do at the test frequency without excitation. Both hear the same gyros, so they err
    together; a negative covariance, which would promise too much, counts as none.
    """
    row, ambient = probe.surface, s.surface
    A = float(row[i, AMPLITUDE])
    a, b = float(row[i, HEALTHY_RE]), float(row[i, HEALTHY_IM])
    c, d = float(row[i, DEAD_RE]), float(row[i, DEAD_IM])
    heard, dead = A * A * (a * a + b * b), A * A * (c * c + d * d)
    # -Re(X / (R0 conj Q0)) / 2A^2, minus because a loud answer is a small loss.
    re, im = a * c + b * d, b * c - a * d
    cross = (
        -0.5 * A * A * (float(ambient[i, CROSS_RE]) * re + float(ambient[i, CROSS_IM]) * im) / (heard * dead)
    )
    return (
        0.5 * float(ambient[i, C_POWER]) / heard,
        0.5 * float(ambient[i, R_POWER]) / dead,
        maximum(cross, 0.0),
    )


@inline
def _answers(probe: Probe, i: int) -> bool:
    """Whether the controller answers this surface at all; where it holds it still only the residual tells."""
    return bool(probe.surface[i, HEALTHY_RE] != 0.0 or probe.surface[i, HEALTHY_IM] != 0.0)


@inline
def _weights(probe: Probe, s: State, i: int) -> tuple[float, float]:
    """Weight of the command's lost share (the residual has the rest), and the variance of the weighted
    mean.
    """
    if not _answers(probe, i):
        d, e = float(probe.surface[i, DEAD_RE]), float(probe.surface[i, DEAD_IM])
        A = float(probe.surface[i, AMPLITUDE])
        return 0.0, 0.5 * float(s.surface[i, R_POWER]) / (A * A * (d * d + e * e))
    v, w, c = _covariance(probe, s, i)
    if probe.method != FUSED or v + w - 2.0 * c <= 0.0:
        return 1.0, v
    weight = clip((w - c) / (v + w - 2.0 * c), 0.0, 1.0)
    rest = 1.0 - weight
    return weight, weight * weight * v + rest * rest * w + 2.0 * weight * rest * c


@inline
def _synchronous(probe: Probe, s: State, i: int) -> float:
    """The lost share of the last window, NaN before there is one; R, Q and Lambda are averaged, at most
    over a_track.
    """
    surface, count = s.surface, s.count
    A = float(probe.surface[i, AMPLITUDE])
    ec, es = float(surface[i, E_COS]), float(surface[i, E_SIN])
    power = ec * ec + es * es
    if count[i, EXCITED] < probe.window + probe.place[i, LAG] or power < (0.1 * probe.window * A) ** 2:
        return nan
    cc, cs = float(surface[i, C_COS]), float(surface[i, C_SIN])
    rc, rs = float(surface[i, R_COS]), float(surface[i, R_SIN])
    answer_re, answer_im = (cc * ec + cs * es) / power, (cc * es - cs * ec) / power
    witness_re, witness_im = (rc * ec + rs * es) / power, (rc * es - rs * ec) / power
    count[i, HEARD] = min(int(count[i, HEARD]) + 1, int(1.0 / probe.a_track))
    share = 1.0 / int(count[i, HEARD])
    surface[i, ANSWER_RE] += share * (answer_re - surface[i, ANSWER_RE])
    surface[i, ANSWER_IM] += share * (answer_im - surface[i, ANSWER_IM])
    surface[i, WITNESS_RE] += share * (witness_re - surface[i, WITNESS_RE])
    surface[i, WITNESS_IM] += share * (witness_im - surface[i, WITNESS_IM])
    weight, _ = _weights(probe, s, i)
    heard = 1.0 - _projection(probe, i, answer_re, answer_im, HEALTHY_RE)
    seen = _projection(probe, i, witness_re, witness_im, DEAD_RE)
    now = weight * heard + (1.0 - weight) * seen
    heard = 1.0 - _projection(probe, i, surface[i, ANSWER_RE], surface[i, ANSWER_IM], HEALTHY_RE)
    seen = _projection(probe, i, surface[i, WITNESS_RE], surface[i, WITNESS_IM], DEAD_RE)
    mean = weight * heard + (1.0 - weight) * seen
    surface[i, LAMBDA] = 2.0 * A / pi * maximum(mean, 0.0)
    return now


@inline
def needed_odds(p: Params, s: State) -> float:
    """The log-likelihood ratio that decides: twice as much in a sweep, where nothing speaks for a fault
    beforehand.
    """
    return 2.0 * p.timing.odds if s.clock[SWEEP] > 0 else p.timing.odds


@inline
def _weigh(p: Params, s: State, i: int, lost: float) -> None:
    """One sample of evidence. While testing, Wald's sequential test of "does not answer" (lost 1) against
    "sound" (lost 0), its zero moved to Lambda_thresh; while tracking, Page's cumulative sum of the
    opposite.

    lost is one window's estimate of variance v. The first window brings (lost - threshold) / v; consecutive
    windows share all but one of N samples, so each further sample brings 1/N of that. Steps are bounded so
    that the change of a label never rests on one sample, in a sweep not on one window: a fault elsewhere that
    begins during it shakes the aircraft for about as long.
    """
    tracking = s.count[i, LABEL] > 0
    odds = needed_odds(p, s)
    most = odds / (p.timing.recover if tracking else p.timing.confirm)
    gap = lost - float(p.probe.surface[i, THRESHOLD]) * pi / (2.0 * float(p.probe.surface[i, AMPLITUDE]))
    if s.count[i, LABEL] == 2:
        # A partly effective surface near the threshold must not come and go.
        gap += float(p.probe.surface[i, THRESHOLD]) * pi / (6.0 * float(p.probe.surface[i, AMPLITUDE]))
    if p.probe.method == RECTIFIED:
        step = most if gap > 0.0 else -most
    elif s.clock[LISTENED] == 0:
        step = 0.0
    else:
        step = gap / maximum(window_variance(p.probe, s, i), 1e-9)
        first = s.count[i, HEARD] == 1 and not tracking
        if s.clock[SWEEP] > 0 and not tracking:
            most = 0.5 * odds if first else odds / p.probe.window
        elif first:
            most = odds - most
        step = clip(step if first else step / p.probe.window, -most, most)
    evidence = float(s.surface[i, EVIDENCE])
    s.surface[i, EVIDENCE] = maximum(evidence - step, 0.0) if tracking else evidence + step


@inline
def _projection(probe: Probe, i: int, a: float, b: float, reference: int) -> float:
    """Re((a + jb) / reference), its real part in that column of probe.surface; 0 for a reference of 0."""
    c, d = float(probe.surface[i, reference]), float(probe.surface[i, reference + 1])
    size = c * c + d * d
    return (a * c + b * d) / size if size > 0.0 else 0.0


@inline
def window_variance(probe: Probe, s: State, i: int) -> float:
    """Variance of the lost share that one window gives: the ambient, what the linear answer may be off,
    and while testing what a transient leaks.
    """
    _, variance = _weights(probe, s, i)
    return variance + WAVER if s.count[i, LABEL] > 0 else variance + MODEL + _under_way(probe, s, i)


@inline
def _under_way(probe: Probe, s: State, i: int) -> float:
    """What a command on its way to another mean leaks into the test frequency, as variance of the lost share.

    After a step D the high-passed command D exp(-t/tau) has a mean of 0.45 D over the window and 0.26 D at the
    frequency (f_i1 0.3 Hz, 1 Hz), so about half the mean; what noise explains of it is taken off.
    """
    mean = 2.0 / probe.window * abs(float(s.surface[i, C_SUM]))
    excess = maximum(mean - LEAK_FREE * sqrt(float(s.surface[i, C_POWER])), 0.0)
    a, b = float(probe.surface[i, HEALTHY_RE]), float(probe.surface[i, HEALTHY_IM])
    A = float(probe.surface[i, AMPLITUDE])
    size = A * A * (a * a + b * b)
    return LEAK * LEAK * excess * excess / size if size > 0.0 else 0.0


@inline
def remaining(probe: Probe, s: State, i: int) -> float:
    """Effectiveness left of surface i, 0 to about 1, from its averaged answer and the number of sound
    twins.
    """
    if probe.method == RECTIFIED or not _answers(probe, i):
        return clip(1.0 - s.surface[i, LAMBDA] * pi / (2.0 * probe.surface[i, AMPLITUDE]), 0.0, 1.0)
    sound = 0
    for j in range(len(s.surface)):
        if j != i and probe.place[j, AXIS] == probe.place[i, AXIS] and s.count[j, LABEL] == 0:
            sound += 1
    a, b = float(s.surface[i, ANSWER_RE]), float(s.surface[i, ANSWER_IM])
    lr, li = float(probe.surface[i, LOOP_RE]), float(probe.surface[i, LOOP_IM])
    # rho = R / (1 + R), then e = -Re(rho (1 + h L1) / L1).
    size = (1.0 + a) * (1.0 + a) + b * b
    rr, ri = (a * (1.0 + a) + b * b) / size, b / size
    top = lr * lr + li * li
    return clip(-(rr * (lr + sound * top) + ri * li) / top, 0.0, 2.0)


@inline
def evaluate_health(p: Params, s: State) -> None:
    """One sample of the AHE of every surface under excitation, from `test_min` on with evidence."""
    for i in range(len(s.surface)):
        if s.count[i, EXCITED] > 0:
            lost = _rectified(p.probe, s, i) if p.probe.method == RECTIFIED else _synchronous(p.probe, s, i)
            if isfinite(lost) and s.count[i, EXCITED] >= p.timing.test_min:
                _weigh(p, s, i, lost)
            elif isfinite(lost):
                s.count[i, HEARD] = 0


@inline
def loss_std(probe: Probe, s: State, i: int) -> float:
    """Standard deviation of the lost share after the windows averaged so far (0 for the rectified
    evaluator).
    """
    if probe.method == RECTIFIED or s.count[i, HEARD] == 0:
        return 0.0
    _, variance = _weights(probe, s, i)
    return sqrt(variance / (1.0 + int(s.count[i, HEARD]) / probe.window))


@inline
def excite(probe: Probe, s: State, i: int) -> None:
    """delta_s = A sin(omega t) of (14) for the next sample, never beyond the budget."""
    surface, count = s.surface, s.count
    if count[i, EXCITED] == 0:
        surface[i, LAMBDA] = 0.0
        surface[i, ANSWER_RE], surface[i, ANSWER_IM] = 0.0, 0.0
        surface[i, WITNESS_RE], surface[i, WITNESS_IM] = 0.0, 0.0
        surface[i, EVIDENCE] = 0.0
        count[i, HEARD] = 0
    count[i, EXCITED] += 1
    limit = float(probe.surface[i, BUDGET])
    wave = float(probe.surface[i, AMPLITUDE]) * sin(float(probe.surface[i, PHASE]) * int(count[i, EXCITED]))
    surface[i, EXCITATION] = clip(wave, -limit, limit)
    s.clock[CALM] = 0


@inline
def silence(s: State, i: int) -> None:
    """No excitation of surface i from the next sample on."""
    s.count[i, EXCITED], s.count[i, HEARD] = 0, 0
    s.surface[i, EXCITATION], s.surface[i, EVIDENCE] = 0.0, 0.0
