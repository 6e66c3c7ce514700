"""Write USD (`.usda`) with UsdPhysics joints.

Start with `usd` (the order of the prims), then `prims` (prims as text, bodies) and `joints` (with closures).
"""
