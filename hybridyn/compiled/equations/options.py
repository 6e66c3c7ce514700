"""What acts on a module, freedom by freedom: the choices that its kernels are written for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from ...assembly.free_motions import MASSLESS_MOTION, own_inertia
from ...dynamics.actuation import load_share
from ...errors import ActuationError
from ...spatial import Array
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .idle.inertia import idle_without_inertia
from .request import Request
from .rubbing_joints import Rubbing, rubbing_joints


@dataclass(frozen=True)
class Options:
    """Options of the code of one module's model; freedoms are those of the tree after the cuts.

    Attributes:
        base: The constant acceleration (less gravity) of a base at rest, else None.
        carries: Whether another module stands on each output, or a wrench acts on it.
        inertias: Ten numbers of each output, including those that regrouping moves to it.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias over the freedoms.
        motors: Freedoms on which an effort acts; of the inverse model those that are driven, in the order of
            the module's motors.
        moving: Indices of the motors that the closures let move.
        share: Share of the load of each moving motor if they are redundant, else empty.
        laws: Freedoms with joint laws, of the inverse model.
        measures: Whether the forces along motions without a motor, of this module or of one below it, are
            compared with the size of all their terms, also of those of the modules above.
        measured: Whether a module below it does.
        massless: Whether some motion of the module has no inertia; the general path then computes it.
        usual: Largest inertia that each freedom moves with all other joints locked, for the direct model of a
            module without loops that carries others; else empty.
        rubbing: Joints with friction that grows with load.
        loaded: Whether such friction acts somewhere in the robot, for the direct model.
    """

    base: tuple[float, ...] | None
    carries: tuple[bool, ...]
    inertias: tuple[tuple[float, ...], ...]
    velocity: bool
    rotor: tuple[float, ...]
    motors: tuple[int, ...] = ()
    moving: tuple[int, ...] = ()
    share: tuple[float, ...] = ()
    laws: tuple[int, ...] = ()
    measures: bool = False
    measured: bool = False
    massless: bool = False
    usual: tuple[float, ...] = ()
    rubbing: tuple[Rubbing, ...] = ()
    loaded: bool = False

    @property
    def isolated(self) -> bool:
        """Whether no other module feels the motion of this one, nor moves it."""
        return self.base is not None and not any(self.carries)


def direct_options(request: Request, k: int) -> Options:
    """Return the options of the direct model of module k."""
    return replace(
        _of_all(request, k),
        motors=_forced(request, k),
        massless=_massless(request, k),
        usual=_usual(request, k),
        loaded=request.on.loaded is not None,
    )


#: Inertia along a motion over that of all joints that is rounding of the motion itself, squared.
ROUNDED_MOTION = 1e-24


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
    thin = idle_without_inertia(request.plans[k], rotor) / m.reduction.col_scale[:, None]
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


def inverse_options(request: Request, k: int) -> Options:
    """Return the options of the inverse model of module k."""
    module = request.robot.modules[k]
    marks = request.marks(module)
    moving = module.moving_motors
    redundant = len(moving) > module.driven
    share = _share(request.robot, module) if redundant else np.zeros(0)
    return replace(
        _of_all(request, k),
        motors=tuple(int(c) for c in module.motor_columns),
        moving=tuple(moving.tolist()),
        share=tuple(share.tolist()),
        laws=tuple(i for i, mark in enumerate(marks) if "law" in mark),
        measures=request.undriven[k],
        measured=module.parent >= 0 and request.undriven[module.parent],
    )


def balance_options(request: Request, k: int) -> Options:
    """Return the options of the forces left in module k: all efforts are laws, and no motor is solved for."""
    return replace(_of_all(request, k), laws=_forced(request, k))


def _forced(request: Request, k: int) -> tuple[int, ...]:
    """Return the freedoms of module k on which a motor or a law acts."""
    return tuple(i for i, mark in enumerate(request.marks(request.robot.modules[k])) if mark)


def _of_all(request: Request, k: int) -> Options:
    """Return the options that the code of all models of module k depends on."""
    module = request.robot.modules[k]
    return Options(
        base=request.root(module),
        carries=request.carries(k),
        inertias=request.output_inertias(k),
        velocity=request.on.velocity is not None,
        rotor=request.rotor(module),
        rubbing=rubbing_joints(request.on.loaded, module, request.plans[k].parts, request.slots),
    )


def _usual(request: Request, k: int) -> tuple[float, ...]:
    """Return `Options.usual` of module k."""
    module = request.robot.modules[k]
    m = module.mechanism
    carries = any(request.children(k, o) for o in range(len(m.spec.outputs)))
    if len(m.closures.row_slices) or m.spec.wrists or not carries:
        return ()
    model, home, rng = request.robot.unchanged_model, request.robot.home, np.random.default_rng(0)
    data, nv = model.createData(), request.robot.nv
    postures = [home] + [pin.integrate(model, home, rng.normal(size=nv)) for _ in range(7)]
    locked = np.max([np.diag(pin.crba(model, data, q)) for q in postures], axis=0)
    return tuple(locked[module.v_index].tolist())


def _share(robot: HybridRobot, module: Module) -> Array:
    """Return the share of the load of each motor that can move; empty if the robot does not define it."""
    try:
        return load_share(robot, module, None)
    except ActuationError:
        return np.zeros(0)
