"""The oracle's trees, against Pinocchio's; tests of the package compare it with the oracle in all else.

Where the oracle is wrong these differ, since closed forms, Pinocchio and the paper judge the package, too.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Closure, Description, Joint, Link
from tests.judges.judging import BASES, drawn
from tests.judges.peers import describe, example_urdf
from tests.oracle import Base, Oracle
from tests.robots.sketch import CLOSURES, Sketch
from tests.support.comparing import ROUNDING, close_to, refused
from tests.support.files import save

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


@pytest.mark.parametrize("kind", CLOSURES)
def test_closures_hold_what_their_record_says(kind: str) -> None:
    """Move B from a closed placement: something is missed except along what the record leaves free."""
    translations, rotation = CLOSURES[kind]
    rng, pi = np.random.default_rng(0), np.pi
    frames = [pin.exp6(rng.normal(size=6)).homogeneous for _ in range(2)]
    closure = Closure("c", kind, "base", frames[0], "body", frames[1], translations, rotation)
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in ("base", "body"))
    joint = Joint("j", "floating", "base", "body", np.eye(4), np.array([0.0, 0.0, 1.0]))
    oracle = Oracle(Description("two", links, (joint,), (closure,)))

    def missed(A_to_B: pin.SE3) -> float:
        body = pin.SE3(frames[0]) * A_to_B * pin.SE3(frames[1]).inverse()
        return float(np.abs(oracle.residual(pin.SE3ToXYZQUAT(body))).max(initial=0.0))

    z = np.array([0.0, 0.0, 1.0])
    start = {
        "free": pin.exp3(rng.normal(size=3)),
        "perpendicular": pin.exp3(0.7 * z) @ pin.exp3(np.array([pi / 2, 0, 0])) @ pin.exp3(0.4 * z),
        "parallel": pin.exp3(0.7 * z),
        "fixed": np.eye(3),
    }[rotation]
    z_B = start @ z
    turns = {
        "free": (list(np.eye(3)), []),
        "perpendicular": ([z, z_B], [np.cross(z, z_B)]),
        "parallel": ([z], [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]),
        "fixed": ([], list(np.eye(3))),
    }[rotation]
    at = np.array([0.0 if i in translations else 0.3 * i + 0.1 for i in range(3)])
    assert missed(pin.SE3(start, at)) <= ROUNDING
    for i in range(3):
        moved = missed(pin.SE3(start, at + 0.2 * np.eye(3)[i]))
        assert moved == pytest.approx(0.2) if i in translations else moved <= ROUNDING
    for free, axes in zip((True, False), turns, strict=True):
        for axis in axes:
            moved = missed(pin.SE3(pin.exp3(0.3 * axis) @ start, at))
            assert moved <= ROUNDING if free else moved == pytest.approx(np.sin(0.3))


def test_loops_out_of_reach_and_turned_axes_are_no_closure() -> None:
    description, _, ((q, _), _, _) = drawn("four_bar", "fixed")
    closure, far = description.closures[0], np.eye(4)
    far[0, 3] = 5.0
    unreachable = replace(description, closures=(replace(closure, frame_b=closure.frame_b @ far),))
    refused(lambda: Oracle(unreachable).close(q), ValueError, "do not close")
    back = closure.frame_b @ np.diag([1.0, -1.0, -1.0, 1.0])
    turned = replace(description, closures=(replace(closure, frame_b=back),))
    assert np.abs(Oracle(description).residual(q)).max() <= ROUNDING
    assert Oracle(turned).residual(q).min() == pytest.approx(-1.0)
    refused(lambda: Oracle(turned).close(q), ValueError, "do not close")


def test_bearings_that_hold_nothing_more_leave_every_motion() -> None:
    """Rows that are zero to rounding are dependent, though none is larger."""
    sketch = Sketch(np.random.default_rng(0))
    axis = sketch.direction()
    sliding = sketch.joint("prismatic", "base", np.zeros(3), axis)
    sketch.close("prismatic", "base", sliding, axis, axis)
    oracle = Oracle(sketch.description("drawer"))
    q = np.array(sketch.home[sliding.removesuffix("_link")])
    assert 0 < np.abs(oracle.rows(q)).max() < ROUNDING
    assert oracle.motions(q).shape == (1, 1)
