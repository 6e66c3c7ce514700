"""Build the models of a whole robot as programs: calls of its modules' kernels.

Read `writer` (collects kernels and calls), `module_calls`, `inverse`, `direct`, `kinematics`,
`loop_kernels`, `close`, then `whole_robot` and `sources`. `general` is the general path behind the programs.
`postures` closes loops for `CompiledRobot`, `designs` and `evaluating` those of many designs; `control` joins
it with the inverse model, and `walking` is the same for exported C and Warp.

May import: `equations`, `code`, `program`, and what `compiled` may.
"""
