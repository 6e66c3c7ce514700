"""Read USD, the scene files of Omniverse, Isaac Sim and Newton, into plain records.

Start with `usd` (the order of the steps), then `opening` (OpenUSD composes the file in a process of its own,
which runs `worker`, `layers` and `dumping`), `stage` (the prims and their values), `screening` (what is
refused), and the modules that read prims:
`bodies`, `masses` with `shapes`, `joints`, `graph` (which joints close loops), `trees` (joints and closures
as records), `driving`, `mimics`, `scenes` and `homes`.
"""
