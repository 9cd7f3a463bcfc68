"""Does this surface still move the aircraft? The actuator health evaluators (AHE) of section 3.4, and the excitation.

The controller answers an excitation delta_s = A sin(omega t) of a sound surface by moving its command delta_c the other
way. Two evaluators measure how much of that answer is there:

rectified (17)   Lambda = LP_i3 | delta_s(k - lambda) + (delta_c - mean)(k) / kappa |
synchronous      Lambda = 2A/pi (1 - Re(Rbar / R0)),   Rbar: mean over the test of R = C / E, C and E the Fourier
                 coefficients of delta_c and delta_s at omega over the last N samples (whole periods)

fused            Lambda = 2A/pi times the inverse-variance mean of 1 - Re(Rbar / R0) and Re(Qbar / Q0), Q the ratio of
                 the filter's residual to the excitation at omega, Q0 that of a surface that does not move

0 = answers as a sound surface, 2A/pi (20) = does not answer. kappa and R0 are measured on the healthy closed loop (the
paper has kappa = 1). kappa is needed because two twins share the work: with both sound each answers at most half of A;
with the twin stuck, nearly all of A. The synchronous one ignores noise at all other frequencies, lets several surfaces
be tested at once at different frequencies, and gives the remaining effectiveness e of one surface with h sound twins:

    R/(1 + R) = -e L1 / (1 + h L1),   L1: loop gain through one such surface at omega

Not modelled: twins of unlike effect, and groups coupled through two axes (elevons), where e is approximate.
"""

from __future__ import annotations

from ..core import Array
from ..parts.ops import clip, jit, maximum, pi, sin, sqrt
from .smac_types import CALM, FUSED, INDEX, RECTIFIED, Params, Probe, State


@jit
def watch_commands(probe: Probe, s: State, z: Array, first: int, n: int) -> None:
    """Mean removal, noise filter and the window of every command; z[first:] holds n commands and n excitations."""
    N = probe.window
    j = int(s.clock[INDEX]) % N
    for i in range(n):
        c, e = float(z[first + i]), float(z[first + n + i])
        mean = float(s.mean[i])
        mean += probe.a_mean * (c - mean)
        s.mean[i] = mean
        high = c - mean
        noise = float(s.noise[i])
        s.noise[i] = noise + probe.a_noise * (high - noise)
        dc, de = high - float(s.ring_c[i, j]), e - float(s.ring_s[i, j])
        s.ring_c[i, j], s.ring_s[i, j] = high, e
        cosine, sine = float(probe.cosine[j, i]), float(probe.sine[j, i])
        s.sums[i, 0] += dc * cosine
        s.sums[i, 1] += dc * sine
        s.sums[i, 2] += de * cosine
        s.sums[i, 3] += de * sine
        dr = float(s.residual[probe.axis[i]]) - float(s.ring_r[probe.axis[i], j])
        s.sums[i, 4] += dr * cosine
        s.sums[i, 5] += dr * sine
    for i in range(3):
        s.ring_r[i, j] = s.residual[i]


@jit
def listen(probe: Probe, s: State, a_ambient: float) -> None:
    """Without excitation: how much commands and residuals move at the test frequencies by themselves (ambient)."""
    scale = 2.0 / probe.window
    for i in range(len(s.ambient)):
        for j in range(2):
            c, d = scale * float(s.sums[i, 4 * j]), scale * float(s.sums[i, 4 * j + 1])
            s.ambient[i, j] += a_ambient * (c * c + d * d - float(s.ambient[i, j]))


@jit
def _rectified(probe: Probe, s: State, i: int) -> None:
    """(17): the AHE of the paper; the answer is what Lambda leaves of 2A/pi."""
    N = probe.window
    delayed = float(s.ring_s[i, (int(s.clock[INDEX]) - int(probe.lag[i])) % N])
    gap = abs(delayed + float(s.noise[i]) / float(probe.reply[i]))
    s.lam[i] += probe.a_lambda * (gap - float(s.lam[i]))
    s.count[i] += 1


