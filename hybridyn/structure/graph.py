"""Split the kinematic graph into modules: loops that share a joint form one module, other joints are serial.

Each closure merges the joints on the tree path between its two links. This yields the biconnected
components, because the components of a matroid are those of its fundamental circuits. A coupling merges its
joints and all joints on the paths between them. Each class of joints is a module, and the modules form a
tree.

Inside a module, a *platform* is a body with at least three legs: if it and the base are removed, three or
more legs remain. A platform is cut free from the leg that carries it in the spanning tree. Massless wrists
at the ends of legs become point or universal closures (`wrists`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..description.groups import Groups
from ..description.records import Closure, Description
from ..errors import ModelError
from ..linkage.closures import TreeClosure, TreeCoupling
from .bodies import Bodies, merge_fixed_joints
from .wrists import Wrist, find_wrist, wrist_closure

#: Fewest legs of a platform.
PLATFORM_LEGS = 3


@dataclass
class ModuleGraph:
    """One module of the kinematic graph; bodies and joints are given by their numbers in `Bodies`.

    Attributes:
        base: Base body.
        joints: Joints of the spanning tree, in order.
        closures: Closures between bodies of the module (body numbers instead of tree numbers).
        couplings: Couplings (joint numbers of `Bodies`).
        carried: Bodies that carry another module.
        platforms: Platform bodies that are cut free.
        wrists: Chains of massless joints that are cut, with the data of the closures that replace them.
        cut_closures: Closures after the cut.
        legs: Groups of bodies that stay connected when the platforms and the base are removed.
    """

    base: int
    joints: list[int]
    closures: list[TreeClosure] = field(default_factory=list)
    couplings: list[TreeCoupling] = field(default_factory=list)
    carried: list[int] = field(default_factory=list)
    platforms: list[int] = field(default_factory=list)
    wrists: list[Wrist] = field(default_factory=list)
    cut_closures: list[TreeClosure] = field(default_factory=list)
    legs: list[list[int]] = field(default_factory=list)


def find_modules(
    description: Description, held: frozenset[str] = frozenset()
) -> tuple[Bodies, list[ModuleGraph]]:
    """Split a robot into modules, each after the module that carries it; joints in `held` are never cut."""
    bodies = merge_fixed_joints(description)
    closures = [body_closure(bodies, c, description) for c in description.closures]
    number = {j.joint.name: i for i, j in enumerate(bodies.joints)}
    couplings = [
        TreeCoupling(c.name, tuple((number[name], k) for name, k in c.terms), c.offset)
        for c in description.couplings
    ]
    owner = _classes(bodies, closures, couplings)
    modules: dict[int, ModuleGraph] = {}
    for i in range(len(bodies.joints)):
        modules.setdefault(owner[i], ModuleGraph(bodies.joints[owner[i]].parent, [])).joints.append(i)
    for closure in closures:
        modules[owner[bodies.path(closure.body_a, closure.body_b)[0]]].closures.append(closure)
    for coupling in couplings:
        modules[owner[coupling.terms[0][0]]].couplings.append(coupling)
    for module in modules.values():
        if module.base:
            modules[owner[module.base - 1]].carried.append(module.base)
    kept = {number[name] for name in (*description.motors, *held)}
    for module in modules.values():
        _cut(bodies, module, kept)
    return bodies, list(modules.values())


def undo_cuts(bodies: Bodies, module: ModuleGraph) -> None:
    """Undo the cuts of a module: restore its closures and joints as the author wrote them.

    A cut replaces joints by closure rows. If rows are redundant and the file is rounded, the rows hold only
    in the least-squares sense, whereas joints hold exactly. Modules of this kind are therefore not cut.
    """
    module.platforms, module.wrists = [], []
    module.cut_closures = list(module.closures)
    module.legs = _components(bodies, module, {module.base})


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
    groups: Groups[int] = Groups()

    def merge(joints: list[int]) -> None:
        """Join the groups of some joints; the first joint stands for them."""
        firsts = sorted({groups.of(i) for i in joints})
        for other in firsts[1:]:
            groups.join(firsts[0], other)

    for closure in closures:
        merge(bodies.path(closure.body_a, closure.body_b))
    for coupling in couplings:
        joints = [i for i, _ in coupling.terms]
        for i in joints:
            merge([*joints, *bodies.path(joints[0] + 1, i + 1)])
    return [groups.of(i) for i in range(len(bodies.joints))]


def _cut(bodies: Bodies, module: ModuleGraph, driven: set[int]) -> None:
    """Choose the platforms, cut them and the terminal wrists free, and group the other bodies into legs."""
    module.cut_closures = list(module.closures)
    if not module.closures:
        module.legs = _components(bodies, module, {module.base})
        return
    held = driven | {i for c in module.couplings for i, _ in c.terms}
    _cut_terminal_wrists(bodies, module, held)
    for body in sorted(i + 1 for i in module.joints):
        if not _is_platform(bodies, module, body):
            continue
        wrist = find_wrist(bodies, module.joints, module.cut_closures, module.carried, held, body)
        if wrist:
            module.platforms.append(body)
            module.wrists.append(wrist)
            module.cut_closures.append(wrist_closure(bodies, wrist))
    module.legs = _components(bodies, module, {module.base, *module.platforms})


def _cut_terminal_wrists(bodies: Bodies, module: ModuleGraph, held: set[int]) -> None:
    """Replace a weld to a massless body at the end of a wrist by one closure equivalent to the wrist."""
    for at, closure in enumerate(list(module.cut_closures)):
        if closure.rotation != "fixed" or closure.translations != (0, 1, 2):
            continue
        for end, other in ((closure.body_b, closure.body_a), (closure.body_a, closure.body_b)):
            rest = [c for c in module.cut_closures if c is not closure]
            if not _is_free_end(bodies, module, rest, end):
                continue
            wrist = find_wrist(bodies, module.joints, rest, module.carried, held, end)
            if wrist and other not in [j + 1 for j in wrist.joints]:
                R, p = _weld(closure, end)
                wrist = Wrist(wrist.joints, wrist.kind, wrist.parent, end, other, R, p, closure.name)
                module.wrists.append(wrist)
                module.cut_closures[at] = wrist_closure(bodies, wrist)
                break


def _weld(closure: TreeClosure, end: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the placement of body `end` in the body to which a closure welds it."""
    Ra, pa, Rb, pb = closure.R_a, closure.p_a, closure.R_b, closure.p_b
    if end == closure.body_a:
        Ra, pa, Rb, pb = Rb, pb, Ra, pa
    R = Ra @ Rb.T
    return R, pa - R @ pb


