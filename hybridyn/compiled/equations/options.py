"""Options that a module's code depends on besides the module: effects, motors, and the modules on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from ...assembly.free_motions import MASSLESS_MOTION, own_inertia
from ...dynamics.actuation import load_share
from ...errors import ActuationError
from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .request import Request


@dataclass(frozen=True)
class ModuleOptions:
    """Options of both models.

    Attributes:
        base: The constant acceleration (less gravity) of a base at rest, else None.
        carries: Whether another module stands on each output.
        inertias: Ten numbers of each output, including those that regrouping moves to it.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias over the freedoms of the tree after the cuts, as a tuple.
    """

    base: tuple[float, ...] | None
    carries: tuple[bool, ...]
    inertias: tuple[tuple[float, ...], ...]
    velocity: bool
    rotor: tuple[float, ...]


@dataclass(frozen=True)
class DirectOptions(ModuleOptions):
    """Options of the direct model.

    Attributes:
        motors: Freedoms of the tree after the cuts on which an effort acts.
        massless: Whether some motion of the module has no inertia; the general path then computes it.
        thin: Numbers of the core's spins that are excepted: without inertia, they get no acceleration.
        usual: Largest inertia that each freedom moves with all other joints locked, for a module without
            loops that carries others; else empty.
    """

    motors: tuple[int, ...]
    massless: bool
    thin: tuple[int, ...]
    usual: tuple[float, ...]


@dataclass(frozen=True)
class InverseOptions(ModuleOptions):
    """Options of the inverse model.

    Attributes:
        motors: Freedoms of the tree after the cuts that are driven, in the order of the module's motors.
        moving: Indices of the motors that the closures let move.
        share: Share of the load of each moving motor if they are redundant, else empty.
        laws: Freedoms of the tree after the cuts with joint laws.
        thin: As in `DirectOptions`, where the forces are balanced.
    """

    motors: tuple[int, ...]
    moving: tuple[int, ...]
    share: tuple[float, ...]
    laws: tuple[int, ...]
    thin: tuple[int, ...] = ()


def direct_options(request: Request, k: int) -> DirectOptions:
    """Return the options of the direct model of module k."""
    marks = request.marks(request.robot.modules[k])
    return DirectOptions(
        **_of_both(request, k),
        motors=tuple(i for i, mark in enumerate(marks) if mark),
        massless=_massless(request, k),
        thin=_thin(request, k),
        usual=_usual(request, k),
    )


#: Inertia along a motion over that of all joints that is rounding of the motion itself, squared.
ROUNDED_MOTION = 1e-24
#: Inertia of a spin over its terms that is their rounding.
ROUNDED_INERTIA = 1e-14


def _massless(request: Request, k: int) -> bool:
    """Return whether a motion of module k has no inertia; modules on an output add inertia to its motions.

    Pivots at the level of rounding cannot show this, since their diagonal entries are at that level too.
    """
    m = request.robot.modules[k].mechanism
    if not m.closures.rows or not m.mobility or request.on.leg_inertia is None:
        return False
    motion, rotor = m.tree.sweep(m.postures[:1]), np.array(request.rotor(request.robot.modules[k]))
    Psi = m.basis(m.closures.matrix(motion)).Psi[0]
    motions = np.linalg.qr(Psi / m.reduction.col_scale[:, None])[0]
    thin = _spins(request, k)[:, list(_thin(request, k))] / m.reduction.col_scale[:, None]
    if thin.size:
        motions = np.linalg.svd(motions - thin @ (thin.T @ motions))[0][:, : m.mobility - thin.shape[1]]
    motions = motions * m.reduction.col_scale[:, None]
    inertia = own_inertia(m, motions) + motions.T @ (rotor[:, None] * motions)
    for o, body in enumerate(m.spec.outputs):
        if request.children(k, o):
            a_map = m.jacobian(motion, body)[0] @ motions
            inertia = inertia + max(float(np.trace(inertia)), 1.0) * a_map.T @ a_map
    values = np.linalg.eigvalsh(inertia)
    free = own_inertia(m, np.diag(m.reduction.col_scale)) + np.diag(rotor * m.reduction.col_scale**2)
    return bool(values[0] <= max(MASSLESS_MOTION * values[-1], ROUNDED_MOTION * float(np.trace(free))))


def _spins(request: Request, k: int) -> Array:
    """Return the spins of the core of module k as motions of its tree after the cuts, shape (n, spins)."""
    parts = request.plans[k].parts
    out = np.zeros((parts.mechanism.tree.nv, len(parts.spins)))
    for i, spin in enumerate(parts.spins):
        out[parts.tree_v[list(spin.cols)], i] = spin.axis
    return out


def _thin(request: Request, k: int) -> tuple[int, ...]:
    """Return the numbers of the spins of module k without inertia: what is left of it is rounding."""
    m, spins = request.plans[k].mechanism, _spins(request, k)
    if request.on.leg_inertia is None:
        return tuple(range(spins.shape[1]))
    M = m.legs.crba(m.postures[:1])[0, 6:, 6:] + np.diag(request.rotor(request.robot.modules[k]))
    terms = np.einsum("ik,ij,jk->k", np.abs(spins), np.abs(M), np.abs(spins))
    left = np.einsum("ik,ij,jk->k", spins, M, spins)
    return tuple(np.flatnonzero(left <= ROUNDED_INERTIA * terms).tolist())


def inverse_options(request: Request, k: int) -> InverseOptions:
    """Return the options of the inverse model of module k."""
    module = request.robot.modules[k]
    marks = request.marks(module)
    moving = module.moving_motors
    redundant = len(moving) > module.mobility
    share = _share(request.robot, module) if redundant else np.zeros(0)
    return InverseOptions(
        **_of_both(request, k),
        motors=tuple(int(c) for c in module.motor_columns),
        moving=tuple(moving.tolist()),
        share=tuple(share.tolist()),
        laws=tuple(i for i, mark in enumerate(marks) if "law" in mark),
    )


def balance_options(request: Request, k: int) -> InverseOptions:
    """Return the options of the forces left in module k: all efforts are laws, and no motor is solved for."""
    forced = tuple(i for i, mark in enumerate(request.marks(request.robot.modules[k])) if mark)
    return InverseOptions(
        **_of_both(request, k), motors=(), moving=(), share=(), laws=forced, thin=_thin(request, k)
    )


def _of_both(request: Request, k: int) -> dict[str, Any]:
    """Return the options of both models of module k, by name."""
    module = request.robot.modules[k]
    return {
        "base": request.root(module),
        "carries": tuple(bool(request.children(k, o)) for o in range(len(module.mechanism.spec.outputs))),
        "inertias": request.output_inertias(k),
        "velocity": request.on.velocity is not None,
        "rotor": request.rotor(module),
    }


def _usual(request: Request, k: int) -> tuple[float, ...]:
    """Return `DirectOptions.usual` of module k."""
    module = request.robot.modules[k]
    m = module.mechanism
    carries = any(request.children(k, o) for o in range(len(m.spec.outputs)))
    if len(m.closures.row_slices) or m.spec.wrists or not carries:
        return ()
    return tuple(_locked(request.robot)[module.v_index].tolist())


def _locked(robot: HybridRobot) -> Array:
    """Compute the largest inertia of each freedom, other joints locked, over some postures, shape (nv,)."""
    data, rng = robot.unchanged_model.createData(), np.random.default_rng(0)
    postures = [robot.home] + [
        pin.integrate(robot.unchanged_model, robot.home, rng.normal(size=robot.nv)) for _ in range(7)
    ]
    out: Array = np.max([np.diag(pin.crba(robot.unchanged_model, data, q)) for q in postures], axis=0)
    return out


def _share(robot: HybridRobot, module: Module) -> Array:
    """Return the share of the load of each motor that can move; empty if the robot does not define it."""
    try:
        return load_share(robot, module, None)
    except ActuationError:
        return np.zeros(0)
