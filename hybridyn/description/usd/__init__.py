"""Read USD, the scene files of Omniverse, Isaac Sim and Newton, into plain records.

Start with `opening` (a process of its own reads the file), then `usd` (which files OpenUSD may read, and the
order of the steps, bodies), `stage` (the prims and their values), `schema` (what is read, noted or refused),
and `joints` (joints, couplings, home).
`description.joint_graph` makes a tree of them.
"""
