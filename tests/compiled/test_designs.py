"""Many designs along one table: every design as a robot of its own, and what cannot be is counted."""

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.library.closed_rows import ClosedRows
from hybridyn.compiled.programs.closing.libraries import ClosingLibraries
from hybridyn.compiled.programs.designs import BESIDE, changed, designs_to_verify
from hybridyn.compiled.programs.sources import kept
from hybridyn.description.cache_folder import VARIABLE
from hybridyn.spatial import Array, Mask
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from hybridyn.structure.parameters.slots import Slot
from hybridyn.structure.robot import joint_position
from tests.assembly.test_assembly import waves
from tests.compiled import rods
from tests.compiled.test_chains import load, some_of, swing
from tests.robots.posing import of_link, swaying
from tests.structure.test_parameters import COUNTED
from tests.support.comparing import close_to, refused, same_bits
from tests.support.files import save

AGREE = 1e-11  # of the largest entry
ROWS = 30
TIME = np.linspace(0.0, np.pi, ROWS)

NAMES = {
    "five_bar": ["mass:m1_tool", "position:m1_left_elbow", "position:m1_right_elbow"],
    "gough_stewart": ["mass:m1_platform", "position:m1_leg1_cross_y", "position:m1_leg3_ball/successor"],
}
SWING = {"five_bar": 0.2, "gough_stewart": 0.01}


def robot_of(compiled: hybridyn.CompiledRobot, p: Array) -> hybridyn.HybridRobot:
    """Return the robot of a design."""
    return changed(compiled.robot, compiled.parameters, compiled.parameters.slot_values(p[None])[0])


def agrees(table: Any, k: int, robot: hybridyn.HybridRobot, **asked: Any) -> None:
    """Compare a design of a table with a robot of its own."""
    states = hybridyn.assemble(robot, **asked)
    efforts = hybridyn.idm(robot, *states)
    close_to((table.q[k], table.v[k], table.a[k], table.tau[k]), (*states, efforts), AGREE)
    close_to(table.peak_effort[k], np.abs(efforts).max(axis=0), 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_designs_are_the_robots_with_these_numbers(name: str) -> None:
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, parameters=NAMES[name])
    motors = waves(robot, TIME, SWING[name])
    rng, nominal = np.random.default_rng(1), compiled.parameters.nominal
    p = nominal * (1.0 + 0.04 * rng.uniform(-1.0, 1.0, (20, len(nominal))))
    found = compiled.designs(p, motors=motors)
    assert found.good.all()
    assert found.recomputed == 0
    for k in range(0, len(p), 6):
        agrees(found, k, robot_of(compiled, p[k]), motors=motors)
    alone = compiled.designs(p[3:4], motors=motors)  # the same bits, whatever the others need
    same_bits((alone.q[0], alone.a[0], alone.tau[0]), (found.q[3], found.a[3], found.tau[3]))
    before, (closing,) = compiled.recomputed, compiled._postures._evaluator.libraries._known.values()
    assert closing is not None
    closing.rows.close = lambda *_, **more: np.zeros(1, int)  # type: ignore[method-assign]
    close_to(compiled.designs(p[3:4], motors=motors).q, alone.q, AGREE)
    assert (before, compiled.recomputed) == (0, ROWS)
    current = compiled._models.current
    current.take(current.artifact.loaded(Library))  # as when the library is built
    assert compiled._postures._evaluator._inverse() is current.program("idm")


