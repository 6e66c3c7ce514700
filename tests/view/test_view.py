"""`hybridyn view`: shapes and their poses, postures moved by hand, images and films."""

import dataclasses
import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hybridyn
from hybridyn.colours import ALARM, CLOSURE, MOTOR, module_colour, rgb
from hybridyn.description import read
from hybridyn.errors import install_advice
from hybridyn.structure.building import build_robot
from hybridyn.view.camera import Camera, camera_around
from hybridyn.view.drawing import draw, hull
from hybridyn.view.panel import closeness, effort_limits, efforts_html, holding, status_html
from hybridyn.view.picture import Picture, PictureShape
from hybridyn.view.placing import Placement, extent, place_bodies
from hybridyn.view.posing import Poser
from hybridyn.view.render import render
from hybridyn.view.run import ShownMotion
from hybridyn.view.visuals import read_visuals
from tests import ROOT
from tests.robots.excavator import HOME, excavator, teeth
from tests.robots.robot_texts import FOUR_BAR, save
from tests.robots.shipped import ROBOTS
from tests.support.command_line import call
from tests.support.extras import needs
from tests.support.waiting import wait_until

needs("view")
EXACT = 1e-12  # relative: the same numbers by two ways
CLOSED = 1e-9  # relative: `assemble` closes loops to rounding
SINGLE = 1e-6  # m: the page has numbers in single precision


@lru_cache(maxsize=4)
def loaded(name: str) -> hybridyn.HybridRobot:
    return hybridyn.load(ROOT / f"urdf/{name}.urdf.xacro")


def without_limits(name: str) -> hybridyn.HybridRobot:
    description = read(ROOT / f"urdf/{name}.urdf.xacro")
    joints = tuple(dataclasses.replace(j, lower=-np.inf, upper=np.inf) for j in description.joints)
    return build_robot(dataclasses.replace(description, joints=joints))


@pytest.mark.parametrize("name", ["tanev", "stewart_ur5", "snake"])
def test_bodies_are_where_the_kinematics_have_them(name: str) -> None:
    robot = loaded(name)
    q, v, _ = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, 0.01))
    placement = place_bodies(robot, q)
    for link, motion in hybridyn.kinematics(robot, q, v).items():
        body, _, p = robot.bodies.place[link]
        at = placement.p[body] + placement.R[body] @ p
        assert at == pytest.approx(motion.pose[:3], abs=EXACT)


def test_bodies_of_a_moving_base_are_where_the_base_is() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro", base="floating")
    q = robot.home.copy()
    q[:7] = [1.0, 2.0, 3.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    placement, fixed = place_bodies(robot, q), place_bodies(loaded("five_bar"), loaded("five_bar").home)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert placement.p == pytest.approx(fixed.p @ turn.T + [1.0, 2.0, 3.0], abs=EXACT)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_closure_and_motor_is_marked_and_every_rod_ends_where_it_should(name: str) -> None:
    robot = loaded(name)
    picture = draw(robot)
    marked = {shape.name for shape in picture.shapes if shape.role == "closure"}
    assert marked == {closure.name for closure in robot.description.closures}
    assert {shape.name for shape in picture.shapes if shape.role == "motor"} == set(robot.motors)
    home = place_bodies(robot, robot.home)
    for shape in picture.shapes:
        if shape.ends is not None:
            low, high = (home.of(shape)[shape.vertices[:, 2] == z].mean(axis=0) for z in (0.0, 1.0))
            wanted = [home.at(end) for end in shape.ends]
            assert np.array([low, high]) == pytest.approx(np.array(wanted), abs=EXACT * picture.size)
    modules = {shape.module for shape in picture.shapes}
    assert modules >= {k for k, module in enumerate(robot.modules) if module.closures}


def test_a_slide_is_a_rod_that_grows() -> None:
    robot = loaded("rps3")
    picture = draw(robot)
    slide = next(shape for shape in picture.shapes if shape.name == "m1_leg1_slide" and shape.ends)
    grown = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, 0.05))[0]
    placed = [place_bodies(robot, q) for q in (robot.home, grown)]
    lengths = [np.linalg.norm(np.subtract(*map(placement.at, slide.ends))) for placement in placed]
    assert abs(lengths[1] - lengths[0]) == pytest.approx(0.05, abs=CLOSED)


