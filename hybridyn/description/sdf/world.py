"""Which model of an SDF file is the robot, and the gravity of its world."""

from __future__ import annotations

from typing import NamedTuple

from ...errors import ModelError
from ..names import did_you_mean, listed
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from . import fields
from .library import Library, Source

#: Models of Gazebo that are only scenery; they are not opened.
SCENERY = ("sun", "ground_plane")

#: Gravity of a world that states none [m/s^2].
GRAVITY = (0.0, 0.0, -9.8)

ONE_ROBOT = "hybridyn reads one robot: name it after the file, 'FILE#MODEL', or nest them in one <model>"

STATIC = (
    "a static model does not move at all, nor do its joints; to hold only its base, remove <static> and "
    "write a fixed joint with <parent>world</parent>"
)


class Chosen(NamedTuple):
    """The model that is the robot.

    Attributes:
        world: The world in which it stands, or None.
        model: The element `<model>`.
        source: The file in which it stands.
        own: The element that places it: `<include>`, or the model itself.
    """

    world: Node | None
    model: Node
    source: Source
    own: Node


def choose_model(root: Node, library: Library, robot: RobotFile) -> Chosen:
    """Return the only model that can move; note the static ones.

    Args:
        root: Root element `<sdf>`.
        library: Opens included files.
        robot: Takes the notes.

    Raises:
        ModelError: There is no such model, or there are several.
    """
    worlds, models = root.children("world"), root.children("model")
    if len(worlds) > 1 or (worlds and models):
        names = listed(node.text("name") for node in (*worlds, *models))
        raise root.error(f"{len(worlds) + len(models)} worlds and models: {names}; {ONE_ROBOT}")
    world = worlds[0] if worlds else None
    found: list[Chosen] = []
    still: list[str] = []
    for own in models if world is None else world.children("model", "include"):
        if own.tag == "include" and _names(own)[0] in SCENERY:
            still += _names(own)
            continue
        model, source = library.open(own, library.source) if own.tag == "include" else (own, library.source)
        name = fields.name_of(own, model)
        if fields.flag(own, "static", fields.flag(model, "static")):
            still.append(name)
        else:
            found.append(Chosen(world, model, source, own))
    if len(found) != 1:
        raise _refusal(root, found, still)
    if still:
        robot.notes.append(f"static models are left out: {listed(still)}")
    if world is not None and world.child("state") is not None:
        robot.notes.append("the <state> of the world is not read: poses are those of the models")
    return found[0]


def keep_model(root: Node, name: str) -> None:
    """Remove all models and worlds but one model and its world.

    Args:
        root: Root element of a robot file; it is changed.
        name: Name of the model, or of the folder from which a world includes it.

    Raises:
        ModelError: The file is not SDF, or no model or several ones have this name.
    """
    if root.tag != "sdf":
        raise root.error(f"only an SDF file has several models; remove '#{name}'")
    worlds = root.children("world")
    stated = [(holder, own) for holder in (root, *worlds) for own in holder.children("model", "include")]
    kept = [(holder, own) for holder, own in stated if name in _names(own)]
    if len(kept) != 1:
        known = [known for _, own in stated for known in _names(own)]
        count = f"{len(kept)} models are" if kept else "no model is"
        raise root.error(f"{count} named '{name}'{did_you_mean(name, known)}; the file has {listed(known)}")
    ((home, chosen),) = kept
    for holder, own in stated:
        if own.xml is not chosen.xml:
            holder.xml.remove(own.xml)
    for world in worlds:
        if world.xml is not home.xml:
            root.xml.remove(world.xml)


def _names(own: Node) -> list[str]:
    """Return the name of a model as its world knows it, or the folder of an included one."""
    if own.tag == "model":
        return [own.text("name")]
    return [fields.word(own, "name") or fields.word(own, "uri").rstrip("/").rpartition("/")[2]]


def gravity_of(world: Node | None) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity of a world [m/s^2], None without a world.

    Args:
        world: The element `<world>`, or None.

    Raises:
        ModelError: It is no vector.
    """
    if world is None:
        return None
    node = world.child("gravity")
    for physics in world.children("physics"):  # SDFormat 1.4
        node = node or physics.child("gravity")
    if node is None or not node.content():
        return GRAVITY
    x, y, z = (float(number) for number in node.content_numbers(3))
    return x, y, z


def _refusal(root: Node, found: list[Chosen], still: list[str]) -> ModelError:
    if found:
        names = listed(fields.name_of(one.own, one.model) for one in found)
        return root.error(f"{len(found)} models that move: {names}; {ONE_ROBOT}")
    if still:
        return root.error(f"no model that moves, only {listed(still)}; {STATIC}")
    return root.error("no <model>; a robot is one")
