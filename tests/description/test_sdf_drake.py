"""Trees read from SDF against Drake, whose parser is libsdformat, the reference reader of SDFormat."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.description.drake_plant import AGAINST_DRAKE, Plant
from tests.description.reading import save_all
from tests.description.sdf_texts import WORLD, joint, link, random_pair, sdf
from tests.support.files import save
from tests.support.samples import slow

pydrake = pytest.importorskip("pydrake", reason="pip install drake")

VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


@pytest.mark.parametrize(("seed", "version"), [(30, "1.6"), *(slow(31, version) for version in VERSIONS)])
def test_poses_and_inertia_are_those_of_drake(seed: int, version: str, tmp_path: Path) -> None:
    pin.seed(seed)
    file = save(tmp_path, sdf(*random_pair(seed, version).sdf[:-1], version=version), "robot.sdf")
    robot, drake = hybridyn.load(file), Plant(file, "robot")
    q = drake.move(robot, seed)
    drake.compare_poses(robot, q)
    M = pin.crba(robot.model, robot.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    ours = [at.start for at in robot.v_slices]
    theirs = [drake.joints[name].velocity_start() for name in robot.joints]
    expected = drake.plant.CalcMassMatrix(drake.context)[np.ix_(theirs, theirs)]
    np.testing.assert_allclose(M[np.ix_(ours, ours)], expected, atol=AGAINST_DRAKE * np.abs(expected).max())


def test_a_universal_joint_moves_as_in_drake(tmp_path: Path) -> None:
    arm = link("arm", "<pose>0.5 0.6 -0.7 0.8 0.9 -1.0</pose>")
    more = "<pose>0.1 -0.2 0.3 0.4 -0.5 0.6</pose><axis2><xyz>3 0 -1</xyz></axis2>"
    cross = joint("j", "universal", "base", "arm", more, axis="1 2 3")
    file = save(tmp_path, sdf(link("base"), arm, WORLD, cross), "robot.sdf")
    robot, drake = hybridyn.load(file), Plant(file, "robot")
    assert robot.joints == ("j_1", "j_2")
    q = np.array([0.7, -0.4])
    drake.plant.SetPositions(drake.context, q)
    drake.compare_poses(robot, q)


PART = """<sdf version="1.9"><model name="part"><pose>0.3 0.1 0 0 0.2 0</pose>
<frame name="f2" attached_to="y"><pose relative_to="jj">0.1 0.2 0.3 0.3 0.2 0.1</pose></frame>
<link name="x"><pose>1 2 3 0.1 0.2 0.3</pose></link>
<link name="y"><pose relative_to="x">0.5 0 0 0 0.4 0</pose></link>
<frame name="f1" attached_to="x"><pose>0 1 0 0.5 0 0</pose></frame>
<joint name="jj" type="revolute"><parent>f1</parent><child>y</child><pose>0.1 0 0 0 0 0.7</pose>
<axis><xyz expressed_in="f1">0 1 1</xyz></axis></joint></model></sdf>"""
WHOLE = """<sdf version="1.9"><model name="m"><pose>0 0 1 0 0 0.5</pose>
<link name="base"><pose>0.2 0 0 0 0 0.1</pose></link>
<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint>
<frame name="fb" attached_to="base"><pose>0 0 0.4 0.2 0 0</pose></frame>
<include><uri>package://nest/part.sdf</uri><name>p1</name>
<pose relative_to="fb">0.1 0 0 0 0 1</pose></include>
<joint name="k1" type="revolute"><parent>fb</parent><child>p1::f1</child><pose>0.2 0 0 0 0.1 0</pose>
<axis><xyz>1 0 1</xyz></axis></joint>
<include><uri>package://nest/part.sdf</uri><name>p2</name>
<pose relative_to="p1::f2">0.1 0 0 0 0 1</pose></include>
<joint name="k2" type="revolute"><parent>p1</parent><child>p2::x</child>
<axis><xyz expressed_in="p1::__model__">0 1 0</xyz></axis></joint>
<model name="in"><pose relative_to="p2::jj">0 0 1 0.1 0 0</pose>
<link name="a"><pose>0 1 0 0 0 1</pose></link>
<link name="b"><pose relative_to="__model__">0 2 0 0 1 0</pose></link>
<joint name="ab" type="prismatic"><parent>a</parent><child>b</child><pose relative_to="__model__"/>
<axis><xyz>1 2 0</xyz></axis></joint></model>
<joint name="k3" type="continuous"><parent>p2::y</parent><child>in</child>
<pose relative_to="in::a">0 0 0 0 0.3 0</pose><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""


def test_composed_models_stand_as_in_drake(tmp_path: Path) -> None:
    """Nested and included models, with frames of each other."""
    file = save_all(tmp_path / "nest", {"main.sdf": WHOLE, "part.sdf": PART})
    robot, drake = hybridyn.load(file, package_dirs=[file.parent]), Plant(file, "m")
    assert {*drake.bodies} == {"base", "p1::x", "p1::y", "p2::x", "p2::y", "in::a", "in::b"}
    drake.compare_poses(robot, drake.move(robot, 3))


