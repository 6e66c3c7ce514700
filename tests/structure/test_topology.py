"""From a description to modules: bodies, loops, platforms, wrists that are cut and wrists that are not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hybridyn
from hybridyn.description.records import Closure, Coupling, Description, Joint, Link
from hybridyn.errors import ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.graph import find_modules
from hybridyn.structure.module_spec import module_spec
from hybridyn.structure.robot import HybridRobot
from tests.oracle import Oracle
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import SOLVED, close_to, refused
from tests.support.samples import some

Z = np.array([0.0, 0.0, 1.0])


def link(name: str, mass: float = 1.0) -> Link:
    return Link(name, mass, np.zeros(3), mass * 0.1 * np.eye(3))


def joint(name: str, parent: str, child: str, kind: str = "revolute", x: float = 0.3) -> Joint:
    M = np.eye(4)
    M[0, 3] = x
    return Joint(name, kind, parent, child, M, Z)  # type: ignore[arg-type]


def planar(
    *joints: Joint, closures: tuple[tuple[str, str, float, float], ...] = (), **options: object
) -> Description:
    """Return a planar robot; closures as (link, link, x in each)."""
    names = dict.fromkeys(["base", *(j.child for j in joints)])
    records = []
    for i, (a, b, xa, xb) in enumerate(closures):
        A, B = np.eye(4), np.eye(4)
        A[0, 3], B[0, 3] = xa, xb
        records.append(Closure(f"c{i}", "revolute", a, A, b, B, (0, 1, 2), "parallel"))
    return Description("planar", tuple(link(n) for n in names), joints, tuple(records), **options)  # type: ignore[arg-type]


def joints_of(description: Description) -> list[set[str]]:
    """Return the joints of each module."""
    bodies, graphs = find_modules(description)
    return [{bodies.joints[j].joint.name for j in g.joints} for g in graphs]


def cut_wrists(robot: HybridRobot) -> list[int]:
    """Return the number of joints in each wrist that was cut."""
    return sorted(len(w.joints) for m in robot.modules for w in m.mechanism.spec.wrists)


def agrees_with_the_oracle(description: Description, robot: HybridRobot) -> None:
    q, v, a = random_states(description, "fixed", 1, 3)
    oracle = Oracle(description)
    weights = np.ones(len(robot.motors))
    expected = np.array([oracle.idm(*state) for state in zip(q, v, a, strict=True)])
    close_to(hybridyn.idm(robot, q, v, a, weights=weights), expected, SOLVED)


# -------------------------------------------------------------------- modules of a graph


def test_joints_without_loops_are_modules_of_their_own() -> None:
    arm = planar(joint("a", "base", "1"), joint("b", "1", "2"), joint("c", "1", "3"))
    assert joints_of(arm) == [{"a"}, {"b"}, {"c"}]
    robot = build_robot(arm)
    assert [m.parent for m in robot.modules] == [-1, 0, 0]
    assert [m.base for m in robot.modules] == ["base", "1", "1"]
    assert [m.mobility for m in robot.modules] == [1, 1, 1]


def test_loops_that_share_a_joint_are_one_module_and_loops_that_share_a_body_are_two() -> None:
    trunk = (joint("a", "base", "1"), joint("b", "1", "2"), joint("c", "base", "3"), joint("d", "3", "4"))
    shares_joint = planar(*trunk, closures=(("2", "3", 0.1, 0.2), ("2", "4", 0.2, 0.3)))
    assert joints_of(shares_joint) == [{"a", "b", "c", "d"}]
    one_after_other = planar(
        *trunk, joint("e", "2", "5"), joint("f", "5", "6"), joint("g", "2", "7"),
        closures=(("2", "3", 0.1, 0.2), ("6", "7", 0.1, 0.2)),
    )  # fmt: skip
    assert sorted(map(sorted, joints_of(one_after_other))) == [["a", "b", "c"], ["d"], ["e", "f", "g"]]


def test_a_module_on_a_leg_link_stands_on_that_link() -> None:
    robot = build_robot(random_mechanism(0, kind="on_leg"))
    rps = next(m for m in robot.modules if m.mobility == 3)
    bars = next(m for m in robot.modules if m.closures and m.mobility == 1)
    assert bars.parent == robot.modules.index(rps)
    assert bars.base in rps.outputs
    assert len(rps.outputs) == 3  # platform, and two rods that carry something
    inside_legs = {o for leg in rps.mechanism.spec.legs for o in leg} & set(rps.mechanism.spec.outputs)
    assert len(inside_legs) == 2


@pytest.mark.parametrize("inside", [False, True])
def test_a_coupling_merges_its_joints_and_all_between(inside: bool) -> None:
    chain = [
        joint(n, p, c) for n, p, c in (("a", "base", "1"), ("b", "1", "2"), ("c", "2", "3"), ("d", "3", "4"))
    ]
    ends = ("b", "c") if inside else ("a", "c")
    coupled = planar(*chain, couplings=(Coupling("gear", ((ends[0], 1.0), (ends[1], -2.0))),))
    expected = [{"a"}, {"b", "c"}, {"d"}] if inside else [{"a", "b", "c"}, {"d"}]
    assert joints_of(coupled) == expected
    assert build_robot(coupled).mobility == 3


def test_a_coupling_merges_two_loops_and_the_joint_between() -> None:
    bars = [
        joint("a", "base", "1"), joint("b", "1", "2"), joint("c", "base", "3"), joint("between", "2", "4"),
        joint("e", "4", "5"), joint("f", "5", "6"), joint("g", "4", "7"),
    ]  # fmt: skip
    closures = (("2", "3", 0.1, 0.2), ("6", "7", 0.1, 0.2))
    gear = Coupling("gear", (("a", 1.0), ("g", 0.5)))
    assert len(joints_of(planar(*bars, closures=closures))) == 3
    assert joints_of(planar(*bars, closures=closures, couplings=(gear,))) == [set("abcefg") | {"between"}]


def test_fixed_joints_make_one_body_named_by_its_heaviest_link() -> None:
    light = planar(joint("a", "base", "1"), joint("f", "1", "tool", "fixed"), joint("b", "tool", "2"))
    heavy = replace(light, links=tuple(replace(x, mass=5.0) if x.name == "tool" else x for x in light.links))
    bodies, graphs = find_modules(heavy)
    assert [b.name for b in bodies.bodies] == ["base", "tool", "2"]
    assert len(graphs) == 2
    assert bodies.bodies[1].mass == 6.0
    assert bodies.place["tool"][0] == bodies.place["1"][0] == 1
    close_to(bodies.place["tool"][2], np.array([0.3, 0.0, 0.0]), 1e-15)


def test_a_closure_inside_one_rigid_body_and_a_ring_of_joints_are_refused() -> None:
    stiff = planar(joint("a", "base", "1"), joint("f", "1", "2", "fixed"), closures=(("1", "2", 0.1, 0.2),))
    words = r"'c0' joins '1' and '2', which are one rigid body"
    refused(lambda: find_modules(stiff), ModelError, words, element="c0")
    ring = planar(joint("a", "base", "1"), joint("b", "3", "2"), joint("c", "2", "3"))
    refused(lambda: find_modules(ring), ModelError, r"links \['2', '3'\] are not connected to the root")


@pytest.mark.parametrize("kind", some(KINDS))
def test_modules_of_every_kind(kind: str) -> None:
    """Mobilities are the recipe's; every joint, closure and motor is in just one module; bases come first."""
    description = random_mechanism(1, kind=kind)
    robot = build_robot(description)
    recipe = KINDS[kind]
    assert sorted(m.mobility for m in robot.modules if m.closures) == sorted(recipe.loops)
    assert sum(m.mobility for m in robot.modules if not m.closures) == recipe.serial
    assert sorted(j for m in robot.modules for j in m.joints) == sorted(robot.joints)
    closed = [c.name for c in (*description.closures, *description.couplings)]
    assert sorted(c for m in robot.modules for c in m.closures) == sorted(closed)
    assert sorted(x for m in robot.modules for x in m.motors) == sorted(robot.motors)
    for k, m in enumerate(robot.modules):
        report = m.mechanism.reduction.report
        assert report.clear
        assert report.dropped < 1e-12 < 1e-3 < report.kept  # exact geometry
        assert m.parent < k
        if m.parent >= 0:
            assert robot.modules[m.parent].outputs[m.parent_output] == m.base
        wrists = {j for w in m.mechanism.spec.wrists for j in w.joints}
        in_legs = [j for _, joints in m.legs for j in joints]
        in_wrists = {m.joints[j] for j in wrists}
        assert len(in_legs) == len(set(in_legs)) == len(m.joints) - len(in_wrists)
        assert not in_wrists & set(in_legs)
        assert len(m.mechanism.spec.platforms) <= len(m.outputs)


