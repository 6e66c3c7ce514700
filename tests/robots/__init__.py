"""What tests run on: random mechanisms, robots as texts, the shipped robots, and states of them.

Read `sketch` (lay out a mechanism in the world), `parts` and `recipes` (what is drawn), `mechanisms` (of
known mobility), `generated` (of clear rank), `any_mechanism` (of any rank).
"""
