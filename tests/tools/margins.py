"""Print how far every shipped trajectory keeps from singular postures, as models/<robot>/README.md states.

The margin of a parallel module at a posture is the reciprocal condition number of the N x N matrix that maps
the motion of its platform relative to its base to the rates of its motors. The motion is a twist (linear
velocity, and angular velocity times a length of the module), written in an orthonormal basis of the twists
that the loops allow. The margin of a trajectory is the smallest over its rows and the robot's modules. 0 is
singular, 1 isotropic. Motions and twists come from `tests.oracle`, postures from `hybridyn.assemble`.

    python -m tests.tools.margins              every robot
    python -m tests.tools.margins lx4 snake    these only
"""

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hybridyn
from hybridyn.structure.module import Module
from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from hybridyn.tables.trajectory import read_motions
from tests import ROOT
from tests.oracle import Oracle
from tests.oracle.tree import Posture

Array = NDArray[np.float64]

EVERY = 10  # rows from one posture to the next: the motions are smooth
NOTHING = 1e-7  # relative size under which a twist is no motion of the platform


#: The platform of each parallel module, and the length that makes metres of radians [m], 1 for a Delta, whose
#: platform does not turn.
PARTS: dict[str, dict[str, float]] = {
    "gough_stewart": {"m1_platform": 0.32},
    "lx4": {f"m{k}_platform": 0.18 for k in range(1, 5)},
    "rps3": {"m1_platform": 0.2},
    "five_bar": {"m1_tool": 0.0},
    "delta": {"m1_platform": 1.0},
    "tanev": {"m1_platform": 0.2, "m2_platform": 0.14},
    "stewart_ur5": {"m1_platform": 0.32},
    "scara_delta": {"m1_platform": 1.0},
    "snake": {f"m{k}_platform": 0.05 for k in range(1, 13)},
}


def load(name: str) -> hybridyn.HybridRobot:
    """Load a shipped robot as its trajectory wants it: the snake's table moves the base too."""
    path = ROOT / "urdf" / f"{name}.urdf.xacro"
    return hybridyn.load(path, base="moving" if name == "snake" else "fixed")


def states(robot: hybridyn.HybridRobot, name: str, every: int = 1) -> tuple[Array, Array, Array]:
    """Assemble the trajectory of a shipped robot, every row or every n-th.

    Returns:
        q, v, a on the spanning tree, shapes (samples, nq), (samples, nv), (samples, nv).
    """
    path = ROOT / "models" / name / "traj.csv"
    with open_table(path, block_rows=10_000) as table:
        layout = read_layout(
            table.columns, robot.description, motors=robot.motors, base=robot.base, file=str(path)
        )
        (motion,) = read_motions(table, layout)
    motors, platforms = thinned(motion.joints, every), thinned(motion.platforms, every)
    return hybridyn.assemble(robot, motors=motors, platforms=platforms)


def thinned(signals: Mapping[str, tuple[Any, ...]], every: int) -> dict[str, tuple[Any, ...]]:
    """Keep every n-th row of positions and rates, given as arrays or as arrays by coordinate."""
    return {
        name: tuple(
            {c: values[::every] for c, values in level.items()} if isinstance(level, dict) else level[::every]
            for level in levels
        )
        for name, levels in signals.items()
    }


def velocity(posture: Posture, link: str) -> Array:
    """Return the twist of a link's origin for each tree velocity, shape (6, nv), world axes."""
    frame = posture.links[link]
    twist = posture.G[6 * frame.body :][:6]
    return np.vstack([twist[:3] + np.cross(twist[3:].T, frame.r).T, twist[3:]])


def margin(oracle: Oracle, q: Array, module: Module, platform: str, length: float) -> float:
    """Return the margin of one module at one posture, shape (nq,)."""
    posture = oracle.posture(q)
    motions = oracle.unit[:, None] * posture.Z
    relative = velocity(posture, platform) - velocity(posture, module.base)
    between = posture.links[platform].x - posture.links[module.base].x
    relative[:3] -= np.cross(velocity(posture, module.base)[3:].T, between).T
    relative[3:] *= length
    _, sizes, basis = np.linalg.svd(relative @ motions, full_matrices=False)
    count = int(np.sum(sizes > NOTHING * sizes[0]))
    rates = motions[[oracle.coordinates[motor][2].start for motor in module.motors]]
    values = np.linalg.svd(rates @ basis[:count].T / sizes[:count], compute_uv=False)
    return float(values[-1] / values[0])


def smallest_margin(name: str, every: int = EVERY) -> float:
    """Return the margin of a robot's trajectory."""
    robot = load(name)
    oracle = Oracle(robot.description, robot.base)
    postures = states(robot, name, every)[0]
    parallel = [module for module in robot.modules if module.closures]
    parts = list(zip(parallel, PARTS[name].items(), strict=True))
    return min(margin(oracle, q, module, *part) for q in postures for module, part in parts)


if __name__ == "__main__":
    for robot_name in sys.argv[1:] or PARTS:
        print(f"{robot_name:15s} {smallest_margin(robot_name):.4f}")