def test_equal_modules_share_their_numbers() -> None:
    robot = build_robot(shipped("snake"))
    looped = [m for m in robot.modules if m.closures]
    assert len(looped) == 12
    assert len({id(m.mechanism) for m in looped}) == 3  # tail and head differ from what is between
    assert len({m.name for m in looped}) == 12


@pytest.mark.parametrize("name", ROBOTS)
def test_platforms_of_shipped_robots_are_outputs(name: str) -> None:
    robot = build_robot(shipped(name))
    for module in robot.modules:
        if len(module.closures) >= 2:  # three legs at least
            assert len(module.mechanism.spec.platforms) == 1
            assert len(module.legs) >= 3


# -------------------------------------------------------------------- wrists


def test_gimbals_and_balls_of_a_gough_platform_are_cut() -> None:
    """A leg keeps three joints, and two more of a wrist whose third is a hinge's rows."""
    robot = build_robot(random_mechanism(1, kind="gough_gimbals"))
    (module,) = robot.modules
    spec = module.mechanism.spec
    assert len(spec.platforms) == 1
    hinges = sum(c.kind == "revolute" for c in robot.description.closures)
    assert sorted(len(leg) for leg in spec.legs) == [3] * (6 - hinges) + [5] * hinges
    assert [len(w.joints) for w in spec.wrists] == [3] * (6 - hinges)
    assert sum(w.carries for w in spec.wrists) == 1
    kinds = {c.rotation for c in spec.cut_closures}
    assert kinds <= {"free", "parallel"}
    agrees_with_the_oracle(robot.description, robot)