def test_programs_are_kept_in_bounded_number() -> None:
    made, known = [], dict[int, int]()
    for key in (1, 2, 1, 3, 1, 2):
        assert kept(known, key, lambda key=key: made.append(key) or key, most=2) == key  # type: ignore[misc, func-returns-value]
    assert (made, list(known)) == ([1, 2, 3, 2], [1, 2])


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_steps_that_are_too_long_are_divided_where_a_design_needs_it(name: str) -> None:
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, parameters=NAMES[name])
    swing = {"five_bar": 0.7, "gough_stewart": 0.05}[name]
    motors = {joint: tuple(x[::5] for x in levels) for joint, levels in waves(robot, TIME, swing).items()}
    p = compiled.parameters.nominal * np.linspace(0.98, 1.04, 7)[:, None]
    found = compiled.designs(p, motors=motors)
    assert found.good.all()
    assert found.recomputed == 0
    agrees(found, 0, robot_of(compiled, p[0]), motors=motors)
    for k in (0, 6):  # whatever the others need
        alone = compiled.designs(p[k : k + 1], motors=motors)
        same_bits((alone.q[0], alone.a[0], alone.tau[0]), (found.q[k], found.a[k], found.tau[k]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("five_bar", ["mass:m1_tool", "position:m1_left_elbow", "position:m1_tool_mount"]),
        ("delta", ["position:m1_arm1_drive", "mass:m1_platform"]),
        ("rps3", ["mass:m1_platform"]),
    ],
)
def test_designs_follow_some_coordinates_of_a_pose(name: str, parameters: list[str]) -> None:
    """Also those that place the link in its body; postures out of reach are errors as ever."""
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, parameters=parameters)
    platforms = swaying(robot, np.linspace(0.0, 2 * np.pi, ROWS))
    nominal = compiled.parameters.nominal
    p = nominal * (1.0 + 0.04 * np.random.default_rng(2).uniform(-1.0, 1.0, (9, len(nominal))))
    found = compiled.designs(p, platforms=platforms)
    assert found.good.all()
    assert found.recomputed == 0
    for k in range(0, len(p), 4):
        agrees(found, k, robot_of(compiled, p[k]), platforms=platforms)
    if name == "rps3":  # its slides have no ends
        return
    far = {
        link: tuple({**level, "z": 40 * level["z"]} for level in levels) for link, levels in platforms.items()
    }
    lost = compiled.designs(p[:2], platforms=far)
    assert not lost.good.any()
    assert lost.recomputed == 2
    assert set(lost.errors) == {0, 1}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "link", "names", "parameters"),
    [
        ("excavator", "teeth", "x z pitch", ["position:boom_pivot", "position:bucket_joint", "mass:stick"]),
        ("excavator", "teeth", "x z", ["position:boom_pivot", "position:bucket_joint", "mass:stick"]),
        ("stewart_ur5", "wrist_3_link", "", ["position:elbow_joint", "position:m1_leg1_cross_y"]),
    ],
)
def test_designs_follow_a_pose_through_several_modules(
    name: str, link: str, names: str, parameters: list[str], tmp_path: Path
) -> None:
    """Where freedoms are left, each design begins where the general path begins."""
    robot = load(name, tmp_path)
    compiled = hybridyn.compile(robot, parameters=parameters)
    states = swing(robot, 0.01, ROWS)
    levels = of_link(robot, *states, link, robot.description.root)
    platforms = {link: some_of(levels, names) if names else levels}
    nominal = compiled.parameters.nominal
    p = nominal * (1.0 + 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, (6, len(nominal))))
    found = compiled.designs(p, platforms=platforms)
    assert found.good.all()
    assert found.recomputed <= (3 if "pitch" in names else 0)  # from open loops at home some are not certain
    for k in range(0, len(p), 2):
        agrees(found, k, robot_of(compiled, p[k]), platforms=platforms)


@pytest.mark.slow
def test_frames_of_chains_that_a_parameter_places_are_left_to_the_general_path(tmp_path: Path) -> None:
    robot = load("excavator", tmp_path)
    for joint, known in (("teeth_joint", False), ("bucket_joint", True)):
        parameters = Parameters(robot.description, [Slot("joints", joint, "placement", (0, 3))])
        found = ClosingLibraries(robot, parameters).artifact(
            gather_requests(robot, {}, {"teeth": ({"x": 6.0, "z": 0.1},)})
        )
        assert (found is not None) == known


@pytest.mark.slow
def test_whole_poses_of_links_that_a_parameter_places_are_left_to_the_general_path() -> None:
    robot = hybridyn.load("rps3")
    fixed = next(joint.name for joint in robot.description.joints if joint.kind == "fixed")
    parameters = Parameters(robot.description, [Slot("joints", fixed, "placement", (0, 3))])
    rows = ClosingLibraries(robot, parameters)
    link = next(joint.child for joint in robot.description.joints if joint.name == fixed)
    pose = np.array([0.0, 0, 0.5, 0, 0, 0, 1])
    assert rows.moves_posed_links(gather_requests(robot, {}, {link: pose}))
    assert not rows.moves_posed_links(gather_requests(robot, {}, {link: {"z": 0.5}}))


