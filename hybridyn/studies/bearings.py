"""Loads of bearings over a motion: what each joint transmits beside its freedoms, accumulated block by block.

The loads are those that wear a bearing and that its catalogue bounds: of a hinge or screw the force at right
angles to the axis (radial) and along it (axial), and the moment that tilts the axis; of a slide the force
normal to it, which counts as radial, and the moment; of a ball joint the force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..dynamics.reactions import Reactions, undetermined
from ..effects.load_friction import load_parts
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.over_time import Means, Peaks, places
from .sizing import Peak

#: Loads of a joint in the order of reports, and their units; what is normal to a slide is radial.
BEARING_UNITS = {"radial": "N", "axial": "N", "tilt": "N m"}


class BearingLoad(NamedTuple):
    """Loads of one joint.

    Attributes:
        joint: Name of the joint.
        kind: Its kind.
        peaks: Largest size by the load's name [N or N m]; None where redundant closures share it.
        rms: RMS size by the load's name [N or N m]; None likewise.
    """

    joint: str
    kind: str
    peaks: dict[str, Peak | None]
    rms: dict[str, float | None]

    @property
    def largest_force(self) -> float:
        """Largest peak of a force that is known [N]; 0 if there is none."""
        return max((peak.value for word, peak in self.peaks.items() if peak and word != "tilt"), default=0.0)


class Bearings:
    """Loads of a robot's joints over a motion, accumulated block by block in time order."""

    def __init__(self, robot: HybridRobot) -> None:
        """Start without samples."""
        self.robot, self.columns = robot, [(name, word) for name, word, _ in _columns(robot)]
        self.samples = 0
        self._peaks, self._means = Peaks(len(self.columns)), Means()
        self._shared = np.zeros(len(self.columns), bool)

    def add(self, time: Array | None, first_row: int, loads: Array) -> None:
        """Add consecutive samples.

        Args:
            time: Times, shape (T,), [s], or None.
            first_row: Number of the first sample, used if there is no time.
            loads: Rows of `bearing_rows`.
        """
        self._shared |= np.isnan(loads).any(axis=0)
        sizes = np.nan_to_num(loads)
        self._peaks.add(sizes, places(time, first_row, len(loads)))
        self._means.add(time, sizes**2)
        self.samples += len(loads)

    def loads(self) -> list[BearingLoad]:
        """Compute the loads of each joint from the samples so far, those with the largest forces first."""
        rms = np.sqrt(np.broadcast_to(self._means.mean, len(self.columns)))
        found: dict[str, BearingLoad] = {}
        for i, (name, word) in enumerate(self.columns):
            kind = self.robot.kinds[self.robot.joint_index[name]]
            load = found.setdefault(name, BearingLoad(name, str(kind), {}, {}))
            known = not self._shared[i]
            load.peaks[word] = Peak(float(self._peaks.value[i]), float(self._peaks.at[i])) if known else None
            load.rms[word] = float(rms[i]) if known else None
        return sorted(found.values(), key=lambda load: load.largest_force, reverse=True)


def bearing_rows(robot: HybridRobot, reactions: Reactions) -> Array:
    """Compute the sizes of the loads of all joints, (T, loads), [N, N m]; nan where closures share a load."""
    rows = [np.zeros((len(reactions.base), 0))]
    for name, _, part in _columns(robot):
        size = np.linalg.norm(reactions.joints[name] @ part.T, axis=1)
        shared = undetermined(part @ reactions.joints_shared[name]).any(axis=1)
        rows.append(np.where(shared, np.nan, size)[:, None])
    return np.hstack(rows)


def _columns(robot: HybridRobot) -> list[tuple[str, str, Array]]:
    """Return joint, name and part of the wrench of each load, module by module."""
    return [
        (name, "radial" if word == "normal" else word, part)
        for module in robot.modules
        for name in module.joints
        for word, part in load_parts(robot, name).items()
    ]
