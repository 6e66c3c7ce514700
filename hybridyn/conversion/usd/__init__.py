"""Write USD (`.usda`) with UsdPhysics joints.

All is in `usd`: prims as text and bodies, then joints, closures, and the order of the prims.
"""
