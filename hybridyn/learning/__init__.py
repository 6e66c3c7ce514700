"""Models of a robot inside learning frameworks, with exact gradients through its closed loops.

Read `functions` (a model as a function of three arrays, with what its derivatives do to weights and
directions), `charts` (coordinates of postures as they stand, and displacements), `robot` (the models of a
framework, written once), `joint_sides` (the map of output joints), then `torch_arrays`: the arrays of
PyTorch, and its own way to name derivatives. `creating` holds the public function; nothing of PyTorch is
imported before it is called.

May import: `compiled` and below.
"""
