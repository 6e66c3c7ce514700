"""What `tests.digests` asks of a robot at given states: a list of calls, each of which gives numbers."""

from collections.abc import Callable
from typing import Any

import numpy as np

import hybridyn

#: Models of a state, by name: functions of the robot and its q, v, a, tau.
Model = Callable[[hybridyn.HybridRobot, np.ndarray, np.ndarray, np.ndarray, np.ndarray], Any]


def last(robot: hybridyn.HybridRobot) -> str:
    """Return the link that the last module moves."""
    return robot.modules[-1].label


def pushed(robot: hybridyn.HybridRobot) -> dict[str, np.ndarray]:
    """Return a wrench on the last link."""
    return {last(robot): np.array([3.0, -2.0, 1.0, 0.5, 0.4, -0.3])}


def positions_of_motors(r: hybridyn.HybridRobot, *given: np.ndarray) -> dict[str, tuple[np.ndarray, ...]]:
    """Return positions, rates and accelerations of the motors that have one coordinate."""
    q, v, a = given
    at = {name: (r.q_slices[i], r.v_slices[i].start) for name, i in r.joint_index.items() if name in r.motors}
    return {name: (q[:, p.start], v[:, i], a[:, i]) for name, (p, i) in at.items() if p.stop - p.start == 1}


def by_platforms(r: hybridyn.HybridRobot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Any:
    """Assemble from the poses of all outputs, each relative to what carries it."""
    moved = hybridyn.kinematics(r, q, v, a)
    labels = [module.label for module in r.modules if module.outputs]
    asked = {name: (moved[name].pose, moved[name].twist, moved[name].acceleration) for name in labels}
    return hybridyn.assemble(r, platforms=asked, guess=q[0])


#: What any robot is asked.
FEW: dict[str, Model] = {
    "closures": lambda r, q, v, a, tau: hybridyn.closure_residual(r, q),
    "idm": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a),
    "idm solved": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a, passive="solved"),
    "idm least": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a, on_singular="least-norm"),
    "idm pushed": lambda r, q, v, a, tau: hybridyn.idm(
        r, q, v, a, wrenches=pushed(r), reactions=True, passive="solved"
    ),
    "ddm": lambda r, q, v, a, tau: hybridyn.ddm(r, q, v, tau),
    "ddm pushed": lambda r, q, v, a, tau: hybridyn.ddm(r, q, v, tau, wrenches=pushed(r), reactions=True),
    "delassus": lambda r, q, v, a, tau: hybridyn.delassus(r, q, last(r)),
    "kinematics": lambda r, q, v, a, tau: hybridyn.kinematics(r, q, v, a, [last(r)]),
}
#: What a shipped robot on the ground is asked.
MODELS: dict[str, Model] = FEW | {
    "idm effects": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a, effects="model", passive="solved"),
    "ddm effects": lambda r, q, v, a, tau: hybridyn.ddm(r, q, v, tau, effects="model"),
    "all links": lambda r, q, v, a, tau: hybridyn.kinematics(r, q, v, a),
    "assemble motors": lambda r, q, v, a, tau: hybridyn.assemble(
        r, motors=positions_of_motors(r, q, v, a), guess=r.home
    ),
    "assemble platforms": lambda r, q, v, a, tau: by_platforms(r, q, v, a),
    "mass matrix": lambda r, q, v, a, tau: hybridyn.mass_matrix(r, q),
    "bias": lambda r, q, v, a, tau: hybridyn.bias(r, q, v),
    "motion map": lambda r, q, v, a, tau: hybridyn.motion_map(r, q, v),
    "coriolis matrix": lambda r, q, v, a, tau: hybridyn.coriolis_matrix(r, q, v),
    "link jacobian": lambda r, q, v, a, tau: hybridyn.link_jacobian(r, q, last(r)),
    "energy": lambda r, q, v, a, tau: hybridyn.energy(r, q, v, effects="model"),
    "power": lambda r, q, v, a, tau: hybridyn.power(r, q, v, tau, effects="model"),
    "momentum": lambda r, q, v, a, tau: hybridyn.momentum(r, q, v),
    "simulate": lambda r, q, v, a, tau: hybridyn.simulate(
        r, q[0], v[0], (0.0, 0.1), method="rk4", step=1e-3, initial_velocity="project"
    ),
}
