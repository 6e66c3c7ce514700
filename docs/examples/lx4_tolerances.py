"""How exactly does the LX4 place its tip, if its 48 joint centres and 24 legs are not made exactly?

Each joint centre is displaced by normal errors of 0.1 mm along three axes, each leg is longer or shorter by
0.1 mm. Monte Carlo builds and assembles a robot for each sample of errors, with its motors where the ideal
robot has them. The linearised covariance takes one line of algebra for each leg; both must agree.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pictures import COLOURS, figure, options, plain, save, snapshots
from scipy.spatial.transform import Rotation

import hybridyn
from hybridyn.description import Description
from hybridyn.structure.building import build_robot

SIGMA = 1e-4  # of every error [m]
TIP = "m4_platform"
AXES = ("x", "y", "z", "about x", "about y", "about z")


def built(description: Description, random: np.random.Generator) -> Description:
    """Return a robot as it is made: joint centres displaced, and legs of other lengths."""
    joints = []
    for joint in description.joints:
        placement = joint.placement.copy()
        if joint.name.endswith(("_cross_y", "_wrist_mount")):  # a centre on the base, on the platform
            placement[:3, 3] += SIGMA * random.standard_normal(3)
        elif joint.name.endswith("_slide"):
            placement[2, 3] += SIGMA * random.standard_normal()
        joints.append(replace(joint, placement=placement))
    closures = []
    for closure in description.closures:  # a centre on the platform
        frame = closure.frame_a.copy()
        frame[:3, 3] += SIGMA * random.standard_normal(3)
        closures.append(replace(closure, frame_a=frame))
    return replace(description, joints=tuple(joints), closures=tuple(closures))


def poses(robot: hybridyn.HybridRobot, q: np.ndarray, links: list[str]) -> np.ndarray:
    """Return positions and quaternions of links in the world, shape (links, 7)."""
    rest = np.zeros((1, robot.nv))
    found = hybridyn.kinematics(robot, q[None], rest, rest, links=links)
    return np.array([found[name].pose[0] for name in links])


def linearised(robot: hybridyn.HybridRobot, q: np.ndarray) -> np.ndarray:
    """Compute the covariance of the tip's position and rotation, shape (6, 6), [m, rad], world axes.

    A leg from b to p along the unit vector u keeps its length: u (dx + dtheta x (p - x)) = dl + u db - u dp,
    where the right side has the variance 3 SIGMA^2. Six legs give the platform's displacement.
    """
    tip = poses(robot, q, [TIP])[0, :3]
    out = np.zeros((6, 6))
    for k in range(1, 5):
        legs = [f"m{k}_leg{i}" for i in range(1, 7)]
        b = poses(robot, q, [f"{leg}_cross" for leg in legs])[:, :3]
        p = poses(robot, q, [f"{leg}_rod" for leg in legs])[:, :3]
        u = (p - b) / np.linalg.norm(p - b, axis=1)[:, None]
        x = tip  # displacement of the tip as a point of this platform: all that follows moves with it
        J = np.hstack([u, np.cross(p - x, u)])
        half = np.linalg.solve(J, np.sqrt(3) * SIGMA * np.eye(6))
        out += half @ half.T
    return out


def displacement(ideal: np.ndarray, made: np.ndarray) -> np.ndarray:
    """Return displacement and small rotation from one pose to another, shape (6,), [m, rad], world axes."""
    turned = Rotation.from_quat(made[3:]) * Rotation.from_quat(ideal[3:]).inv()
    return np.concatenate([made[:3] - ideal[:3], turned.as_rotvec()])


def main(words: list[str] | None = None) -> None:
    """Sample robots, and compare their tips with the linearised covariance."""
    asked = options(__doc__, words, ("samples", 60, 4))
    ideal = hybridyn.load("lx4")
    motors = {name: (0.06 * np.sin(1.05 * i), 0.0, 0.0) for i, name in enumerate(ideal.motors)}
    q = hybridyn.assemble(ideal, motors=motors)[0]
    wanted = linearised(ideal, q)
    there = poses(ideal, q, [TIP])[0]
    errors = np.empty((asked.number, 6))
    for i, seed in enumerate(np.random.SeedSequence(1).spawn(asked.number)):
        robot = build_robot(built(ideal.description, np.random.default_rng(seed)))
        made = hybridyn.assemble(robot, motors=motors, guess=q)[0]
        errors[i] = displacement(there, poses(robot, made, [TIP])[0])
    drawn, predicted = errors.std(axis=0), np.sqrt(np.diag(wanted))
    for name, one, other in zip(AXES, drawn, predicted, strict=True):
        print(f"{name}: {one:.3g} by {asked.number} samples, {other:.3g} linearised")
    # The deviation of a sample is uncertain by 1 / sqrt(2 n); six of them stay within four times that.
    assert np.allclose(drawn, predicted, rtol=4 / np.sqrt(2 * asked.number), atol=0)

    picture = figure(8.4, 4.0)
    view = picture.add_axes((0.0, 0.02, 0.26, 0.92))
    snapshots([view], ideal, [q], turn=-0.9, lift=0.2)
    tips = picture.add_axes((0.34, 0.14, 0.28, 0.74))
    tips.plot(*(1e3 * errors[:, :2].T), ".", ms=3, color="#9aa3ad")
    angle = np.linspace(0, 2 * np.pi, 200)
    root = np.linalg.cholesky(wanted[:2, :2])
    for times in (1, 2, 3):
        tips.plot(*(1e3 * times * root @ [np.cos(angle), np.sin(angle)]), color=COLOURS[1], lw=1)
    tips.set_aspect("equal")
    plain(tips, "tip; 1, 2, 3 sigma linearised", "y [mm]", "x [mm]")
    bars = picture.add_axes((0.7, 0.14, 0.29, 0.74))
    scale = np.array([1e3] * 3 + [1e4] * 3)
    for shift, values, colour, label in (
        (-0.2, drawn, COLOURS[0], f"{asked.number} samples"), (0.2, predicted, COLOURS[1], "linearised")
    ):  # fmt: skip
        bars.bar(np.arange(6) + shift, scale * values, 0.38, color=colour, label=label)
    bars.set_xticks(range(6), AXES, rotation=30)
    bars.legend(fontsize=7, frameon=False)
    plain(bars, "standard deviations", "[mm], [0.1 mrad]", "")
    print(save(picture, asked, "lx4_tolerances"))


if __name__ == "__main__":
    main()