HELD = '<joint name="tie" type="fixed"><parent>base</parent><child>{}</child></joint>'
GROUND = '<model name="ground"><static>1</static><pose>0 0 2 0 0 0</pose><link name="l"/></model>'
FRAME = '<frame name="f"><pose relative_to="{}">0 0 1 0.1 0 0.3</pose></frame>'
ARM = '<model name="arm"><pose relative_to="f">0 1 0 0 0 0</pose>{}{}{}</model>'.format(
    link("base"), link("a", "<pose>0.3 0.2 0.1 0 0.4 0</pose>"), joint("j", "revolute", "base", "a")
)
TIED = '<joint name="{}" type="fixed"><parent>{}</parent><child>{}</child></joint>'


def part(inside: str, more: str = "", attributes: str = "") -> str:
    """Return a robot that includes the part, which a joint holds."""
    include = f"<include{attributes}><uri>package://nest/part.sdf</uri>{more}</include>"
    return sdf(link("base", "<pose>0 0.2 0 0 0.3 0</pose>"), WORLD, HELD.format(inside), include)


def world(*parts: str) -> str:
    """Return a file with a world."""
    return f'<sdf version="1.11"><world name="w">{"".join(parts)}</world></sdf>'


NAMED = '<name>p</name><pose relative_to="base">1 0 0 0 0 1</pose>'
NEST = PART[PART.index("<model") : PART.index("</sdf>")]
PLACED = NEST.replace('name="part"', 'name="in" placement_frame="f1" canonical_link="y"')
#: The text of a robot, and how many bodies it has.
COMPOSED = {
    "a placement frame of an include": (part("p::x", f"{NAMED}<placement_frame>f2</placement_frame>"), 3),
    "a placement frame of a model": (sdf(link("base"), WORLD, HELD.format("in::x"), PLACED), 3),
    "a merged include": (part("x", NAMED, ' merge="true"'), 3),
    "a merged include by its own name and pose": (part("f1", "", ' merge="1"'), 3),
    "a placement frame of a merged include": (
        part("x", f"{NAMED}<placement_frame>jj</placement_frame>", ' merge="true"'), 3,
    ),
    "the frame of a merged model": (
        part("x", "", ' merge="true"').replace(
            "</model>",
            link("c", '<pose relative_to="f2">1 0 0 0 0 0</pose>')
            + joint("z", "revolute", "y", "c").replace("<xyz>", '<xyz expressed_in="f1">') + "</model>",
        ), 4,
    ),
    "a frame of the world": (world(FRAME.format("world"), ARM), 2),
    "a frame on a static model": (world(GROUND, FRAME.format("ground::l"), ARM), 2),
    "a joint of the world": (world(FRAME.format(""), ARM, TIED.format("hold", "f", "arm::base")), 2),
    "a joint on a static model": (
        world(GROUND, FRAME.format(""), ARM, TIED.format("hold", "ground::l", "arm::base")), 2,
    ),
    "models that joints of the world tie": (
        world(
            FRAME.format(""), ARM, ARM.replace('"arm"', '"two"').replace("0 1 0", "3 1 0"),
            TIED.format("hold", "world", "arm::base"), TIED.format("tie", "arm::a", "two::base"),
        ), 4,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COMPOSED)
def test_links_stand_as_in_drake(name: str, tmp_path: Path) -> None:
    text, bodies = COMPOSED[name]
    file = save_all(tmp_path / "nest", {"main.sdf": text, "part.sdf": PART})
    loaded = hybridyn.load(file, package_dirs=[file.parent], base="fixed")
    drake = Plant(file, loaded.description.name if "</world>" not in text or bodies == 4 else "arm")
    drake.bodies = {one: body for one, body in drake.bodies.items() if not one.startswith("ground")}
    assert len(drake.bodies) == bodies
    q = drake.move(loaded, 3)
    if loaded.description.base == "fixed":
        drake.compare_poses(loaded, q)
        return
    data, start = loaded.model.createData(), loaded.description.base_home
    pin.framesForwardKinematics(loaded.model, data, q)
    pose = pin.XYZQUATToSE3(np.array(start))
    for one, body in drake.bodies.items():
        theirs = drake.plant.EvalBodyPoseInWorld(drake.context, body).GetAsMatrix4()
        ours = (pose * data.oMf[loaded.model.getFrameId(one, pin.BODY)]).homogeneous
        np.testing.assert_allclose(ours, theirs, atol=AGAINST_DRAKE)


def test_a_screw_moves_as_in_drake(tmp_path: Path) -> None:
    """Its slide is where the coupling puts it."""
    arm = link("arm", "<pose>0.5 0.6 -0.7 0.8 0.9 -1.0</pose>")
    more = "<pose>0.1 -0.2 0.3 0.4 -0.5 0.6</pose><thread_pitch>-4</thread_pitch>"
    screw = joint("j", "screw", "base", "arm", more, axis="1 2 3")
    file = save(tmp_path, sdf(link("base"), arm, WORLD, screw), "robot.sdf")
    robot, drake = hybridyn.load(file), Plant(file, "robot")
    q, *_ = hybridyn.assemble(robot, motors={"j": 0.7}, guess=robot.home)
    drake.plant.SetPositions(drake.context, [0.7])
    drake.compare_poses(robot, q)
    expected = drake.plant.CalcMassMatrix(drake.context)
    np.testing.assert_allclose(hybridyn.mass_matrix(robot, q), expected, rtol=1e-11)
