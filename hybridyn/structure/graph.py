"""Split the kinematic graph into modules: loops that share a joint form one module, other joints are serial.

Each closure merges the joints on the tree path between its two links. This yields the biconnected
components, because the components of a matroid are those of its fundamental circuits. A coupling merges its
joints and all joints on the paths between them. Each class of joints is a module, and the modules form a
tree.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from ..description.groups import Groups
from ..description.names import did_you_mean
from ..description.records import Closure, Description
from ..errors import ModelError
from ..linkage.closures import TreeClosure
from ..linkage.couplings import TreeCoupling
from .bodies import Bodies, merge_fixed_joints


@dataclass(eq=False)
class ModuleGraph:
    """One module of the kinematic graph; bodies and joints are given by their numbers in `Bodies`.

    Attributes:
        base: Base body.
        joints: Joints of the spanning tree, in order.
        closures: Closures between bodies of the module (body numbers instead of tree numbers).
        couplings: Couplings (joint numbers of `Bodies`).
        carried: Bodies that carry another module.
        held: Joints that must not be cut: motors, and those that the caller holds.
    """

    base: int
    joints: list[int]
    closures: list[TreeClosure] = field(default_factory=list)
    couplings: list[TreeCoupling] = field(default_factory=list)
    carried: list[int] = field(default_factory=list)
    held: frozenset[int] = frozenset()


def find_modules(
    description: Description, held: frozenset[str] = frozenset()
) -> tuple[Bodies, list[ModuleGraph]]:
    """Split a robot into modules, each after the module that carries it; joints in `held` are never cut."""
    bodies = merge_fixed_joints(description)
    closures = [body_closure(bodies, c, description) for c in description.closures]
    number = {j.joint.name: i for i, j in enumerate(bodies.joints)}
    couplings = [
        TreeCoupling(
            c.name, tuple((number[name], k) for name, k in c.terms), c.offset, c.curve and c.curve.of(number)
        )
        for c in description.couplings
    ]
    kept = frozenset(number[name] for name in (*description.motors, *held))
    owner = _classes(bodies, closures, couplings)
    modules: dict[int, ModuleGraph] = {}
    for i in range(len(bodies.joints)):
        base = bodies.joints[owner[i]].parent
        modules.setdefault(owner[i], ModuleGraph(base, [], held=kept)).joints.append(i)
    for closure in closures:
        modules[owner[bodies.path(closure.body_a, closure.body_b)[0]]].closures.append(closure)
    for coupling in couplings:
        modules[owner[coupling.terms[0][0]]].couplings.append(coupling)
    for module in modules.values():
        if module.base:
            modules[owner[module.base - 1]].carried.append(module.base)
    return bodies, list(modules.values())


def body_closure(bodies: Bodies, closure: Closure, description: Description) -> TreeClosure:
    """Express a closure between two links as a closure between their bodies."""
    a, Ra, pa = bodies.place[closure.link_a]
    b, Rb, pb = bodies.place[closure.link_b]
    if a == b:
        raise ModelError(
            f"closure '{closure.name}' joins '{closure.link_a}' and '{closure.link_b}', which are one rigid "
            "body (fixed joints hold them together); remove the closure, or make one of the joints movable",
            file=description.source,
            line=closure.line,
            element=closure.name,
        )
    A, B = closure.frame_a, closure.frame_b
    return TreeClosure(
        closure.name, closure.kind,
        a, Ra @ A[:3, :3], pa + Ra @ A[:3, 3], b, Rb @ B[:3, :3], pb + Rb @ B[:3, 3],
        closure.translations, closure.rotation, closure.turn,
    )  # fmt: skip


def _classes(bodies: Bodies, closures: list[TreeClosure], couplings: list[TreeCoupling]) -> list[int]:
    """Return for each joint the first joint of its module, by union-find along the fundamental circuits."""
    circuits = [bodies.path(closure.body_a, closure.body_b) for closure in closures]
    for coupling in couplings:
        joints = [i for i, _ in coupling.terms]
        circuits += [[*joints, *bodies.path(joints[0] + 1, i + 1)] for i in joints]
    groups: Groups[int] = Groups()
    for circuit in circuits:
        groups.join_all(circuit)
    return [groups.of(i) for i in range(len(bodies.joints))]


def joints_to_keep(description: Description, held: Iterable[str]) -> frozenset[str]:
    """Return the joints that must not be cut: those in `held`, and those with an effect in the description.

    Raises:
        ModelError: A name in `held` is not a movable joint.
    """
    movable = [joint.name for joint in description.joints if joint.kind != "fixed"]
    for name in held:
        if name not in movable:
            raise ModelError(
                f"held: no such movable joint '{name}'{did_you_mean(name, movable)}", element=name
            )
    tables = (numbers for _, values in description.effects for numbers in values.values())
    stated = {joint.name for joint in description.joints if joint.rotor_inertia}
    stated.update(*(numbers for numbers in tables if isinstance(numbers, dict)))
    return frozenset(held) | (stated & set(movable)) - set(description.motors)
