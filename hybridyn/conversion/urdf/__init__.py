"""Write URDF, with closures and couplings in hybridyn's own elements, and the files beside it.

Start with `urdf` (the order of the elements), then `closures`, `couplings` and `visuals`.
"""
