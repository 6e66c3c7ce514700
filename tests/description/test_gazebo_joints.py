"""Screws, gearboxes and joints to the world in the `<gazebo>` blocks of a URDF, by hand."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.reading import holds, refused
from tests.robots.robot_texts import INERTIAL
from tests.support.comparing import SOLVED
from tests.support.files import save

#: The closing of loops, to its tolerance.
CLOSED = 1e-9
PITCH = 0.02


def hinge(
    name: str, parent: str, child: str, kind: str, axis: str, at: str = "0 0 0", com: str = "0.5"
) -> str:
    """Return a link and the joint to it."""
    mass = INERTIAL.replace('xyz="0.5 0 0"', f'xyz="{com} 0 0"')
    return (
        f'<link name="{child}">{mass}</link><joint name="{name}" type="{kind}"><origin xyz="{at}"/>'
        f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
    )


def gazebo(name: str, kind: str, parent: str, child: str, more: str = "", axis: str = "0 0 1") -> str:
    """Return a block with a joint."""
    about = f"<axis><xyz>{axis}</xyz></axis>" if axis else ""
    return (
        f'<gazebo><joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{more}'
        f"{about}</joint></gazebo>"
    )


def robot(*parts: str) -> str:
    """Return a robot with a base."""
    return f'<robot name="r"><link name="base"/>{"".join(parts)}</robot>'


def motor(joint: str) -> str:
    """Return a transmission."""
    return f'<transmission name="t"><joint name="{joint}"/></transmission>'


#: A spindle that turns, and a nut that only slides; the screw between them is slanted from the nut's frame.
PRESS = (
    hinge("drive", "base", "spindle", "continuous", "0 0 1", "0.1 0.2 0.3"),
    hinge("slide", "base", "nut", "prismatic", "0 0 1", "0.1 0 0.5"), motor("drive"),
)  # fmt: skip
AT = "<pose>0 0.2 0.1 0 0.5 0</pose>"
SLANTED = f"{np.sin(-0.5).item()!r} 0 {np.cos(0.5).item()!r}"
SCREW = gazebo("thread", "screw", "spindle", "nut", AT + "{}", SLANTED)


@pytest.mark.parametrize(
    ("stated", "pitch"),
    [
        (f"<screw_thread_pitch>{PITCH * 2 * np.pi!r}</screw_thread_pitch>", PITCH),
        (f"<thread_pitch>{-1 / PITCH!r}</thread_pitch>", PITCH),
        (f"<thread_pitch>{1 / PITCH!r}</thread_pitch>", -PITCH),
        ("", 1 / (2 * np.pi)),
    ],
)
def test_a_screw_slides_as_it_turns(stated: str, pitch: float, tmp_path: Path) -> None:
    """The nut moves up by the pitch times its turn against the spindle: minus that of the spindle."""
    found = hybridyn.load(save(tmp_path, robot(*PRESS, SCREW.format(stated))))
    assert sum(module.mobility for module in found.modules) == 1
    q = found.home
    for turn in (0.7, 2.0, 4.5, 7.0, 8.0):
        q = hybridyn.assemble(found, motors={"drive": turn}, guess=q)[0]
        at = q[found.q_slices[found.joints.index("slide")]]
        np.testing.assert_allclose(at, -pitch * turn, atol=CLOSED)


def test_a_screw_without_a_pitch_is_a_hinge(tmp_path: Path) -> None:
    text = SCREW.format("<screw_thread_pitch>0</screw_thread_pitch>")
    holds(read(save(tmp_path, robot(*PRESS, text))), {"closures": [{"name": "thread", "kind": "revolute"}]})


def test_the_damping_of_a_screw_is_that_of_its_hinge(tmp_path: Path) -> None:
    damped = "<dynamics><damping>0.3</damping></dynamics></axis>"
    found = read(save(tmp_path, robot(*PRESS, SCREW.format("").replace("</axis>", damped))))
    damping = {joint.name: joint.damping for joint in found.joints}
    assert damping == {"drive": 0, "slide": 0, "thread": 0.3}
    assert found.motors == ("drive",)


BOX = (
    "<gearbox_ratio>5</gearbox_ratio><gearbox_reference_body>{}</gearbox_reference_body>"
    "<axis2><xyz>0 0 1</xyz></axis2>"
)
WHEELS = (
    hinge("a", "base", "one", "continuous", "0 0 1", "0.3 0 0"),
    hinge("b", "base", "two", "continuous", "0 0 -1"),
    hinge("c", "two", "three", "revolute", "0 0 1"),
)


@pytest.mark.parametrize(
    ("ends", "reference", "terms"),
    [
        (("one", "two"), "base", {"b": -1.0, "a": 5.0}),
        (("two", "one"), "base", {"a": 1.0, "b": -5.0}),
        (("one", "three"), "base", {"c": 1.0, "b": -1.0, "a": 5.0}),
        (("one", "three"), "two", {"c": 1.0, "a": 5.0, "b": 5.0}),
    ],
)
def test_a_gearbox_ties_angles_against_its_reference_body(
    ends: tuple[str, str], reference: str, terms: dict[str, float], tmp_path: Path
) -> None:
    found = read(save(tmp_path, robot(*WHEELS, gazebo("g", "gearbox", *ends, BOX.format(reference)))))
    (coupling,) = found.couplings
    assert (coupling.name, coupling.offset, dict(coupling.terms)) == ("g", 0.0, terms)


def test_a_fixed_joint_to_the_world_is_the_base(tmp_path: Path) -> None:
    plain = read(save(tmp_path / "a", robot(*WHEELS)))
    held = gazebo("hold", "fixed", "world", "base", axis="")
    found = read(save(tmp_path / "b", robot(*WHEELS, held)))
    assert (found.base, found.closures, found.motors) == ("fixed", (), plain.motors)
    (joint,) = (joint for joint in found.joints if joint.child == "base")
    assert (joint.name, joint.parent, joint.kind) == ("hold", "world", "fixed")


@pytest.mark.parametrize("ends", [("world", "tip"), ("tip", "world")])
def test_a_robot_hangs_on_a_joint_to_the_world(ends: tuple[str, str], tmp_path: Path) -> None:
    """A chain that is pinned at its tip accelerates as the same chain written from the tip."""
    place = '<pose relative_to="tip">0.5 0 0 0 0 0</pose>'
    pinned = hybridyn.load(save(tmp_path / "a", (
        f'<robot name="r"><link name="root">{INERTIAL}</link>'
        + hinge("j", "root", "tip", "continuous", "0 1 0", "1 0 0") + motor("j")
        + gazebo("pin", "revolute", *ends, place, "0 1 0") + "</robot>"
    )))  # fmt: skip
    assert [note for note in pinned.notes if "holds a link in the world" in note]
    assert sum(module.mobility for module in pinned.modules) == 2
    chain = hybridyn.load(save(tmp_path / "b", (
        '<robot name="r"><link name="world"/>' + motor("j")
        + hinge("pin", "world", "tip", "continuous", "0 1 0", "1.5 0 0", "0")
        + hinge("j", "tip", "root", "continuous", "0 -1 0", "-0.5 0 0", "-0.5") + "</robot>"
    )))  # fmt: skip
    one, other = (
        hybridyn.ddm(robot, robot.home, np.zeros(robot.nv), np.array([0.7]))[
            robot.v_slices[robot.joints.index("j")]
        ]
        for robot in (pinned, chain)
    )
    np.testing.assert_allclose(one, other, rtol=SOLVED)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (robot(*PRESS, SCREW.format("<thread_pitch>0</thread_pitch>")), "slides without turning"),
        (robot(*WHEELS, gazebo("g", "gearbox", "one", "two")), "<axis2> is missing"),
        (robot(*WHEELS, gazebo("g", "gearbox", "one", "two", BOX.format("tow"))), "did you mean 'two'?"),
        (robot(*WHEELS, gazebo("g", "gearbox", "one", "two", BOX.format("base"), "1 0 0")), "does not turn"),
        (robot(*WHEELS, gazebo("g", "gearbox", "one", "one", BOX.format("one"))), "couples nothing"),
        (robot(*WHEELS, gazebo("g", "piston", "one", "two")), "closes no loop here"),
        (robot(*WHEELS, gazebo("g", "fixed", "world", "tow", axis="")), "did you mean 'two'?"),
    ],
)  # fmt: skip
def test_what_is_no_joint_is_refused(text: str, words: str, tmp_path: Path) -> None:
    refused(save(tmp_path, text), words)
