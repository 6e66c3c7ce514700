"""What controllers and optimisers need of a closed robot: its model in independent coordinates u.

    tau = M(q) u_dot + c(q, v) + g(q),    v = E(q) u

Read `independent` (which joints are u; E and its drift, module by module), `engine` (what an engine computes
at many states; the general path is one, compiled models are another), `model` (E and its rate, M, c, g, and C
with c = C u), `links` (Jacobians and inertias of links). `joint_map` relates motors and output joints, at
postures of `assembly.posture`.

May import: `dynamics` and below; `compiled` imports it.
"""
