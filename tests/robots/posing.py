"""What a state on the spanning tree says of motors and platforms, in the words that `assemble` takes.

Poses come from Pinocchio's model of the spanning tree, which knows nothing of modules.
"""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from hybridyn import HybridRobot

Triple = tuple[np.ndarray, np.ndarray, np.ndarray]


def position(robot: HybridRobot, joint: str, q: np.ndarray) -> np.ndarray:
    """Return a joint's angle or length from q, shape (..., nq)."""
    number = robot.joints.index(joint)
    x = q[..., robot.q_slices[number]]
    return np.arctan2(x[..., 1], x[..., 0]) if robot.kinds[number] == "continuous" else x[..., 0]


def of_joints(
    robot: HybridRobot, q: np.ndarray, v: np.ndarray, a: np.ndarray, joints: Iterable[str] | None = None
) -> dict[str, Triple]:
    """Return positions, rates and accelerations of joints, the motors where left out."""
    out = {}
    for joint in robot.motors if joints is None else joints:
        at = robot.v_slices[robot.joints.index(joint)].start
        out[joint] = (position(robot, joint, q), v[..., at], a[..., at])
    return out


def of_link(robot: HybridRobot, q: np.ndarray, v: np.ndarray, a: np.ndarray, link: str, other: str) -> Triple:
    """Return a link's pose, velocity and classical acceleration as seen from another link, whose axes turn.

    Shapes (T, 7), (T, 6), (T, 6).
    """
    data = robot.model.createData()
    rows = []
    for x, x_dot, x_ddot in zip(q, v, a, strict=True):
        pin.forwardKinematics(robot.model, data, x, x_dot, x_ddot)
        pin.updateFramePlacements(robot.model, data)
        frames = [robot.model.getFrameId(name, pin.BODY) for name in (link, other)]
        M, B = (data.oMf[f] for f in frames)
        (V, VB), (A, AB) = (
            [get(robot.model, data, f, pin.LOCAL) for f in frames]
            for get in (pin.getFrameVelocity, pin.getFrameAcceleration)
        )
        seen = B.actInv(M)
        relative = V - seen.actInv(VB)
        rate = A - seen.actInv(AB) + relative.cross(V)  # of the relative twist, in the link's own axes
        w, linear = relative.angular, relative.linear
        classical = rate.linear + np.cross(w, linear)
        pose = np.concatenate([seen.translation, pin.Quaternion(seen.rotation).coeffs()])
        parts = (linear, w, classical, rate.angular)
        velocity_and_acceleration = [seen.rotation @ part for part in parts]
        rows.append(
            (
                pose,
                np.concatenate(velocity_and_acceleration[:2]),
                np.concatenate(velocity_and_acceleration[2:]),
            )
        )
    pose, velocity, acceleration = (np.array(part) for part in zip(*rows, strict=True))
    return pose, velocity, acceleration


def far_apart(robot: HybridRobot, q0: np.ndarray, q1: np.ndarray) -> float:
    """Return the largest joint step between two batches of postures, turns and signs of quaternions apart."""
    return float(max(np.abs(pin.difference(robot.model, x, y)).max() for x, y in zip(q0, q1, strict=True)))


#: Values, rates and accelerations of coordinates by name.
Coordinates = tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]
#: Coordinates of a link's pose that determine the posture of the first module, by shipped robot.
COORDINATES = {
    "five_bar": {"m1_tool": ("x", "z")},
    "delta": {"m1_platform": ("x", "y", "z")},
    "rps3": {"m1_platform": ("z", "roll", "pitch")},
    "tanev": {"m1_platform": ("z", "roll", "pitch")},
}


def swaying(robot: HybridRobot, phase: np.ndarray, size: float = 0.02) -> dict[str, Coordinates]:
    """Return waves of some coordinates about the home posture, of a shipped robot.

    Args:
        robot: The robot.
        phase: Angles of the wave, shape (T,); rates are those per radian of it.
        size: Amplitude [m, rad].
    """
    still = np.zeros((1, robot.nv))
    out = {}
    for link, names in COORDINATES[robot.description.name].items():
        pose = of_link(robot, robot.home[None], still, still, link, robot.description.root)[0][0]
        R = pin.Quaternion(pose[6], *pose[3:6]).matrix()
        home = dict(
            zip(("x", "y", "z", "roll", "pitch"), [*pose[:3], *pin.rpy.matrixToRpy(R)[:2]], strict=True)
        )
        waves = [
            (i, name, size * np.sin(phase + i), size * np.cos(phase + i)) for i, name in enumerate(names)
        ]
        out[link] = (
            {name: home[name] + wave - size * np.sin(i) for i, name, wave, _ in waves},
            {name: slope for _, name, _, slope in waves},
            {name: -wave for _, name, wave, _ in waves},
        )
    return out
