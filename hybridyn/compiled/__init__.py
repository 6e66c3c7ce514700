"""One robot written out as straight-line C.

In the order of the data: `program` (what a written-out model consists of), the builders of programs from a
robot, `printing` (C source), `building` (compiler, cache), `library` (calls), `model` (what users hold).
"""