def test_shapes_of_the_file_are_drawn_and_closed() -> None:
    file = str(ROOT / "urdf/lx4.urdf.xacro")
    visuals, notes = read_visuals(file, {}, ())
    assert notes == []
    picture = draw(loaded("lx4"), visuals)
    links = [shape for shape in picture.shapes if shape.role == "link"]
    assert len(links) == len(visuals) > 4 * 12  # two parts per leg, and platforms
    assert all(shape.own_colour for shape in links)
    assert {shape.colour for shape in links} >= {module_colour(k) for k in range(-1, 4)}


def test_a_missing_mesh_is_noted_and_its_link_drawn_as_a_rod(tmp_path: Path) -> None:
    visual = '<visual><geometry><mesh filename="package://nowhere/{}.stl"/></geometry></visual>'
    text = FOUR_BAR.replace('<link name="crank">', f'<link name="crank">{visual.format("crank")}')
    path = save(tmp_path, text)
    visuals, notes = read_visuals(str(path), {}, ())
    assert visuals == []
    assert "package://nowhere/crank.stl" in notes[0]
    picture = draw(hybridyn.load(path), visuals, notes)
    assert "crank" in {shape.name for shape in picture.shapes}


def test_meshes_are_found_beside_the_file_and_in_packages(tmp_path: Path) -> None:
    import trimesh

    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    trimesh.creation.box(extents=(1000.0, 100.0, 100.0)).export(tmp_path / "arm/meshes/bar.stl")
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}" scale="0.001 0.001 0.001"/></geometry>'
        '<material name="m"><color rgba="1 0 0 1"/></material></visual>'
        for name in ("arm/meshes/bar.stl", "package://arm/meshes/bar.stl")
    )
    path = save(tmp_path, FOUR_BAR.replace('<link name="crank">', f'<link name="crank">{shapes}'))
    visuals, notes = read_visuals(str(path), {}, [tmp_path])
    assert notes == []
    assert [v.colour for v in visuals] == ["#ff0000"] * 2
    assert np.ptp(visuals[1].vertices, axis=0) == pytest.approx([1.0, 0.1, 0.1])


@pytest.mark.parametrize("role", ["link", "motor", "joint", "closure"])
def test_shapes_are_closed_and_face_outwards(role: str) -> None:
    import trimesh

    for shape in draw(loaded("rps3")).shapes:
        if shape.role == role:
            mesh = trimesh.Trimesh(shape.vertices, shape.faces)
            assert mesh.is_watertight
            assert mesh.volume > 0


def test_the_hull_of_flat_points_is_a_plate_and_of_a_line_nothing() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    vertices, faces = hull(square, 0.1)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(0.2)
    assert hull(np.linspace([0, 0, 0], [1, 2, 3], 4), 0.1) is None


def test_a_limb_with_motors_at_its_sides_is_no_plate() -> None:
    shank = np.array([[0.0, 0, 0], [0, 0.05, -0.2], [0, -0.05, -0.2], [0, 0, -0.4]])
    assert hull(shank, 0.01) is None
    assert hull(shank * [1, 5, 1], 0.01) is not None


def test_a_floating_joint_holds_its_base_nowhere(tmp_path: Path) -> None:
    """The ground under a platform on legs is as flat as their feet, which stand at z = 0."""
    blocks = (ROOT / "docs/describing-loops.md").read_text().split("```")
    text = next(block for block in blocks if "whole=platform.urdf.xacro" in block).partition("\n")[2]
    picture = draw(hybridyn.load(save(tmp_path, text, "platform.urdf.xacro")))
    (ground,) = (shape for shape in picture.shapes if shape.module < 0 and shape.role == "link")
    assert np.ptp(ground.vertices[:, 2]) < 0.1 * np.ptp(ground.vertices[:, 0])


def image_of(shapes: list[tuple[np.ndarray, str]], size: int = 80) -> np.ndarray:
    """Render triangles, shape (N, 3, 3), from above: x to the right, y up, both from -1 to 1."""
    needs("view", "embreex")
    made = [
        PictureShape(
            "t", "link", -1, 0, corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), colour
        )
        for corners, colour in shapes
    ]
    picture = Picture(tuple(made), np.array([[-9.0, -9, -9], [-8, -8, -9]]))  # the floor is elsewhere
    angle = 0.1
    camera = Camera(np.array([0.0, -1e-9, 1 / np.tan(angle)]), np.zeros(3), size, size, angle)
    return render(picture, Placement(np.eye(3)[None], np.zeros((1, 3))), camera)


