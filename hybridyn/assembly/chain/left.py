"""What requests leave to the rule for redundancy, to be told."""

import numpy as np

from ...spatial import Array
from ...structure.robot import HybridRobot
from ..redundancy import LeftToRule
from ..requests import Requests, in_root
from .coupling import chains_of, own_requests


def left_to_rule(robot: HybridRobot, requests: Requests, q: Array) -> list[LeftToRule]:
    """Return what requests leave to the rule, by chain, at a posture that meets the first sample, (nq,)."""
    first = in_root(robot, requests.part(0, 1), q)
    states, out = (q[None], *np.zeros((2, 1, robot.nv))), []
    for chain in chains_of(robot, first)[1]:
        from .solve import chain_task  # most poses couple no modules

        task = chain_task(robot, chain, own_requests(robot, first, chain), states)
        if task.redundant:
            names = tuple(part.module for part in task.parts)
            out.append(LeftToRule(task.left, names, requests.redundancy))
    return out
