"""What other engines make of a robot: freedoms, closures held, softened or ignored, errors.

Reading order: `peer_engine` (what an engine must do here), `engines/` (Pinocchio, MuJoCo), `states` (closed
states to compare at), `judging` (what becomes of each closure), and `compare` (the whole, and its table).
`methods` is what `hybridyn cost` and the benchmarks sweep.
"""
