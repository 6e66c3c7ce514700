"""Questions asked of a robot: is it sound, what does a motion need, what can it reach?

`check/` judges a model, `sizing` motors, `workspace/` what a module reaches, `effect_worth` each physical
effect, `cost/` error against time.

May import: `scenes`, `compiled` and below.
"""
