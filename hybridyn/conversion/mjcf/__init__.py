"""Write MJCF, for MuJoCo.

Start with `mjcf` (the order of the elements), then `bodies` (links and joints), `inertias`, `closures` with
`followers` (closures that MuJoCo has no word for), `couplings`, `forces`, `softness` and `visuals`.

A closure that MuJoCo holds by several elements, or by a body of its own, is named in `<custom>`, so that
`description.mjcf.marks` reads back the same closure.
"""
