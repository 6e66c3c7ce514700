"""What controllers and optimisers need of a closed robot: its model in independent coordinates u.

    tau = M(q) u_dot + c(q, v) + g(q),    v = E(q) u

Read `independent` (which joints are u; E and its drift, module by module), `engine` (what an engine computes
at many states; the general path is one, compiled models are another), `model` (E and its rate, M, c, g, and C
with c = C u), `links` (Jacobians and inertias of links). `polar_forms` computes column by column what is
quadratic in the rates. `joint_map` relates motors and output joints, at postures of `assembly.posture`;
`regular_map` leaves out the singular ones.

May import: `dynamics` and below; `compiled` imports it.
"""
