"""Links on which wrenches act in compiled models: those that the caller gives, and those of the ground.

A wrench on an output, such as a platform or a body in series, is part of what the output requires. One on a
link of a leg is efforts along the joints that carry the link, and a wrench on the module's base.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...description.names import did_you_mean
from ...effects.load_friction import OnLoads
from ...errors import ModelError
from ...spatial import Array, wrench_to_base
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ...symbols import dot
from .arguments import ModuleArguments
from .chains import sweep
from .expressions import pack, symbols, zeros
from .rigid import links_of


class Acting(NamedTuple):
    """Where a wrench on a link enters the equations.

    Attributes:
        link: The link.
        body: Number of its body in the robot.
        module: Number of the module that the body belongs to.
        own: Number of the body in the module's spanning tree.
        output: Number of the output that the body is, or None for a link of a leg.
        path: Freedoms of the module's tree after the cuts that carry a link of a leg, from the link inwards.
        R, p: Axes and origin of the link's frame in the body's, shapes (3, 3), (3,), [m].
    """

    link: str
    body: int
    module: int
    own: int
    output: int | None
    path: tuple[int, ...]
    R: Array
    p: Array


def acting_on(robot: HybridRobot, link: str) -> Acting:
    """Return where a wrench on a link enters.

    Raises:
        ModelError: The robot has no such link, it is part of a base that does not move freely, or it is a
            link of a wrist that was cut.
    """
    if link not in robot.bodies.place:
        raise ModelError(
            f"wrenches: no such link '{link}'{did_you_mean(link, robot.bodies.place)}", element=link
        )
    body, R, p = robot.bodies.place[link]
    k, own = robot.body_owner[body]
    if k < 0:
        raise ModelError(f"wrenches on '{link}': the base does not move by forces", element=link)
    m = robot.modules[k].mechanism
    spec = m.spec
    for o, output in enumerate(spec.outputs):
        if spec.tree_body[output] == own:
            return Acting(link, body, k, own, o, (), R, p)
    if own not in spec.tree_body:
        raise ModelError(
            f"wrenches on '{link}': compiled models take none on links of a wrist that was cut; use the "
            "general path",
            element=link,
        )
    path, at, joints = list[int](), spec.tree_body.index(own), m.tree.joints
    while at:
        path += reversed(range(m.tree.v_slices[at - 1].start, m.tree.v_slices[at - 1].stop))
        at = joints[at - 1].parent
    return Acting(link, body, k, own, None, tuple(path), R, p)


def refuse_beyond(robot: HybridRobot, law: OnLoads, links: Sequence[str]) -> None:
    """Raise if a wrench acts on a link of a leg beyond a joint with friction that grows with load.

    Raises:
        ModelError: The message names the link and the joint.
    """
    for at in (acting_on(robot, link) for link in links):
        module = robot.modules[at.module]
        tree, in_whole = module.mechanism.tree, module.mechanism.spec.in_whole
        for name in set(law.joints).intersection(module.joints):
            joint = in_whole[module.joints.index(name)]
            if joint < len(tree.joints) and tree.v_slices[joint].start in at.path:
                raise ModelError(
                    f"the effect '{law.effect.name}' cannot be compiled on joint '{name}' with a wrench on "
                    f"the link '{at.link}', which the joint carries in a leg. Use the general path for both, "
                    "or leave one out", element=law.effect.name,
                )  # fmt: skip


def along_path(module: Module, at: Acting, arguments: ModuleArguments | None) -> ca.Function:
    """Return the kernel of a wrench on a link of a leg.

    Inputs are positions of the module's spanning tree, the wrench in the frame of the link's body, and
    arguments if there are any; outputs the efforts along the freedoms of `path`, and the wrench on the base.
    """
    m = module.mechanism
    spec = m.spec if arguments is None else arguments.spec
    (q_col, q), (w_col, wrench) = symbols("q", m.spanning.nq), symbols("wrench", 6)
    chain = sweep(links_of(spec.spanning), q, zeros(m.spanning.nv), zeros(6))
    efforts, body = [], at.own
    while body:
        efforts += list(reversed(dot(chain.S[body - 1].T, wrench)))
        wrench = wrench_to_base(chain.R[body - 1], chain.p[body - 1], wrench)
        body = m.spanning.joints[body - 1].parent
    inputs = [q_col, w_col, *([] if arguments is None else [arguments.column])]
    return ca.Function("along", inputs, [pack(np.array(efforts, dtype=object)), pack(wrench)])