def _is_free_end(bodies: Bodies, module: ModuleGraph, closures: list[TreeClosure], body: int) -> bool:
    """Return True if a massless body is connected to others by its own joint and one closure only."""
    return (
        body != module.base
        and bodies.bodies[body].massless
        and body not in module.carried
        and not any(body in (c.body_a, c.body_b) for c in closures)
        and not any(bodies.joints[i].parent == body for i in module.joints)
    )


def _edges(bodies: Bodies, module: ModuleGraph) -> list[tuple[int, int]]:
    """List the edges of the module's graph after the cuts, as pairs of bodies."""
    gone = {i for w in module.wrists for i in w.joints}
    edges = [(bodies.joints[i].parent, bodies.joints[i].child) for i in module.joints if i not in gone]
    edges += [(c.body_a, c.body_b) for c in module.cut_closures]
    for coupling in module.couplings:
        first = coupling.terms[0][0] + 1
        edges += [(first, i + 1) for i, _ in coupling.terms[1:]]
    return edges


def _components(bodies: Bodies, module: ModuleGraph, without: set[int]) -> list[list[int]]:
    """Group the module's bodies into the connected components that remain without some bodies."""
    gone = {i + 1 for w in module.wrists for i in w.joints}
    left = {i + 1 for i in module.joints if i + 1 not in gone} - without
    groups: Groups[int] = Groups()
    for a, b in _edges(bodies, module):
        if a in left and b in left:
            low, high = sorted((groups.of(a), groups.of(b)))
            groups.join(low, high)
    out: dict[int, list[int]] = {}
    for body in sorted(left):
        out.setdefault(groups.of(body), []).append(body)
    return list(out.values())


def _is_platform(bodies: Bodies, module: ModuleGraph, body: int) -> bool:
    """Return whether at least `PLATFORM_LEGS` legs touch a body.

    Legs are the adjacent components that remain without the body and the base, and the direct joints
    between the two. There are at most as many as edges at the body, which decide for most bodies.
    """
    at_body = [edge for edge in _edges(bodies, module) if body in edge]
    if len(at_body) < PLATFORM_LEGS:
        return False
    near = {b if a == body else a for a, b in at_body}
    components = _components(bodies, module, {module.base, body, *module.platforms})
    direct = sum(1 for edge in at_body if {*edge} == {body, module.base})
    return sum(1 for c in components if near & set(c)) + direct >= PLATFORM_LEGS
