"""Springs, dampers and friction of a file that `convert` wrote, as MuJoCo computes them."""

from __future__ import annotations

import numpy as np
import pytest

from hybridyn.structure.robot import joint_position
from tests.comparing import close_to
from tests.conversion.features import FEATURES
from tests.conversion.test_mujoco import SAME, Model, open_postures

#: Robots with a force in joints that MuJoCo has by the same names.
NAMES = [
    name
    for name, (_, robot) in FEATURES.items()
    if name.startswith(("spring", "damper", "viscous"))
    and not {joint.kind for joint in robot.joints} & {"planar", "floating"}
]


@pytest.mark.parametrize("name", NAMES)
def test_springs_and_dampers_act_as_stated(name: str) -> None:
    """MuJoCo's passive forces are -(damping v) - stiffness (x - rest), by the numbers of the description."""
    _, d = FEATURES[name]
    written, draw = Model(d), np.random.default_rng(4)
    robot, (q,) = written.robot, open_postures(written.robot, 1)
    v = draw.normal(size=robot.nv)
    dampers = dict(d.effects).get("damper", {}).get("coefficient", {})
    damping = {joint.name: joint.damping + dampers.get(joint.name, 0.0) for joint in d.joints}
    springs, expected = {spring.name: spring for spring in d.springs}, np.zeros(robot.nv)
    for one, to in zip(robot.joints, robot.v_slices, strict=True):
        expected[to] = -damping[one] * v[to]
        if spring := springs.get(one):
            expected[to] -= spring.stiffness * (float(joint_position(robot, q, one)) - spring.rest)
    written.place(q, v)
    assert np.abs(expected).max() > 0
    close_to(written.data.qfrc_passive[written.columns], expected, SAME)
