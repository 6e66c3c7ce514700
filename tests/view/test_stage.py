"""What the page's scene is told while a robot moves: shapes stay in the frames of their bodies."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.spatial import rotation_from_quaternion
from hybridyn.view.drawing import draw
from hybridyn.view.picture import Ball, Picture, Rod
from hybridyn.view.placing import Placement, place_bodies
from hybridyn.view.stage import Stage
from hybridyn.view.triangles import ball_transforms, rod_transforms
from tests import ROOT

SINGLE = 1e-6  # the scene's numbers have single precision


class Scene:
    """The calls of viser's scene that a stage makes; a node keeps what it was given last."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}

    def _add(self, name: str, *_: str, **facts: Any) -> Any:
        node = SimpleNamespace(name=name, wxyz=np.array([1.0, 0, 0, 0]), position=np.zeros(3), **facts)
        assert name not in self.nodes
        assert not facts.get("show_axes")
        self.nodes[name] = node
        return node

    add_frame = add_batched_meshes_simple = add_mesh_simple = add_label = _add

    def in_the_world(self, kind: str) -> np.ndarray:
        """Return the origins of all copies in the batches of a kind, shape (N, 3), in the world."""
        found = []
        for name, node in self.nodes.items():
            if name.endswith(kind) and hasattr(node, "batched_positions"):
                frame = self.nodes[name.rpartition("/")[0]]
                R = rotation_from_quaternion(np.asarray(frame.wxyz)[[1, 2, 3, 0]])
                found.append(np.asarray(node.batched_positions) @ R.T + frame.position)
        return np.concatenate(found)


def moved(name: str, by: float = 0.04) -> tuple[hybridyn.HybridRobot, Placement]:
    """Return a shipped robot and the places of its bodies away from home, one motor further than others."""
    robot = hybridyn.load(ROOT / f"urdf/{name}.urdf.xacro")
    motors = dict.fromkeys(robot.motors, 0.01) | {robot.motors[0]: by}
    return robot, place_bodies(robot, hybridyn.assemble(robot, motors=motors)[0])


def staged(robot: hybridyn.HybridRobot, picture: Picture) -> tuple[Scene, Stage]:
    scene = Scene()
    stage = Stage(SimpleNamespace(scene=scene), robot, picture)
    stage.place(place_bodies(robot, robot.home))
    return scene, stage


def in_order(points: np.ndarray) -> np.ndarray:
    """Return points in an order of their own, so that two sets can be compared."""
    return points[np.lexsort(np.round(points, 5).T)]


@pytest.mark.parametrize("name", ["rps3", "delta"])
def test_shapes_stay_on_their_links_because_only_the_links_frames_move(name: str) -> None:
    """The browser is late with new positions inside a batch: there are none but of rods that grow."""
    robot, placement = moved(name)
    picture = draw(robot)
    scene, stage = staged(robot, picture)
    kept = {
        name: (np.array(node.batched_positions), np.array(node.batched_wxyzs), np.array(node.batched_scales))
        for name, node in scene.nodes.items()
        if hasattr(node, "batched_positions") and "growing" not in name
    }
    assert any(name.endswith("balls") for name in kept)
    stage.place(placement)
    for name, (positions, quaternions, scales) in kept.items():
        node = scene.nodes[name]
        assert (node.batched_positions == positions).all()
        assert (node.batched_wxyzs == quaternions).all()
        assert (node.batched_scales == scales).all()
    centres, _ = ball_transforms(picture.balls, placement)
    assert in_order(scene.in_the_world("balls")) == pytest.approx(in_order(centres), abs=SINGLE)
    _, origins, _ = rod_transforms(picture.rods, placement)
    assert in_order(scene.in_the_world("rods")) == pytest.approx(in_order(origins), abs=SINGLE)
    shapes: tuple[Rod | Ball, ...] = (*picture.rods, *picture.balls)
    assert {role for role, nodes in stage.nodes.items() if nodes} == {shape.role for shape in shapes}


def test_a_rod_that_grows_keeps_to_the_line_of_its_slide() -> None:
    """Its direction and its foot do not change in the frame of the body that carries the slide."""
    robot, placement = moved("rps3")
    scene, stage = staged(robot, draw(robot))
    stage.place(placement)
    growing = [node for name, node in scene.nodes.items() if "growing" in name]
    assert len(growing) == 3
    before = [(line(node), np.array(node.batched_positions), node.batched_scales) for node in growing]
    stage.place(moved("rps3", 0.02)[1])
    for node, (along, feet, scales) in zip(growing, before, strict=True):
        assert line(node) == pytest.approx(along, abs=SINGLE)
        assert node.batched_positions == pytest.approx(feet, abs=SINGLE)
        assert node.batched_scales[:, :2] == pytest.approx(scales[:, :2])
    pairs = zip(growing, before, strict=True)
    grown = [np.abs(node.batched_scales - scales).max() for node, (_, _, scales) in pairs]
    assert max(grown) == pytest.approx(0.02, abs=SINGLE)


def line(node: Any) -> np.ndarray:
    """Return the directions of rods, shape (N, 3), in their frame."""
    return rotation_from_quaternion(np.asarray(node.batched_wxyzs)[:, [1, 2, 3, 0]])[:, :, 2]
