"""Say why a new model hands its samples to the general path: the motion, the number, and what to do."""

from __future__ import annotations

import numpy as np

from ..dynamics.articulated_module import ArticulatedModule
from ..dynamics.direct_recursion import articulate
from ..dynamics.forward import forward
from ..dynamics.loads import all_loads
from ..effects.choice import Effects
from ..errors import HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .code.scalars import GUARD_LIMIT
from .comparing import SAMPLES, of_refused, random_states, refused_states


def reason(robot: HybridRobot, on: Effects) -> str:
    """Return why the direct model is trusted at no state: "", or words that begin with a space or a comma."""
    from .programs.general import general

    def direct(q: Array, v: Array, tau: Array, a: Array) -> Array:
        """Compute accelerations by the general path."""
        base = {"base_acceleration": a[:, :6]} if robot.base == "moving" else {}
        return general(robot, on, "ddm", {"q": q, "v": v, "tau": tau, **base})

    try:
        states = random_states(robot)
    except HybridynError:
        return ""
    return of_refused(refused_states(direct, states)) or _light(robot, on, states[0])


def _light(robot: HybridRobot, on: Effects, q: Array) -> str:
    """Name the motion with the least inertia, as a part of that with all other motions locked."""
    import pinocchio as pin

    from .equations.idle.inertia import mass_beside
    from .equations.least_inertia import NEARLY_NO_INERTIA  # a start from the cache needs no CasADi
    from .equations.options import direct_options
    from .equations.request import request

    still, model = np.zeros((len(q), robot.nv)), robot.unchanged_model
    loads = all_loads(robot, on.without("limits"), q, still, None, None)
    try:
        states = forward(robot, q, still, None, None, base=still)
        modules = articulate(robot, states, loads, np.zeros((SAMPLES, len(robot.motors))), None)
    except HybridynError:
        return ""
    data = model.createData()
    locked = np.array([np.diag(pin.crba(model, data, x)) for x in q]) + loads.rotors
    asked = request(robot, on.without("limits"))
    for k, x in enumerate(modules):
        if direct_options(asked, k).massless:
            name = x.state.module.name
            return (
                f" (module '{name}': the motion of {_without_inertia(x)} has no inertia, and no "
                "joint has this motion alone. Give the bodies that it moves an inertia about it, or write "
                "hinges that cross as one ball)"
            )
        own, names = asked.robot.modules[k], x.state.module.freedom_names()
        if beside := mass_beside(asked.plans[k], asked.rotor(own), names, GUARD_LIMIT):
            return f" (module '{own.name}': {beside})"
    ratio, module, freedom = min((_least(x, locked) for x in modules), default=(1.0, "", ""))
    if ratio > NEARLY_NO_INERTIA:
        return ""
    return (
        f" (module '{module}': with all other joints free, the motion of {freedom} has {ratio:.1g} of the "
        f"inertia that it has with these locked, limit {NEARLY_NO_INERTIA:g}: its acceleration loses digits. "
        "Give the bodies that it moves, or those that carry it, an ordinary inertia)"
    )


def _without_inertia(x: ArticulatedModule) -> str:
    """Name the motion of a module with the least inertia over its rounding."""
    t, n = np.unravel_index(np.argmin(x.inertia.values), x.inertia.values.shape)
    return _freedom(x, int(t), x.inertia.motions[t, :, n])


def _freedom(x: ArticulatedModule, t: int, u: Array) -> str:
    """Name the freedom that moves most in a motion u of a module at sample t, shape (N,)."""
    motion = x.basis.Psi[t] @ u / x.state.mechanism.reduction.col_scale
    return x.state.module.freedom_names()[int(np.argmax(np.abs(motion)))]


def _least(x: ArticulatedModule, locked: Array) -> tuple[float, str, str]:
    """Return the least inertia of a motion of a module over the locked one, the module, and the freedom.

    Args:
        x: The module's equation of motion.
        locked: Inertia of each freedom of the spanning tree with all others locked, shape (T, nv).
    """
    module, m = x.state.module, x.state.mechanism
    if not x.A_t.shape[1] or x.inertia.massless.any():
        return 1.0, "", ""
    size = np.diagonal(x.A_t, axis1=1, axis2=2)
    if not m.closures.rows and not m.spec.wrists:
        size = np.maximum(size, locked[:, module.v_index])
    unit = 1.0 / np.sqrt(size)
    values, vectors = np.linalg.eigh(x.A_t * unit[:, :, None] * unit[:, None])
    t = int(np.argsort(values[:, 0])[len(values) // 2])
    return float(values[t, 0]), module.name, _freedom(x, t, unit[t] * vectors[t, :, 0])
