"""The oracle's trees, against Pinocchio's; tests of the package compare it with the oracle in all else.

Where the oracle is wrong these differ, since closed forms, Pinocchio and the paper judge the package, too.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Description, Joint, Link
from tests.comparing import ROUNDING, close_to, refused
from tests.files import save
from tests.judging import BASES
from tests.oracle import Base, Oracle
from tests.peers import describe, example_urdf

SHUFFLED = """
<robot name="shuffled">
  <joint name="j10" type="revolute"><parent link="hub"/><child link="c"/>
    <origin xyz="0 .2 0" rpy=".1 .2 .3"/><axis xyz="0 1 1"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="a_fixed" type="fixed"><parent link="hub"/><child link="flange"/>
    <origin xyz=".1 0 .1" rpy="1 0 0"/></joint>
  <joint name="z" type="prismatic"><parent link="c"/><child link="e"/>
    <origin xyz="0 0 .3"/><axis xyz="1 2 0"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="j2" type="continuous"><parent link="hub"/><child link="d"/>
    <origin xyz=".3 0 0"/><axis xyz="1 0 2"/></joint>
  <joint name="B" type="continuous"><parent link="flange"/><child link="f"/>
    <origin rpy="0 1 0"/><axis xyz="0 0 1"/></joint>
  <joint name="first" type="revolute"><parent link="base"/><child link="hub"/>
    <origin xyz="0 0 .5"/><axis xyz="0 1 0"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="a" type="planar"><parent link="d"/><child link="g"/>
    <origin xyz="0 0 .1"/><axis xyz="0 0 1"/></joint>
  <joint name="Z" type="floating"><parent link="d"/><child link="h"/><origin xyz="0 0 .1"/></joint>
  {links}
</robot>
""".replace(
    "{links}",
    "\n".join(
        f"""<link name="{name}"><inertial><origin xyz=".0{i} .1 -.0{i}" rpy=".{i} 0 1"/><mass value="1.{i}"/>
        <inertia ixx=".02" iyy=".03" izz=".04" ixy=".001" ixz=".002" iyz=".003"/></inertial></link>"""
        for i, name in enumerate(["g", "hub", "base", "c", "f", "d", "e", "flange", "h"])
    ),
)
TREES = {
    "shuffled": "", "ur5": "ur5_robot.urdf", "panda": "panda.urdf", "talos": "talos_reduced.urdf",
    "pr2": "pr2.urdf", "allegro": "allegro_left_hand.urdf",
}  # fmt: skip


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", TREES)
def test_trees_move_as_in_rnea(name: str, base: Base, tmp_path: Path) -> None:
    urdf = example_urdf(TREES[name]) if TREES[name] else save(tmp_path, SHUFFLED)
    free = [] if base == "fixed" else [pin.JointModelFreeFlyer()]
    description, model = describe(urdf), pin.buildModelFromUrdf(str(urdf), *free)
    oracle, data, rng = Oracle(description, base), model.createData(), np.random.default_rng(3)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    v, a = rng.normal(size=model.nv), rng.normal(size=model.nv)
    link = description.links[-1].name
    wrench = rng.normal(size=6)
    frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
    f_ext = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    f_ext[frame.parentJoint] = frame.placement.act(pin.Force(wrench))
    tau, missing = oracle.idm_and_missing(q, v, a, {link: wrench})
    Q = missing.copy()
    Q[oracle.motors] += tau
    skip = 6 if base == "moving" else 0  # what moves a prescribed base is no effort of the model
    close_to(Q[skip:], pin.rnea(model, data, q, v, a, f_ext)[skip:], ROUNDING)


def test_a_forced_motion_without_mass_is_refused_an_unforced_one_rests() -> None:
    base, rod = np.zeros((3, 3)), np.diag([0.0, 1.0, 1.0])
    links = (Link("base", 0.0, np.zeros(3), base), Link("rod", 1.0, np.array([0.3, 0, 0]), rod))
    joints = (Joint("spin", "revolute", "base", "rod", np.eye(4), np.array([1.0, 0, 0])),)
    oracle = Oracle(Description("spin", links, joints, motors=("spin",)))
    assert oracle.ddm([0.1], [0.2], [0.0]) == pytest.approx(0.0)
    refused(lambda: oracle.ddm([0.1], [0.2], [1.0]), ValueError, "without mass is forced")
