"""Write MJCF, for MuJoCo.

Start with `mjcf` (the order of the elements), then `bodies` (links and joints), `inertias`, `closures` with
`followers` (closures that MuJoCo has no word for), `couplings`, `forces`, `softness` and `visuals`.
"""
