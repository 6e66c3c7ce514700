"""Read USD, the scene files of Omniverse, Isaac Sim and Newton, into plain records.

Start with `usd` (the order of the steps), then `opening` (OpenUSD composes the file in a process of its own,
which runs `worker`, `layers` and `dumping`), `stage` (the prims and their values), `screening` (what is
refused), and the modules that read prims: `bodies`, `masses`, `joints`, `driving`, `couplings`, `scenes` and
`homes`. `description.joint_graph` makes a tree of them.
"""
