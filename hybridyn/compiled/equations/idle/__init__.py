"""The idle motions of modules: their spins.

A rod between two balls turns about its axis, which moves no output, motor or centre of mass: it spins. Other
folders know of motions, of which the idle ones come first, and ask here what these do. Read `motion` (where
spins are), `inertia` (whether they have any), `legs` and `cores` (how the models treat them), `over_motors`
(what remains where joints follow motors), and `least` (the least of them, where postures follow what is
given).
"""
