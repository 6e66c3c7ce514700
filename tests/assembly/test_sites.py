"""Poses and rates of links that were asked for, as MuJoCo sees them: sites on its own model of the robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.conversion.convert import write
from hybridyn.conversion.request import ConversionRequest, Losses
from tests.assembly.aims import Aim, Array, random_aims
from tests.assembly.fitted import ANGLES, LENGTHS, WORLD
from tests.robots.as_written import WRITTEN
from tests.support.extras import needs
from tests.support.samples import slow

mujoco = needs("mjcf")

MET = 1e-10  # of positions [m, rad], and of rates relative to the largest
LATER = 0.02  # of an aim, whose rates are about one [s]
CASES = [(("excavator",), 1)]
CASES += [slow((name,), 20) for name in (*WRITTEN, "stewart_ur5", "scara_delta", "lx4", "gough_stewart")]


class Sites:
    """MuJoCo's model of a robot, with a site in each link between which something is asked.

    Attributes:
        model, data: The model and its data.
    """

    def __init__(self, robot: HybridRobot, links: set[str]) -> None:
        description = replace(robot.description, closures=(), couplings=())  # states are closed
        out = write(ConversionRequest(description, Path("robot.xml")), Losses())
        spec = mujoco.MjSpec.from_string(out.text)
        root = spec.body(description.root)
        if robot.base != "fixed":
            root.add_freejoint(name="root_joint")
            root.mass, root.inertia, root.explicitinertial = 1.0, np.ones(3), True  # it may have none
        for link in links - {WORLD}:
            (root if link == description.root else spec.body(link)).add_site(name=link)
        spec.worldbody.add_site(name=WORLD)
        self.robot, self.model = robot, spec.compile()
        self.data = mujoco.MjData(self.model)

    def place(self, q: Array, v: Array) -> None:
        """Set a state by the names of its joints."""
        m, d, robot = self.model, self.data, self.robot
        mujoco.mj_resetData(m, d)
        for name, kind, i, j in zip(robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            x, u, joint = q[i], v[j], m.joint(name)
            if kind == "continuous":
                x = np.array([np.arctan2(x[1], x[0])])
            if len(x) >= 4:
                x = np.r_[x[:-4], x[-1], x[-4:-1]]
            if len(x) == 7:  # the way of a free joint is in the world's axes
                u = np.r_[pin.Quaternion(x[3], *x[4:]).matrix() @ u[:3], u[3:]]
            d.qpos[joint.qposadr[0] :][: len(x)] = x
            d.qvel[joint.dofadr[0] :][: len(u)] = u
        mujoco.mj_forward(m, d)

    def _site(self, name: str) -> tuple[Array, Array, Array, Array]:
        """Return position, axes, velocity and angular velocity of a site, in the world."""
        m, d, number = self.model, self.data, self.model.site(name).id
        linear, angular = np.zeros((2, 3, m.nv))
        mujoco.mj_jacSite(m, d, linear, angular, number)
        return (
            d.site_xpos[number].copy(), d.site_xmat[number].reshape(3, 3).copy(),
            linear @ d.qvel, angular @ d.qvel,
        )  # fmt: skip

    def seen(self, link: str, other: str) -> tuple[Array, Array, Array, Array]:
        """Return the same of a link in another, in the other's axes."""
        (p, R, v, w), (p0, R0, v0, w0) = self._site(link), self._site(other)
        return R0.T @ (p - p0), R0.T @ R, R0.T @ (v - v0 - np.cross(w0, p - p0)), R0.T @ (w - w0)


def check(aim: Aim) -> None:
    """Compare what is asked of links a little later with what MuJoCo sees."""
    robot = aim.standing.robot
    q, v, _ = hybridyn.assemble(robot, guess=aim.standing.given(aim.x), **aim.asked(LATER))
    asked = [*aim.base, aim.target]
    sites = Sites(robot, {name for one in asked for name in (one.link, one.other)})
    sites.place(q, v)
    for one in asked:
        p, R, velocity, w = sites.seen(one.link, one.other)
        value, rate, _ = one.course(LATER)
        if one.names == ("pose",):
            goal, spin, _ = one.rotation(LATER)
            off, rates, wanted = (
                np.r_[p - value[:3], pin.log3(goal.T @ R)],
                np.r_[velocity, w],
                np.r_[rate[:3], spin],
            )
        else:
            angles = pin.rpy.matrixToRpy(R)
            turning = pin.rpy.computeRpyJacobianInverse(angles, pin.LOCAL_WORLD_ALIGNED) @ w
            rows = [(*LENGTHS, *ANGLES).index(name) for name in one.names]
            off = np.r_[p, angles][rows] - value
            turns = np.array(rows) >= 3
            off[turns] = (off[turns] + np.pi) % (2 * np.pi) - np.pi
            rates, wanted = np.r_[velocity, turning][rows], rate
        assert np.abs(off).max() < MET
        assert np.abs(rates - wanted).max() < MET * max(1.0, np.abs(wanted).max())
    for one in aim.joints:
        at = sites.model.joint(one.link)
        assert abs(sites.data.qpos[at.qposadr[0]] - one.course(LATER)[0][0]) < MET


@pytest.mark.parametrize(("names", "count"), CASES)
def test_links_are_where_they_were_asked_for_and_move_as_asked(names: tuple[str, ...], count: int) -> None:
    for aim in random_aims(names, count):
        check(aim)
