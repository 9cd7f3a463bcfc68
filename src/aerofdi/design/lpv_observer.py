"""Filters of method B: estimate the true aileron and elevator deflection from what the aircraft does.

`design_lpv_observer(aircraft, spec, progress) -> core.Design` makes two output-estimation filters, gain-scheduled over the
airspeed V and its rate Vdot (method B of the paper "vireo_comparison", section 3.2, Figures 4 to 7 and 10).

What a Design with method "lpv_observer" holds (all numbers SI and radians; arrays are float64, C order)
-------------------------------------------------------------------------------------------------------
`params` is a flat dictionary; the prefix is the axis, `lat.` (aileron) or `lon.` (elevator):

    lat.V       (N,)        airspeed nodes of the filter, m/s, increasing
    lat.A       (N, n, n)   filter  xF' = (A + Vdot * A_rate) xF + B y ,   deltahat = C xF + D y
    lat.A_rate  (N, n, n)   slope of A in Vdot, 1/(m/s^2) * 1/s; zero for LTI and nominal filters; B, C, D have none
    lat.B       (N, n, ny)
    lat.C       (N, 1, n)
    lat.D       (N, 1, ny)
    lon.*       the same; its own N and n

Measurements y, in this order: lat (phi_cmd, phi, p) in rad, rad, rad/s; lon (q) in rad/s. All are taken as they are: the trim
values of phi_cmd, phi, p and q are zero (wings level).
Output: lat: the aileron delta_a in rad; lon: the elevator delta_e in rad, both as DEVIATION FROM TRIM (trim aileron 0). The
true elevator is `trim.elevator` at the current V plus the estimate. Elevons follow from
delta_l = delta_e - delta_a, delta_r = delta_e + delta_a (`spec["mixing"]` = [[1, -1], [1, 1]] acting on [delta_e; delta_a]).

    trim.V          (N,)    m/s
    trim.elevator   (N,)    rad, elevator in level trimmed flight at that airspeed
    trim.alpha      (N,)    rad
    rate_bound      ()      m/s^2, |Vdot| <= this (8 for the Vireo); clip Vdot to it
    airspeed        (2,)    m/s, lowest and highest airspeed the filters were made for

The state is in one coordinate system over all nodes, so matrices are interpolated linearly in V between nodes (the
certificate is computed for exactly this interpolation). A filter of one node (N = 1) is LTI: use it at every airspeed.
Poles reach about -500 rad/s: discretise exactly (matrix exponential), never by Euler.

`spec` (plain numbers and strings): kind ("nominal_lti", "robust_lti", "nominal_lpv", "robust_lpv"), aircraft name, nominal airspeed, actuator (wn,
zeta, delay), controller gains, weights with numerators and denominators, psi_pole, backoff, basis degree, fault_weight.
`certificate` (plain numbers and strings, per axis): gamma, gamma_optimal, solver, status of both stages, largest scaled LMI eigenvalue on the
nodes and between them, `on_grid_only`, filter poles, wall-clock seconds.
`design.io.save_design(design, "x.toml")` writes x.toml (spec, certificate, names and shapes) and x.npz (arrays) beside it;
`load_design("x.toml")` reads them back.
"""
