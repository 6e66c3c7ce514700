"""Write USD (`.usda`) with UsdPhysics joints; numbers that single precision rounds have exact copies beside.

Start with `usd` (the order of the prims), then `prims` (prims as text, bodies) and `joints` (with closures).
"""
