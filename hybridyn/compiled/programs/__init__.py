"""Build the models of a whole robot as programs: calls of its modules' kernels.

Read `writer` (collects kernels and calls), `module_calls`, `inverse`, `direct`, `kinematics`,
`loop_kernels`, `close`, then `whole_robot` and `sources`. `built_beside` is a program in C, or run by CasADi
until it is built; `general` is the general path behind the programs. `model_calls` runs the models for
`CompiledRobot`, `postures` closes its loops, `designs` and `evaluating` those of many designs; `control`
joins both, and `walking` is the same for exported C and Warp.

May import: `equations`, `loops`, `code`, `program`, and what `compiled` may.
"""