@pytest.mark.parametrize(("kind", "sizes"), [("star_two_axes", {1, 2, 3}), ("star_universal", {1, 2, 3})])
def test_crossing_pairs_are_cut_to_universals(kind: str, sizes: set[int]) -> None:
    robot = build_robot(random_mechanism(1, kind=kind))
    found = cut_wrists(robot)
    assert found
    assert set(found) <= sizes
    assert any(c.rotation == "perpendicular" for c in robot.modules[0].mechanism.spec.cut_closures)
    agrees_with_the_oracle(robot.description, robot)


def end_of_a_wrist(description: Description) -> tuple[str, str]:
    """Return the last joint and link of a chain of three that is welded to the platform."""
    bodies, graphs = find_modules(description)
    spec = module_spec(bodies, graphs[0], np.zeros(0))
    wrist = next(w for w in spec.wrists if len(w.joints) == 3 and not w.carries)
    last = bodies.joints[graphs[0].joints[wrist.joints[-1]]].joint
    return last.name, last.child


def with_joint(description: Description, name: str, **changes: object) -> Description:
    joints = tuple(replace(j, **changes) if j.name == name else j for j in description.joints)  # type: ignore[arg-type]
    return replace(description, joints=joints)


def with_link(description: Description, name: str, **changes: object) -> Description:
    links = tuple(replace(x, **changes) if x.name == name else x for x in description.links)  # type: ignore[arg-type]
    return replace(description, links=links)


HEAVIER: dict[str, Callable[[Description, str, str], Description]] = {
    "mass": lambda d, j, body: with_link(d, body, mass=0.1),
    "inertia": lambda d, j, body: with_link(d, body, inertia=1e-3 * np.eye(3)),
    "motor": lambda d, j, body: replace(d, motors=(*d.motors, j)),
    "damping": lambda d, j, body: with_joint(d, j, damping=0.1),
    "friction": lambda d, j, body: with_joint(d, j, friction=0.1),
    "rotor": lambda d, j, body: with_joint(d, j, rotor_inertia=0.1),
    "coupling": lambda d, j, body: replace(d, couplings=(Coupling("gear", ((j, 1.0),), d.home[j][0]),)),
    "tool": lambda d, j, body: replace(
        d, links=(*d.links, link("tool")), joints=(*d.joints, joint("tool_joint", body, "tool")),
        home=d.home | {"tool_joint": (0.2,)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", HEAVIER)
def test_a_wrist_that_does_something_is_not_cut(what: str) -> None:
    """Mass, motor, friction, coupling or a module at its end: the chain stays in the leg, and stays right."""
    plain = random_mechanism(1, kind="gough_gimbals")
    name, body = end_of_a_wrist(plain)
    changed = HEAVIER[what](plain, name, body)
    robot = build_robot(changed)
    cut = {m.joints[j] for m in robot.modules for w in m.mechanism.spec.wrists for j in w.joints}
    assert name not in cut
    assert 3 in cut_wrists(robot)  # the others still are
    if what == "coupling":
        return  # it locks a freedom: no longer the recipe's mobility
    if what != "tool":
        agrees_with_the_oracle(changed, robot)


def test_axes_that_miss_each_other_make_no_wrist() -> None:
    """A tenth of a millimetre between the axes is a chain of three joints with its own motion, not a ball."""
    plain = random_mechanism(1, kind="gough_gimbals")
    name, _ = end_of_a_wrist(plain)
    (last,) = (j for j in plain.joints if j.name == name)
    shifted = last.placement.copy()
    off = np.cross(shifted[:3, :3] @ last.axis, [0.3, -0.5, 0.8])
    shifted[:3, 3] += 1e-4 * off / np.linalg.norm(off)
    robot = build_robot(with_joint(plain, name, placement=shifted))
    cut = {m.joints[j] for m in robot.modules for w in m.mechanism.spec.wrists for j in w.joints}
    assert cut & set(robot.joints)
    wrist = [
        w for w in robot.modules[0].mechanism.spec.wrists if robot.modules[0].joints[w.joints[-1]] == name
    ]
    assert all(len(w.joints) < 3 for w in wrist)