def test_the_nearer_triangle_is_seen_whatever_their_order() -> None:
    triangle = np.array([[[-0.9, -0.9, 0.0], [0.9, -0.9, 0.0], [-0.9, 0.9, 0.0]]])
    far, near = (triangle, "#ff0000"), (0.5 * triangle + [0.0, 0.0, 1.0], "#00ff00")
    for order in ([far, near], [near, far]):
        image = image_of(order)
        assert image[48, 32].argmax() == 1
        assert image[70, 10].argmax() == 0
        assert image[5, 70].tolist() == [255, 255, 255]


def test_triangles_that_share_an_edge_leave_no_gap() -> None:
    a, b, c, d = [-0.97, -0.91, 0.0], [0.83, -0.77, 0.0], [0.91, 0.87, 0.0], [-0.7, 0.77, 0.0]
    image = image_of([(np.array([[a, b, d], [b, c, d]]), "#ff0000")], 200)
    assert np.ptp(image[60:150, 60:150], axis=(0, 1)).tolist() == [0, 0, 0]


def test_the_camera_sees_the_whole_robot() -> None:
    picture = draw(loaded("lx4"))
    for width, height in ((400, 800), (1600, 400)):
        camera = camera_around(picture.corners, width, height)
        edge = camera.rays(np.array([0, width]), np.array([[0], [height]])) @ camera.axes
        box = (np.array(np.meshgrid(*picture.corners.T)).reshape(3, -1).T - camera.eye) @ camera.axes
        assert (box[:, 2] < 0).all()
        assert (np.abs(box[:, :2] / box[:, 2:]) <= np.abs(edge[0, 0, :2])).all()
    upright = Camera(np.array([0.0, -5.0, 0.0]), np.zeros(3), 100, 100)
    ray = upright.rays(np.array(50 + 15.1), np.array(50 - 15.1))
    assert 5 * ray / ray[1] == pytest.approx([0.5, 5.0, 0.5], abs=0.01)


def colours_in(image: np.ndarray, colour: str, hue: float = 0.1) -> int:
    """Count pixels of a colour's hue."""
    pixels, wanted = image / 255, np.array(rgb(colour)) / 255
    spread = np.ptp(pixels, axis=2, keepdims=True)
    pure = (pixels - pixels.min(axis=2, keepdims=True)) / np.maximum(spread, 1e-9)
    goal = (wanted - wanted.min()) / np.ptp(wanted)
    return int(((np.abs(pure - goal).max(axis=2) < hue) & (spread[..., 0] > 0.2)).sum())


def test_a_picture_has_every_module_and_closure_in_it() -> None:
    robot = loaded("lx4")
    picture = draw(robot)
    image = render(picture, place_bodies(robot, robot.home), camera_around(picture.corners, 300, 400))
    assert image.shape == (400, 300, 3)
    for colour in (*(module_colour(k) for k in range(4)), CLOSURE):
        assert colours_in(image, colour) > 30, colour
    dark = (image.max(axis=2) < 90).sum()
    assert dark > 30, MOTOR
    assert (image == 255).all(axis=2).mean() > 0.4  # and there is a background


@pytest.mark.parametrize("name", ROBOTS)
def test_motors_moved_by_hand_keep_the_loops_closed_and_the_others_where_they_are(name: str) -> None:
    robot = loaded(name)
    poser = Poser(robot)
    assert [lever.joint for lever in poser.levers] == list(robot.motors)
    q = robot.home
    for lever in poser.levers[:3]:
        start = poser.value(q, lever.joint)
        wanted = start + 0.02 * (lever.high - start)
        others = {name: poser.value(q, name) for name in robot.motors if name != lever.joint}
        moved = poser.move(q, lever.joint, wanted)
        assert moved.message == ""
        assert poser.value(moved.q, lever.joint) == pytest.approx(wanted, abs=CLOSED)
        for other, value in others.items():
            assert poser.value(moved.q, other) == pytest.approx(value, abs=CLOSED)
        assert hybridyn.closure_residual(robot, moved.q) < CLOSED
        q = moved.q


@pytest.mark.parametrize("name", ["stewart_ur5", "scara_delta", "lx4", "rps3", "gough_stewart", "five_bar"])
def test_a_dragged_tool_moves_all_that_carries_it(name: str) -> None:
    """It is where it was dragged; the loops are closed, and the first module has moved, too."""
    robot = loaded(name)
    poser = Poser(robot)
    link = poser.links[-1]
    p, R = poser.pose(robot.home, link)
    way = np.array([0.0, 0.0, 0.02]) if name == "rps3" else np.array([0.01, 0.0, 0.02])
    moved = poser.drag(robot.home, link, p + way, R)
    assert moved.message == ""
    q = moved.q
    assert poser.pose(q, link)[0] == pytest.approx(p + way, abs=CLOSED)
    if robot.mobility >= 6:
        assert poser.pose(q, link)[1] == pytest.approx(R, abs=CLOSED)
    assert hybridyn.closure_residual(robot, q) < CLOSED
    first = robot.modules[0].q_index
    assert (q[first] != robot.home[first]).any()


