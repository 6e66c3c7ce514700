"""Models of a robot inside learning frameworks, with exact gradients through its closed loops.

Read `functions` (a model as a function of three arrays, with what its derivatives do to weights and
directions), `charts` (coordinates of postures as they stand, and displacements), `robot` (the models of a
framework, written once), `joint_sides` (the map of output joints), then `torch_arrays` and `jax_arrays`: the
arrays of PyTorch and of JAX, and their own ways to name derivatives; `on_device` computes by kernels of Warp
where tensors of PyTorch lie. `creating` holds the public functions; nothing of a framework is imported before
its own one is called.

May import: `warp_batch` and below.
"""
