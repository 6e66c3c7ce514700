"""Second derivatives of the models, as programs made from programs.

Read `activity` (which numbers matter), `simplified` (a kernel with the operations that its C has), `twice`
(one kernel, differentiated back and then along a direction), `mirrored` (a program with the changes of its
numbers), `products` (a whole program as `twice`), `rates` (a program along a path, to second order), `paths`
(models whose posture is moved, over joints or over motors), `models` (what each model takes and returns, and
what writes it), `programs`, `prepared` (one program, built and called), `asking` (what is given and
returned), `places` (where it stands in programs) and `smooth` (which effects are differentiated), then
`derivatives` (`hybridyn.SecondDerivatives`).

May import: what `compiled` may.
"""