@jit
def _synchronous(probe: Probe, s: State, i: int, tracking: bool) -> None:
    """Average R and Q over the test (while tracking: over its last moments) and turn them into Lambda."""
    N = probe.window
    if s.excited[i] < N + probe.lag[i]:
        return
    ec, es = float(s.sums[i, 2]), float(s.sums[i, 3])
    power = ec * ec + es * es
    if power < (0.1 * N * probe.amplitude[i]) ** 2:
        return
    s.count[i] += 1
    share = 1.0 / s.count[i]
    if tracking:
        share = maximum(share, probe.a_track)
    cc, cs = float(s.sums[i, 0]), float(s.sums[i, 1])
    s.answer[i, 0] += share * ((cc * ec + cs * es) / power - float(s.answer[i, 0]))
    s.answer[i, 1] += share * ((cc * es - cs * ec) / power - float(s.answer[i, 1]))
    rc, rs = float(s.sums[i, 4]), float(s.sums[i, 5])
    s.witness[i, 0] += share * ((rc * ec + rs * es) / power - float(s.witness[i, 0]))
    s.witness[i, 1] += share * ((rc * es - rs * ec) / power - float(s.witness[i, 1]))
    lost = 1.0 - projection(s.answer[i], probe.healthy[i])
    if probe.method == FUSED:
        a, b = _variance(probe, s, i, 0), _variance(probe, s, i, 1)
        lost = (b * lost + a * projection(s.witness[i], probe.dead[i])) / (a + b) if a + b > 0.0 else lost
    s.lam[i] = 2.0 * probe.amplitude[i] / pi * maximum(lost, 0.0)


@jit
def _variance(probe: Probe, s: State, i: int, which: int) -> float:
    """Variance of one window's loss from the command (0) or the residual (1): what they do without excitation."""
    reference = probe.healthy if which == 0 else probe.dead
    size = float(reference[i, 0]) ** 2 + float(reference[i, 1]) ** 2
    return 0.5 * float(s.ambient[i, which]) / (float(probe.amplitude[i]) ** 2 * size)


@jit
def projection(measured: Array, reference: Array) -> float:
    """Re(measured / reference) of two complex numbers given as (2,)."""
    a, b, c, d = float(measured[0]), float(measured[1]), float(reference[0]), float(reference[1])
    return (a * c + b * d) / (c * c + d * d)


@jit
def remaining(probe: Probe, s: State, i: int) -> float:
    """Effectiveness left of surface i, 0 to about 1, from its averaged answer and the number of sound twins."""
    if probe.method == RECTIFIED:
        return clip(1.0 - s.lam[i] * pi / (2.0 * probe.amplitude[i]), 0.0, 1.0)
    sound = 0
    for j in range(len(s.label)):
        if j != i and probe.axis[j] == probe.axis[i] and s.label[j] == 0:
            sound += 1
    a, b = float(s.answer[i, 0]), float(s.answer[i, 1])
    lr, li = float(probe.loop[i, 0]), float(probe.loop[i, 1])
    # rho = R / (1 + R), then e = -Re(rho (1 + h L1) / L1).
    size = (1.0 + a) * (1.0 + a) + b * b
    rr, ri = (a * (1.0 + a) + b * b) / size, b / size
    top = lr * lr + li * li
    gr, gi = (lr + sound * top) / top, -li / top
    return clip(-(rr * gr - ri * gi), 0.0, 2.0)


@jit
def evaluate_health(probe: Probe, s: State, tracking: bool) -> None:
    """One sample of the AHE of every surface under excitation."""
    for i in range(len(s.excited)):
        if s.excited[i] > 0:
            if probe.method == RECTIFIED:
                _rectified(probe, s, i)
            else:
                _synchronous(probe, s, i, tracking)


@jit
def loss_std(probe: Probe, s: State, i: int) -> float:
    """Standard deviation of the lost share after the windows averaged so far (0 for the rectified evaluator)."""
    if probe.method == RECTIFIED or s.count[i] == 0:
        return 0.0
    one = _variance(probe, s, i, 0)
    if probe.method == FUSED:
        b = _variance(probe, s, i, 1)
        one = one * b / (one + b) if one + b > 0.0 else 0.0
    return sqrt(one / (1.0 + float(s.count[i]) / probe.window))


@jit
def doubt(p: Params, s: State, i: int) -> float:
    """The same as a standard deviation of Lambda, rad."""
    return 2.0 * p.probe.amplitude[i] / pi * loss_std(p.probe, s, i)


@jit
def excite(p: Params, s: State, i: int) -> None:
    """delta_s = A sin(omega t) of (14) for the next sample, never beyond the budget."""
    if s.excited[i] == 0:
        s.lam[i] = 0.0
        s.answer[i, 0], s.answer[i, 1] = 0.0, 0.0
        s.witness[i, 0], s.witness[i, 1] = 0.0, 0.0
        s.count[i], s.hold[i] = 0, 0
    s.excited[i] += 1
    limit = p.budget.amplitude[i]
    s.excitation[i] = clip(p.probe.amplitude[i] * sin(p.probe.phase[i] * s.excited[i]), -limit, limit)
    s.clock[CALM] = 0


@jit
def quiet(s: State) -> None:
    """No excitation from the next sample on."""
    for i in range(len(s.excited)):
        s.excited[i] = 0
        s.excitation[i] = 0.0
