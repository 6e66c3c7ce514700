"""Second derivatives of the models, as programs made from programs.

Read `activity` (which numbers matter), `twice` (one kernel, differentiated back and then along a direction),
`products` (a whole program so), `rates` (a program along a path, to second order), `paths` (models whose
posture is moved, over joints or over motors), `programs`, then `derivatives`
(`hybridyn.SecondDerivatives`).

May import: what `compiled` may.
"""
