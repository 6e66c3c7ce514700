"""Build a robot: turn the modules of the kinematic graph into modules with numbers and names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..description.records import Description
from ..errors import HybridynError, ModelError
from ..joints.kinds import JointKind
from ..linkage.joints import ROOT_JOINT
from ..spatial import LARGEST, Array, slices
from ..threads import one_thread
from .bodies import carrying, home_of
from .graph import find_modules, joints_to_keep
from .mechanism import Tolerances
from .module_builder import ModuleBuilder
from .robot import Base, HybridRobot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike

#: Acceleration of gravity if neither the caller nor the file defines one [m/s^2].
EARTH = (0.0, 0.0, -9.81)
#: A closure's frame this many times farther from its link than joints from each other has another unit.
FAR = 30.0


@one_thread()
def build_robot(
    description: Description,
    *,
    base: Base | None = None,
    gravity: tuple[float, float, float] | Array | None = None,
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Iterable[str] = (),
    like: HybridRobot | None = None,
) -> HybridRobot:
    """Build a robot from its description.

    Args:
        description: Description of the robot.
        base: "fixed", "moving" (prescribed motion) or "floating" (free); if None, that of the description.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2]; if None, that of the
            description.
        rank_tolerance: Relative singular value below which closure rows count as dependent; if None, it is
            determined from the singular values.
        closure_tolerance: Largest residual that counts as closed, relative to the length of the module.
        held: Joints that must not be cut as part of a wrist, so that they can have joint effects.
        like: A robot that may differ in lengths and masses only. Ranks are then checked near its postures
            instead of decided anew.

    Raises:
        ModelError: The description does not define a robot, or the rank of a module's closures is in doubt.
        AssemblyError: No posture closes the loops of a module.
    """
    description = carrying(description)
    base = description.base if base is None else base
    if base not in ("fixed", "moving", "floating"):
        raise ModelError(f"base must be 'fixed', 'moving' or 'floating', not {base!r}")
    gravity = np.asarray(description.gravity or EARTH if gravity is None else gravity, dtype=float)
    if gravity.shape != (3,) or not (np.abs(gravity) <= LARGEST).all():
        raise ModelError(f"gravity must be three finite numbers of at most {LARGEST:.0e}, not {gravity}")
    kept = joints_to_keep(description, held)
    bodies, graphs = find_modules(description, kept)
    joints = [j.joint.name for j in bodies.joints]
    kinds = [j.joint.kind for j in bodies.joints]
    if base != "fixed":
        joints, kinds = [ROOT_JOINT, *joints], [JointKind.FLOATING, *kinds]
    q_slices = tuple(slices(kind.nq for kind in kinds))
    v_slices = tuple(slices(kind.nv for kind in kinds))
    home = home_of(description, bodies, kinds, base)
    tolerances = Tolerances(rank_tolerance, closure_tolerance)
    alike = like.modules if like is not None else ()
    build = ModuleBuilder(bodies, description, joints, q_slices, v_slices, home, tolerances, alike)
    if base == "floating":
        build.add_base()
    for graph in graphs:
        try:
            build.add(graph)
        except HybridynError as error:
            error.advice += _far_frame(description)
            raise
    return HybridRobot(
        description=description,
        base=base,
        gravity=gravity,
        modules=tuple(build.modules),
        joints=tuple(joints),
        kinds=tuple(kinds),
        q_slices=q_slices,
        v_slices=v_slices,
        motors=tuple(description.motors),
        bodies=bodies,
        closure_tolerance=closure_tolerance,
        home=home,
        rank_tolerance=rank_tolerance,
        held=kept,
        rebuild=_with_parameters,
    )


def _far_frame(description: Description) -> str:
    """Return the question about the unit of a closure's frame that is far beyond all joints, or ""."""
    size = max((float(np.linalg.norm(joint.placement[:3, 3])) for joint in description.joints), default=0.0)
    asked = (
        f". The frame of '{closure.name}' on '{link}' is {far:g} m from its link, and no joint is more than "
        f"{size:.3g} m from the one before it: millimetres?"
        for closure in description.closures
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        if (far := float(np.linalg.norm(frame[:3, 3]))) > FAR * size > 0
    )
    return next(asked, "")


def _with_parameters(robot: HybridRobot, values: Mapping[str, ArrayLike]) -> HybridRobot:
    """Build a robot with other parameters, see `HybridRobot.with_parameters`."""
    return rebuilt(robot, described(robot.description, values), like=robot)


def described(description: Description, values: Mapping[str, ArrayLike]) -> Description:
    """Return a description with other parameters.

    Args:
        description: The description.
        values: Parameters by name, as in `HybridRobot.with_parameters`.

    Raises:
        ModelError: A parameter is unknown, or a value has a wrong size or is out of range.
    """
    from .parameters.chosen import Parameters  # which few robots are asked for, as the next
    from .parameters.slots import with_values
    from .parameters.xacro import XacroArguments

    arguments = [name for name in values if ":" not in name]
    if arguments:
        description = XacroArguments(description, arguments).expanded([values[name] for name in arguments])
    named = {name: value for name, value in values.items() if ":" in name}
    parameters = Parameters(description, list(named))
    slots = parameters.slot_values(parameters.vector(named)[None])[0]
    parameters.check(slots)
    return with_values(description, parameters.slots, slots.tolist())


def rebuilt(
    robot: HybridRobot,
    description: Description | None = None,
    *,
    base: Base | None = None,
    held: Iterable[str] | None = None,
    like: HybridRobot | None = None,
) -> HybridRobot:
    """Build a robot with the choices of another one, but for those that are given.

    Args:
        description: Its description; that of the robot where left out.
        base: As for `build_robot`, likewise.
        held: As for `build_robot`, likewise.
        like: As for `build_robot`.

    Raises:
        ModelError: The description is no robot, or the rank of a module's closures is in doubt.
        AssemblyError: No posture closes the loops of a module.
    """
    return build_robot(
        robot.description if description is None else description, base=base or robot.base,
        gravity=robot.gravity, rank_tolerance=robot.rank_tolerance, closure_tolerance=robot.closure_tolerance,
        held=robot.held if held is None else held, like=like,
    )  # fmt: skip
