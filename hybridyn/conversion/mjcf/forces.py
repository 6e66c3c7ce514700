"""Write what stands in bodies: of joints limits, damping, friction, rotors, springs and motors; shapes.

Shapes are geoms that touch nothing and weigh nothing.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import FREEDOMS, Description
from ...description.shape_files import Shape
from ..numerals import add, put
from ..request import Losses, Request, add_limits
from .bodies import Tree, pose

#: Effects that stand in the file itself; the others go to model.toml.
SAID = ("spring", "damper")

#: Endings of the meshes that MuJoCo reads.
MESHES = (".stl", ".obj", ".msh")
#: Most triangles of an STL file that MuJoCo reads.
MOST_FACES = 200_000


def with_effects(d: Description) -> Description:
    """Return a robot whose joints have the damping of dampers and the friction of its effects, too."""
    effects = dict(d.effects)
    dampers = effects.get("damper", {}).get("coefficient", {})
    levels = effects.get("coulomb_friction", {}).get("level", {})
    joints = (
        replace(
            joint,
            damping=joint.damping + dampers.get(joint.name, 0.0),
            friction=levels.get(joint.name, joint.friction),
        )
        for joint in d.joints
    )
    return replace(d, joints=tuple(joints))


def add_forces(root: ET.Element, d: Description, tree: Tree) -> None:
    """Add limits and forces to the joints of a robot of `parts`, and its motors to the root element.

    A motor has no gear: its control is the effort at the joint.
    """
    springs, driven = {spring.name: spring for spring in d.springs if spring.stiffness}, {*d.motors}
    limits = {joint.name: joint.effort_limit for joint in d.joints}
    for joint in (joint for joint in d.joints if joint.kind not in ("fixed", "floating")):
        put(tree.joints[joint.name], damping=joint.damping or None, armature=joint.armature or None)
        if joint.kind == "spherical":
            continue
        bounds, effort, spring = (joint.lower, joint.upper), limits[joint.name], springs.get(joint.name)
        limited = joint.lower < joint.upper and np.isfinite(bounds).any()
        weak = joint.name not in driven and effort < np.inf
        put(
            tree.joints[joint.name], frictionloss=joint.friction or None,
            range=bounds if limited else None, limited="true" if limited else None,
            actuatorfrcrange=(-effort, effort) if weak else None,
            actuatorfrclimited="true" if weak else None,
            stiffness=spring.stiffness if spring else None, springref=spring.rest if spring else None,
        )  # fmt: skip
    actuator = add(root, "actuator") if d.motors else root
    for motor in d.motors:
        limit = (-limits[motor], limits[motor]) if limits[motor] < np.inf else None
        add(
            actuator, "motor", name=motor, joint=motor, ctrlrange=limit, ctrllimited="true" if limit else None
        )


def list_losses(d: Description, tree: Tree, losses: Losses) -> None:
    """List what MuJoCo cannot say of the joints of a robot as it is, without its effects."""
    springs = {spring.name for spring in d.springs if spring.stiffness}
    for old, joint in zip(d.joints, with_effects(d).joints, strict=True):
        freedoms, endless = FREEDOMS[joint.kind], joint.kind == "continuous"
        lost = {
            "dampers are read back as viscous friction, to which they are added": old.damping - joint.damping,
            "damping of free joints": joint.damping
            and joint.kind == "floating"
            and joint.name in tree.joints,
            "dry friction and rotors of joints with several freedoms": freedoms > 1
            and (old.friction or (joint.armature and joint.kind != "spherical")),
            "continuous joints, which MuJoCo does not have: read back as hinges": endless,
            "speed limits, which MuJoCo does not have": freedoms and np.isfinite(joint.speed_limit),
            "gear ratios: the rotor's inertia is written as that at the joint": freedoms
            and joint.gear_ratio != 1,
            "position limits without room between them, which MuJoCo refuses": freedoms == 1
            and not joint.lower < joint.upper,
            "levels of coulomb_friction are read back as dry friction, too": freedoms == 1
            and old.friction != joint.friction,
            "springs of continuous joints: MuJoCo counts whole turns": endless and joint.name in springs,
        }
        for reason, is_lost in lost.items():
            if is_lost:
                losses.add(reason, joint.name)
        if freedoms:
            add_limits(joint, losses, ("lower", "upper", "effort_limit"))


def add_visuals(root: ET.Element, request: Request, tree: Tree, losses: Losses) -> None:
    """Add the shapes of a robot.

    Args:
        root: The root element, which receives `<asset>`.
        losses: Receives the shapes that MuJoCo cannot read.
    """
    assets: dict[tuple[str, tuple[float, ...]], str] = {}
    for shape in request.shapes:
        body = tree.bodies.get(shape.link)
        if body is None:
            losses.add("visual shapes of massless links that have no body", shape.link)
        elif shape.kind != "mesh" and any(size <= 0 for size in shape.size):
            losses.add("visual shapes without extent", shape.link)
        elif shape.kind != "mesh" or _is_readable(shape, losses):
            first, *others = shape.size  # of a box all edges, else the radius and perhaps a length
            size = first / 2 if shape.kind == "box" else first, *(other / 2 for other in others)
            mesh = None
            if shape.path is not None:
                file = os.path.relpath(shape.path.resolve(), request.target.resolve().parent)
                mesh = assets.setdefault((file, shape.size), f"{shape.path.stem}_{len(assets)}")
            add(
                body, "geom", type=shape.kind, group="2", contype="0", conaffinity="0", mass="0", mesh=mesh,
                size=None if mesh else size, rgba=shape.colour, **pose(shape.placement),
            )  # fmt: skip
    asset = add(root, "asset") if assets else root
    for (file, scale), name in assets.items():
        factors = scale if any(factor != 1 for factor in scale) else None
        add(asset, "mesh", name=name, file=file, inertia="shell", scale=factors)


def _is_readable(shape: Shape, losses: Losses) -> bool:
    """Say whether MuJoCo reads a mesh, as far as its ending and the head of an STL file tell."""
    if shape.path is None:
        losses.add("meshes that were not found", shape.file)
        return False
    ending = shape.path.suffix.lower()
    readable = ending in MESHES and (ending != ".stl" or _is_binary(shape.path))
    if not readable:
        losses.add(
            f"meshes that MuJoCo does not read (it takes {', '.join(MESHES)}; STL in binary)", shape.file
        )
    return readable


def _is_binary(file: Path) -> bool:
    """Say whether an STL file is a binary one that MuJoCo reads."""
    with open(file, "rb") as content:
        head = content.read(84)
    faces = int.from_bytes(head[80:84], "little")
    return 0 < faces <= MOST_FACES and file.stat().st_size == 84 + 50 * faces
