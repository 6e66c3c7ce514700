"""Findings about a robot: loops open at home, singular postures, missing mass."""

from __future__ import annotations

import numpy as np

from ..description.lost_loops import lost_loops
from ..description.names import listed
from ..description.records import Description
from ..description.weightless import has_mass, weightless
from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .free_motions import free_motions, own_inertia
from .task import residuals

#: A posture is singular if its smallest pivot, or the motors' smallest share in a motion, is below this.
SINGULAR_POSTURE = 1e-5


def home_residuals(robot: HybridRobot) -> list[float]:
    """Compute the largest closure residual of each module at home, relative to the module's length."""
    worst = {module.name: float(np.abs(x).max()) for module, x in residuals(robot, robot.home[None])}
    return [worst.get(module.name, 0.0) for module in robot.modules]


def findings(robot: HybridRobot) -> list[str]:
    """Return what looks wrong in a robot, one sentence per finding, the reader's notes first."""
    out = [*robot.notes, *of_files(robot.description)]
    known: dict[int, str] = {}
    for number, (module, open_by) in enumerate(zip(robot.modules, home_residuals(robot), strict=True)):
        m = module.mechanism
        if number not in robot.children and without_mass(module):
            out.append(f"module '{module.name}': none of its bodies has mass, and no other module is on it")
        if id(m) in known:
            out += [f"module '{module.name}': as module '{known[id(m)]}'"] if known[id(m)] else []
            continue
        found = [*_at_home(module, robot, open_by), *_of_structure(module)]
        known[id(m)] = module.name if found else ""
        out += [f"module '{module.name}': {text}" for text in found]
    return out


def of_files(description: Description) -> list[str]:
    """Return what the files seem to lack: loops, and the mass of moving bodies, one sentence per finding."""
    out = [f"{sign.message}; {sign.mend}" for sign in lost_loops(description)]
    light = [joint.child for joint in weightless(description)]
    if any(joint.kind != "fixed" for joint in description.joints) and not has_mass(description):
        out.append("no link has mass (<inertial>), so efforts of gravity and inertia are zero")
    elif light:
        one = len(light) == 1
        out.append(
            f"{'link' if one else 'links'} {listed(light)} {'moves and has' if one else 'move and have'} no "
            "mass: efforts leave out this weight; add <inertial>, or a fixed joint to a link that has one"
        )
    return out


def _at_home(module: Module, robot: HybridRobot, open_by: float) -> list[str]:
    """Check the home posture: open loops, closures or motors that lose a direction."""
    if open_by > robot.closure_tolerance:
        return [
            f"its loops are open at the home posture by {open_by:.2g} of its size; "
            "state a closed home posture ([home] in model.toml; 'hybridyn home --write' finds one)"
        ]
    lost = "" if architecturally_singular(module) else singular_at_home(module, robot)
    return [f"the home posture is singular: {lost}"] if lost else []


def singular_at_home(module: Module, robot: HybridRobot) -> str:
    """Describe what loses rank at the home posture, or return an empty text if nothing does."""
    m = module.mechanism
    motion = m.cut.motion(m.spanning.sweep(robot.home[None, module.q_index]))
    basis = m.basis(m.closures.matrix(motion))
    if m.closures.rows and basis.pivot[0] < SINGULAR_POSTURE:
        return f"its closures lose rank (smallest pivot {basis.pivot[0]:.1e})"
    share = motor_share(module, basis.Psi)
    if share is not None and share[0] < SINGULAR_POSTURE:
        return f"its motors lose a direction (their share in it: {share[0]:.1e})"
    return ""


def motor_share(module: Module, Psi: Array) -> Array | None:
    """Compute the motors' smallest share in a motion: least singular value of S_a Psi, Psi orthonormal.

    Translations are divided by the module's length, so that metres and radians are comparable.

    Args:
        Psi: Basis of its motions, shape (T, n, N).

    Returns:
        Shape (T,), in [0, 1], 0 where motors lose a direction; None if there are no motors or no motions.
    """
    if not module.motors or not module.mobility:
        return None
    orthonormal = np.linalg.qr(Psi / module.mechanism.reduction.col_scale[:, None])[0]
    return np.linalg.svd(orthonormal[:, module.motor_columns], compute_uv=False)[:, -1]


def without_mass(module: Module) -> bool:
    """Return whether no motion of a module moves a mass of its own."""
    m = module.mechanism
    return bool(m.mobility and own_inertia(m, m.basis(m.generic_K[:1]).Psi[0]).max() <= 0.0)


def architecturally_singular(module: Module) -> str:
    """Describe an architectural singularity, or return an empty text if there is none.

    At such a singularity, motors lose a direction in every posture. An example is six legs between similar
    hexagons: one motion of the platform never changes their lengths.
    """
    m = module.mechanism
    if not m.closures.rows or len(module.motors) != m.mobility:
        return ""
    share = motor_share(module, m.basis(m.generic_K).Psi)
    if share is None or not len(share) or share.max() >= SINGULAR_POSTURE:
        return ""
    return (
        "architecturally singular: its motors lose a direction in every posture (their share in it is at "
        f"most {share.max():.1e}), so no effort holds it there; change the geometry (base and platform may "
        "be similar hexagons), or choose other motors"
    )


def _of_structure(module: Module) -> list[str]:
    """Check properties of every posture: motions without inertia, motors that cannot move."""
    held = held_motors(module)
    singular = architecturally_singular(module)
    out = [f"motor '{held[0]}' cannot move: the closures lock it"] if held else [singular] if singular else []
    light = () if without_mass(module) else free_motions(module).massless
    return [
        *out,
        *(f"the motion of {name} has no inertia; its direct model needs one there" for name in light),
    ]


def held_motors(module: Module) -> list[str]:
    """Return the motors of a module that its closures hold still at every posture."""
    m = module.mechanism
    Psi = np.abs(m.basis(m.generic_K[:1]).Psi[0] / m.reduction.col_scale[:, None]).max(axis=1, initial=0.0)
    moving = zip(module.motors, Psi[module.motor_columns], strict=True)
    return [name for name, most in moving if not m.mobility or most < SINGULAR_POSTURE * Psi.max()]
