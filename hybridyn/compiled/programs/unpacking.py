"""Numbers of the program of reactions, and the reactions that they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...dynamics.reactions import Reactions, undetermined
from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot


def computed_alone(robot: HybridRobot) -> str:
    """Return why the general path alone computes a robot's reactions, or ""."""
    for module in robot.modules:
        m = module.mechanism
        if m.reduction.rounded:
            return f"the redundant loops of module '{module.name}' are rounded"
        if m.spec.wrists and m.self_stresses:
            return f"module '{module.name}' has redundant loops and wrists that are cut"
    return ""


def sizes_of(module: Module) -> list[tuple[int, int]]:
    """Return the shape of each block of a module's numbers: its wrench, joints, closures and couplings."""
    columns, spec = 1 + module.mechanism.self_stresses, module.mechanism.spec
    joints = [(6, columns)] * (len(module.joints) + len(spec.closures))
    return [(6, 1), *joints, *[(1, columns)] * len(spec.couplings)]


def reactions_in(robot: HybridRobot, root: Array, of_modules: Sequence[Array]) -> Reactions:
    """Return the reactions from the outputs of the program, shapes (T, n)."""
    out = Reactions(root)
    for module, rows in zip(reversed(robot.modules), reversed(of_modules), strict=True):
        shapes = sizes_of(module)
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(rows, ends[:-1], axis=1)
        blocks = [x.reshape(len(rows), *shape) for x, shape in zip(parts, shapes, strict=True)]
        out.modules[module.name] = blocks[0][..., 0]
        joints, closed = blocks[1 : 1 + len(module.joints)], blocks[1 + len(module.joints) :]
        for i in (x for x in module.mechanism.spec.source if x is not None):  # the order of the general path
            name, block = module.joints[i], joints[i]
            out.joints[name], out.joints_shared[name] = block[..., 0], block[..., 1:]
        for name, block in zip(module.closures, closed, strict=True):
            out.closures[name] = block[..., 0]
            out.determined[name] = ~undetermined(block[..., 1:])
            out.unique[name] = bool(out.determined[name].all())
    return out
