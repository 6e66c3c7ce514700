"""What the page's scene is told while a robot moves: shapes stay in the frames of their bodies."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import hybridyn
from hybridyn.colours import rgb
from hybridyn.spatial import rotation_from_quaternion
from hybridyn.view.drawing import draw
from hybridyn.view.picture import Picture
from hybridyn.view.placing import Placement, place_bodies
from hybridyn.view.stage import PageStage
from hybridyn.view.visuals import read_visuals
from tests import ROOT
from tests.support.extras import needs

needs("view")

SINGLE = 1e-6  # the scene's numbers have single precision


class Scene:
    """The calls of viser's scene that a stage makes; a node keeps what it was given last."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}

    def _add(self, name: str, *_: str, **facts: Any) -> Any:
        pose = {"wxyz": np.array([1.0, 0, 0, 0]), "position": np.zeros(3), "scale": 1.0, "visible": True}
        node = SimpleNamespace(name=name, **pose, **facts)
        assert name not in self.nodes
        assert not facts.get("show_axes")
        self.nodes[name] = node
        return node

    add_frame = add_mesh_simple = _add

    def in_the_world(self) -> np.ndarray:
        """Return the corners of all shapes, shape (N, 3), in the world."""
        return np.concatenate([corners(self.nodes, node) for node in self.meshes().values()])

    def meshes(self, growing: bool | None = None) -> dict[str, Any]:
        """Return the nodes with shapes; those that grow, or the others, if asked for."""
        shapes = {name: node for name, node in self.nodes.items() if hasattr(node, "vertices")}
        return {k: x for k, x in shapes.items() if growing is None or (np.size(x.scale) == 3) == growing}


def corners(nodes: dict[str, Any], node: Any) -> np.ndarray:
    """Return the corners of a shape in the world, shape (N, 3)."""
    frame = nodes[node.name.rpartition("/")[0]]
    local = (node.vertices * node.scale) @ turn(node).T + node.position
    return local @ turn(frame).T + frame.position


def turn(node: Any) -> np.ndarray:
    return rotation_from_quaternion(np.asarray(node.wxyz)[[1, 2, 3, 0]])


def moved(name: str, by: float = 0.04) -> tuple[hybridyn.HybridRobot, Placement]:
    """Return a shipped robot and the places of its bodies away from home, one motor further than others."""
    robot = hybridyn.load(ROOT / f"urdf/{name}.urdf.xacro")
    motors = dict.fromkeys(robot.motors, 0.01) | {robot.motors[0]: by}
    return robot, place_bodies(robot, hybridyn.assemble(robot, motors=motors)[0])


def staged(robot: hybridyn.HybridRobot, picture: Picture) -> tuple[Scene, PageStage]:
    scene = Scene()
    stage = PageStage(SimpleNamespace(scene=scene), robot, picture)
    stage.place(place_bodies(robot, robot.home))
    return scene, stage


def apart(points: np.ndarray, others: np.ndarray) -> float:
    """Return the largest distance of a point of one set from the other set."""
    return max(cKDTree(x).query(y)[0].max() for x, y in ((points, others), (others, points)))


@pytest.mark.parametrize("name", ["rps3", "delta"])
def test_shapes_stay_on_their_links_because_only_the_links_frames_move(name: str) -> None:
    robot, placement = moved(name)
    picture = draw(robot)
    scene, stage = staged(robot, picture)
    kept = {key: vars(node).copy() for key, node in scene.meshes(growing=False).items()}
    stage.place(placement)
    for key, before in kept.items():
        assert all(value is before[word] for word, value in vars(scene.nodes[key]).items())
    wanted = np.concatenate([placement.of(shape) for shape in picture.shapes])
    assert len(scene.in_the_world()) == len(wanted)
    assert apart(scene.in_the_world(), wanted) < SINGLE


def test_a_rod_that_grows_keeps_to_the_line_of_its_slide() -> None:
    """Its direction and its foot do not change in the frame of the body that carries the slide."""
    robot, placement = moved("rps3")
    scene, stage = staged(robot, draw(robot))
    stage.place(placement)
    growing = [*scene.meshes(growing=True).values()]
    assert len(growing) == 3
    before = [(turn(node)[:, 2], np.array(node.position), np.array(node.scale)) for node in growing]
    stage.place(moved("rps3", 0.02)[1])
    for node, (along, foot, scale) in zip(growing, before, strict=True):
        assert turn(node)[:, 2] == pytest.approx(along, abs=SINGLE)
        assert node.position == pytest.approx(foot, abs=SINGLE)
        assert (*node.scale[:2], *scale[:2]) == (1.0, 1.0, 1.0, 1.0)
    pairs = zip(growing, before, strict=True)
    grown = [np.abs(node.scale - scale).max() for node, (_, _, scale) in pairs]
    assert max(grown) == pytest.approx(0.02, abs=SINGLE)


def test_roles_are_hidden_and_files_have_colours_of_their_own() -> None:
    file = ROOT / "urdf/rps3.urdf.xacro"
    robot = hybridyn.load(file)
    picture = draw(robot, *read_visuals(str(file), {}, ()))
    scene, stage = staged(robot, picture)
    stage.show("closure", False)
    hidden = {node.name.rpartition("/")[2].split()[0] for node in scene.meshes().values() if not node.visible}
    assert hidden == {"closure"}
    stage.paint(own_colours=True)
    own = {rgb(shape.own_colour) for shape in picture.shapes if shape.own_colour}
    assert {node.color for node in scene.meshes().values()} >= own
    stage.paint(own_colours=False)
    assert {node.color for node in scene.meshes().values()} == {rgb(shape.colour) for shape in picture.shapes}
