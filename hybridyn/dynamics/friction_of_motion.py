"""How the wrenches of joints answer to friction under a given motion, module by module.

Motors balance friction in their own module, and accelerations stay as they are. So a module's wrenches answer
to its own joints alone, H = -D n - tau, with the efforts tau that Psi^T (D n + tau) = 0 asks for.
"""

from __future__ import annotations

import numpy as np

from ..effects.load_friction import OnLoads
from ..spatial import Array
from ..structure.robot import HybridRobot
from .actuation import Sharing
from .backward import MotionOfModules, efforts_along
from .joint_wrenches import joint_wrenches, needed_of_closures
from .reactions import multipliers_of


def answers_to_friction(
    robot: HybridRobot, given: MotionOfModules, law: OnLoads, D: Array, sharing: Sharing
) -> Array:
    """Compute the wrenches that unit frictions cause.

    Whether motors drive every motion is not checked: the efforts under all loads tell.

    Args:
        given: The motion of the robot's modules.
        law: The law and its joints.
        D: Efforts per unit of each joint's friction, shape (T, nv, joints).
        sharing: How the load is distributed among motors.

    Returns:
        Shape (T, joints, 6, joints).
    """
    T, count = len(D), len(law.joints)
    out, least = np.zeros((T, count, 6, count)), np.zeros(T)
    owner = np.array([robot.module_of(name) for name in law.joints])
    for k, s in enumerate(given.states):
        m, module, joints = s.mechanism, s.module, np.flatnonzero(owner == k)
        if not len(joints):
            continue
        basis = given.motions(k)
        H = -m.cut.to_tree(D[:, module.v_index][:, :, joints])
        for i in range(len(joints)):
            efforts = efforts_along(robot, s, basis, H[:, :, i], least + np.inf, least, sharing)
            H[:, module.motor_columns, i] -= efforts
        wrenches = joint_wrenches(s, needed_of_closures(s, multipliers_of(s, H)[0]))
        at = [m.spec.source.index(module.joints.index(law.joints[j])) for j in joints]
        out[np.ix_(np.arange(T), joints, np.arange(6), joints)] = wrenches[:, at]
    return out
