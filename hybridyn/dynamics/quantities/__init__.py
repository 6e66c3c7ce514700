"""What controllers and optimisers need of a closed robot: its model in independent coordinates u.

    tau = M(q) u_dot + c(q, v) + g(q),    v = E(q) u

Read `coordinates` (which joints are u), `independent` (E and its drift, module by module), `motion_map` (E
and its rate), `mass_matrix` (M), `bias` (c and g), `coriolis_matrix` (C with c = C u), `link_jacobian`,
`operational_inertia`. `joint_map` relates motors and output joints, at postures that `posture` assembles.
`polar` differentiates what is quadratic in the rates.

May import: `dynamics` and below; `compiled` imports it.
"""
