"""Write USD (`.usda`) with UsdPhysics joints.

Read `prims` (prims as text, bodies), then `usd` (joints, closures, the order of the prims).
"""