def test_an_excavators_teeth_are_dragged_by_triangles(tmp_path: Path) -> None:
    robot = hybridyn.load(excavator(tmp_path))
    poser = Poser(robot)
    assert poser.links == ("teeth",)
    p, _ = poser.pose(robot.home, "teeth")
    moved = poser.drag(robot.home, "teeth", p + np.array([0.2, 0.3, -0.1]))  # it cannot go aside
    way = np.array([0.2, 0.0, -0.1])
    assert poser.pose(moved.q, "teeth")[0] == pytest.approx(p + way, abs=CLOSED)
    joints = (robot.joint_index[f"{name}_joint"] for name in ("boom", "stick", "bucket"))
    at = [robot.q_slices[i].start for i in joints]
    turns = np.arctan2(moved.q[np.add(at, 1)], moved.q[at])
    found = teeth(HOME + turns)
    assert found == pytest.approx(teeth(HOME) + np.array([0.2, -0.1, 0.0]), abs=CLOSED)


def test_the_handle_on_the_page_drags_the_tool_and_returns_to_it() -> None:
    from hybridyn.view.page import Page

    robot = loaded("five_bar")
    page = Page(robot, draw(robot), port=0)
    try:
        assert page._grip is not None
        grip, (p, _) = page._grip.handle, page.poser.pose(robot.home, "m1_tool")
        assert grip.position == pytest.approx(p, abs=SINGLE)
        grip.position = p + np.array([0.02, 0.05, 0.01])  # it cannot go aside
        for phase in ("start", "update", "end"):
            page._grip.dragged(SimpleNamespace(phase=phase))
        wanted = p + np.array([0.02, 0.0, 0.01])
        wait_until(lambda: grip.position == pytest.approx(wanted, abs=SINGLE), "the handle at the tool")
        assert page.poser.pose(page.q, "m1_tool")[0] == pytest.approx(wanted, abs=SINGLE)
    finally:
        page.close()


def test_a_tool_stops_where_a_motor_ends() -> None:
    robot = loaded("gough_stewart")
    poser = Poser(robot)
    p, R = poser.pose(robot.home, "m1_platform")
    moved = poser.drag(robot.home, "m1_platform", p + np.array([1.0, 0.0, 0.0]), R)
    assert "m1_platform stops after" in moved.message
    assert "_slide is at the end of its range" in moved.message
    assert poser.pose(moved.q, "m1_platform")[0][0] == pytest.approx(p[0] + moved.value, abs=CLOSED)
    assert 0.1 < moved.value < 1.0


def test_a_jump_ends_where_small_steps_end() -> None:
    robot = without_limits("gough_stewart")
    poser, motor = Poser(robot), robot.motors[0]
    start = poser.value(robot.home, motor)
    q = robot.home
    for step in range(1, 11):
        q = poser.move(q, motor, start + 0.02 * step).q
    assert poser.move(robot.home, motor, start + 0.2).q == pytest.approx(q, abs=CLOSED)


@pytest.mark.slow
def test_out_of_reach_stops_at_a_closed_posture_near_the_end_with_a_message() -> None:
    robot = without_limits("rps3")
    poser, motor = Poser(robot), robot.motors[0]
    moved = poser.move(robot.home, motor, -0.5)
    assert f"{motor} stops at" in moved.message
    assert "m1_platform do not close" in moved.message
    assert hybridyn.closure_residual(robot, moved.q) < CLOSED
    assert poser.value(moved.q, motor) == pytest.approx(moved.value, abs=CLOSED)
    assert -0.5 < moved.value < -0.1
    assert poser.move(moved.q, motor, moved.value + 0.05).message == ""  # and it can go back


def test_redundant_motors_yield_and_missing_ones_are_held_by_passive_joints() -> None:
    joints = ["m1_left_drive", "m1_right_drive", "m1_left_elbow"]
    passive = {j.name for j in read(ROOT / "urdf/five_bar.urdf.xacro").joints} - set(joints[:2])
    redundant = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro", motors=[*joints[:2], *sorted(passive)[:1]])
    short = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro", motors=joints[:1])
    for robot in (redundant, short):
        poser = Poser(robot)
        moved = poser.move(robot.home, joints[0], poser.value(robot.home, joints[0]) + 0.1)
        assert moved.message == ""
        assert hybridyn.closure_residual(robot, moved.q) < CLOSED