@pytest.mark.slow
def test_a_library_that_differs_from_the_general_path_is_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    """A new library is compared with the general path at some designs; here its rates are off."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    right = ClosedRows.close

    def close(self: ClosedRows, slots: Array, *given: Any, **more: Any) -> Mask:
        certain = right(self, slots, *given, **more)
        given[2][1][:] *= 1.0 + 1e-6
        return certain

    monkeypatch.setattr(ClosedRows, "close", close)
    compiled = hybridyn.compile(hybridyn.load("five_bar"), parameters=["mass:m1_tool"])
    table = compiled.designs([[0.4]], motors=waves(compiled.robot, TIME, 0.1))
    assert (table.recomputed, compiled.recomputed) == (1, ROWS)
    assert "the compiled motion of the loops" in caplog.text
    assert "differs from the general path" in caplog.text


def test_new_models_are_tried_where_one_coordinate_of_each_position_moves() -> None:
    """Scaled positions stay on their lines; the least coordinate leaves them, or the next one does."""
    robot = hybridyn.load("five_bar")
    parameters = Parameters(robot.description, ["mass:m1_tool", "position:m1_left_elbow"])
    moved = [parameters.beside(BESIDE, place) - parameters.nominal for place in (0, 1)]
    assert [np.flatnonzero(x).tolist() for x in moved] == [[2], [3]]  # y leaves the plane
    *_, (last, _, own) = designs_to_verify(robot, parameters)
    assert not own
    np.testing.assert_array_equal(last, parameters.nominal + moved[1])


@pytest.mark.slow
def test_rows_that_hold_on_the_lines_of_rods_alone_are_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path, written_anew: None
) -> None:
    """A position moves a slide off the line of its rod; here the rows of that rod do not feel its turns."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr("hybridyn.compiled.equations.rods.loosened", lambda rods, *_: rods)
    robot = build_robot(rods.ball_gough(1, second="universal"))
    slides = [joint.name for joint in robot.description.joints if joint.kind.slides]
    motors = {name: (float(joint_position(robot, robot.home, name)), 0.0, 0.0) for name in robot.motors}
    libraries = ClosingLibraries(robot, Parameters(robot.description, [f"position:{slides[1]}"]))
    assert libraries.asked(gather_requests(robot, motors, {})) is None
    assert "the compiled motion of the loops" in caplog.text


@pytest.mark.slow
def test_designs_that_cannot_make_the_motion_have_the_error_of_the_general_path() -> None:
    compiled = hybridyn.compile(hybridyn.load("five_bar"), parameters=["position:m1_left_elbow"])
    wide = {name: (x[0] * 5, x[1] * 5, x[2] * 5) for name, x in waves(compiled.robot, TIME, 0.2).items()}
    nominal = compiled.parameters.nominal
    p = nominal + np.array([[0.0, 0, 0], [0.65, 0, 0], [0, 0.1, 0], [0.15, 0, 0]])
    found = compiled.designs(p, motors=wide)
    assert set(found.errors) >= {1, 2}  # too long: the loop closes at some postures only; out of the plane
    assert np.isnan(found.peak_effort[~found.good]).all()
    for k in range(len(p)):
        asked = lambda k=k: hybridyn.assemble(robot_of(compiled, p[k]), motors=wide)  # noqa: E731
        if found.good[k]:
            close_to(found.q[k], asked()[0], AGREE)
        else:
            refused(asked, hybridyn.HybridynError, re.escape(found.errors[k]))
    assert found.recomputed >= 2


#: A rod that carries a ballast where it is long.
CARRYING = COUNTED.replace(
    '<xacro:rods i="0" n="$(arg rods)"/>',
    """<xacro:rods i="0" n="$(arg rods)"/><xacro:if value="${$(arg length) &gt; 0.7}"><link name="ballast"/>
    <joint name="hold" type="fixed"><parent link="rod_1"/><child link="ballast"/></joint></xacro:if>""",
)


@pytest.mark.slow
def test_a_design_of_another_structure_gets_a_model_of_its_own(tmp_path: Path) -> None:
    """It has an error in a table; the robot with its arguments has a model like any other."""
    file = save(tmp_path, CARRYING, "stack.urdf.xacro")
    robot = hybridyn.load(file)
    compiled = hybridyn.compile(robot, parameters=["length"])
    motors = waves(robot, TIME, 0.3)
    found = compiled.designs([[0.4], [0.9], [0.6]], motors=motors)
    assert list(found.errors) == [1]
    assert "with length = 0.9, the links are others" in found.errors[1]
    assert found.recomputed == 0
    assert np.isnan(found.q[1]).all()
    own = partial(compiled.idm, found.q[0], found.v[0], found.a[0], parameters=[0.9])
    refused(own, hybridyn.ModelError, "compile a model of its own")
    other = hybridyn.compile(robot.with_parameters({"length": 0.9}), parameters=["length"])
    more = other.designs([[0.9], [0.8]], motors=motors)
    assert more.good.all()
    for table, k, length in ((found, 0, 0.4), (more, 0, 0.9)):
        agrees(table, k, hybridyn.load(file, xacro_args={"length": length}), motors=motors)


@pytest.mark.slow
def test_wrong_designs_are_refused() -> None:
    compiled = hybridyn.compile(hybridyn.load("five_bar"), parameters=["mass:m1_tool"])
    motors = waves(compiled.robot, TIME, 0.1)
    for designs, error, words in (
        ([[0.4], [-0.1]], hybridyn.ModelError, "mass of 'm1_tool' is negative in design 1"),
        ([[0.4, 1.0]], hybridyn.TrajectoryError, "parameters has shape"),
    ):
        refused(lambda: compiled.designs(designs, motors=motors), error, words)  # noqa: B023
