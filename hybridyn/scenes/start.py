"""The start of a scene: positions and rates, assembled from what it states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..assembly.assemble import assemble_requests
from ..assembly.requests import first_guess, gather_requests
from ..spatial import Array
from ..structure.robot import HybridRobot, joint_position
from .references import Reference
from .scene_file import SceneFile
from .toml_source import naming

if TYPE_CHECKING:
    pass


#: Largest difference between given rates and those that closed loops allow, relative to the largest rate.
RATES = 1e-6


def initial_state(source: SceneFile, robot: HybridRobot, reference: Reference | None) -> tuple[Array, Array]:
    """Assemble positions and rates at the start, shapes (nq,), (nv,).

    Args:
        source: The scene.
        robot: The robot.
        reference: The motion that the controller follows, for `on_reference`; or None.

    Raises:
        HybridynError: The start cannot be assembled, or its rates would open loops.
    """
    initial = source.scene.initial
    for keys, names in ((("joints",), initial.joints), (("rates", "joints"), initial.rates.joints)):
        for name in names:
            source.check(("initial", *keys, name), "joint", name, robot.joints)
    platforms = {key: (pose, initial.rates.platforms.get(key)) for key, pose in initial.platforms.items()}
    for key in initial.rates.platforms:
        if key not in platforms:
            raise source.error(("initial", "rates", "platforms", key), "its pose is not given in [initial]")
    joints = {
        name: (position, initial.rates.joints.get(name, 0.0))
        for name, position in _positions(source, robot).items()
    }
    guess = None
    if initial.on_reference and reference is not None:
        x, x_dot, _ = reference.at(0.0)
        joints = {name: (x[i], x_dot[i]) for i, name in enumerate(robot.motors)}
        guess = reference.guess
    with naming(source, ("initial",)):
        if not joints and not platforms:
            return robot.home.copy(), np.zeros(robot.nv)
        requests = gather_requests(robot, joints, platforms, True, source.scene.redundancy)
        requests = requests._replace(strict=guess is not None)
        q, v, _ = assemble_requests(robot, requests, first_guess(robot, guess))
    if not initial.project:
        _check_rates(source, robot, v[0])
    return q[0], v[0]


def _positions(source: SceneFile, robot: HybridRobot) -> dict[str, float]:
    """Return the given joint positions; where no platform is placed, motors not named stay at home.

    The pose of a moving or floating base does not count as a platform, since it leaves the motors open.
    """
    initial = source.scene.initial
    joints = dict(initial.joints)
    placed = [key for key in initial.platforms if key.partition("@")[0] != robot.description.root]
    wanted = {*initial.rates.joints} if placed else {*initial.rates.joints, *robot.motors}
    for name in robot.joints:
        if name in wanted and name not in joints and robot.kinds[robot.joint_index[name]].single:
            joints[name] = float(joint_position(robot, robot.home, name))
    return joints


def _check_rates(source: SceneFile, robot: HybridRobot, v: Array) -> None:
    """Check that the given rates keep the loops closed, since the nearest rates that do were computed."""
    rates = source.scene.initial.rates.joints
    at = {name: robot.v_slices[robot.joint_index[name]].start for name in rates}
    found = {name: float(v[i]) for name, i in at.items()}
    largest = max((abs(rates[name]) / robot.unit[i] for name, i in at.items()), default=0.0)
    for name in sorted(rates, key=lambda name: name in robot.motors):  # passive joints first
        rate = rates[name]
        if abs(found[name] - rate) > RATES * largest * robot.unit[at[name]]:
            raise source.error(
                ("initial", "rates", "joints", name),
                f"the rates would open loops: {rate:g} for this joint, of which closed loops allow "
                f"{found[name]:.6g}. Leave passive joints out, or set project = true",
            )