def test_a_robot_without_motors_is_moved_by_its_independent_joints() -> None:
    description = dataclasses.replace(read(ROOT / "urdf/five_bar.urdf.xacro"), motors=())
    poser = Poser(build_robot(description))
    assert len(poser.levers) == 2


def test_measures_are_those_of_the_library() -> None:
    robot = loaded("five_bar")
    still = np.zeros(robot.nv)
    event = hybridyn.near_singularity(robot, 0.0, what="motors")
    assert closeness(robot, robot.home)["motors"] == event.function(0.0, robot.home, still)
    tau, reason = holding(robot, robot.home)
    assert reason == ""
    assert tau == pytest.approx(hybridyn.idm(robot, robot.home, still, still))


def test_efforts_over_a_limit_are_marked_and_names_are_escaped() -> None:
    robot = loaded("five_bar")
    limits = np.array(effort_limits(robot))
    html = efforts_html(robot, limits * [2.0, 0.5], limits * [2.0, 0.5], "of <a test>")
    assert html.count(ALARM) == 1
    assert html.count("width:50.0%") == 1  # the largest fills its half of the track
    assert "of &lt;a test&gt;" in html
    assert 'data-stopped="1"' in status_html("<b>", 0.0)
    assert "&lt;b&gt;" in status_html("<b>", 0.0)


def test_a_run_shows_the_nearest_sample() -> None:
    run = ShownMotion(np.array([0.0, 1.0, 3.0]), np.zeros((3, 1)), None, "")
    assert [run.index(t) for t in (-1.0, 0.4, 0.6, 1.9, 2.1, 9.0)] == [0, 0, 1, 1, 2, 2]


@pytest.mark.slow
def test_the_command_writes_a_picture_of_any_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from PIL import Image

    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file, at in zip(files, (0.0, 0.3), strict=True):
        words = ("view", "delta", "delta/traj.csv", "--plot", file, "--time", at, "--size", "200x160")
        call(capsys, *words)
    images = [np.asarray(Image.open(file)) for file in files]
    assert [image.shape for image in images] == [(160, 200, 3)] * 2
    assert (images[0] != images[1]).any(axis=2).sum() > 200
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


@pytest.mark.slow
def test_the_command_writes_a_film(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imageio_ffmpeg = needs("view", "imageio_ffmpeg")
    table = tmp_path / "short.csv"
    lines = (ROOT / "models/delta/traj.csv").read_text().splitlines()
    header = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    table.write_text("\n".join(lines[header : header + 300]) + "\n")
    film = tmp_path / "short.mp4"
    call(capsys, "view", "delta", table, "--plot", film, "--size", "160x120")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    times = np.loadtxt(table, delimiter=",", skiprows=1, usecols=0)
    assert seconds == pytest.approx(np.ptp(times), abs=0.1)
    assert frames == pytest.approx(25 * np.ptp(times), abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("frames", [2, 200])  # ffmpeg ends after the last of few, and among many
def test_a_film_that_is_cut_short_is_an_error(frames: int, tmp_path: Path) -> None:
    """Files of 2,000 bytes at most stand for a full disk."""
    needs("view", "imageio_ffmpeg")
    program = (
        "import resource, sys, numpy; from hybridyn.view.film import save_mp4\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))\n"
        "noise = numpy.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=numpy.uint8)\n"
        f"save_mp4(iter({frames} * [noise]), (160, 120), 'film.mp4')"
    )
    done = subprocess.run([sys.executable, "-B", "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.stderr.endswith("the film is not complete; is the disk full?: 'film.mp4'\n")


@pytest.mark.parametrize("package", ["viser", "yourdfpy", "trimesh"])
def test_what_is_missing_is_said_before_any_work(
    package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    page = package == "viser"
    words = ("view", "delta", *(() if page else ("--plot", "a.png")))
    call(capsys, *words, status=1, says=f"this needs {package}: {install_advice('view')}")


def test_the_box_of_a_robot_holds_its_bodies() -> None:
    robot = loaded("delta")
    picture = draw(robot)
    low, high = extent(picture, place_bodies(robot, robot.home))
    points = place_bodies(robot, robot.home).p[1:]
    assert (points >= low - EXACT).all()
    assert (points <= high + EXACT).all()
