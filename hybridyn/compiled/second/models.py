"""The models that have second derivatives, as data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

from numpy.typing import ArrayLike

from ...spatial import Array
from ...structure.robot import HybridRobot
from ...structure.samples import as_accelerations, as_efforts
from ..equations.request import Request
from ..program import Program
from ..programs.derivatives.coordinates import check_closing, check_coordinates
from .paths import A_NEAR, DELTA, MOTION, V_NEAR, along_closing, along_joints, along_motors

#: Names of inputs in programs over each coordinates, where they have another one.
OVER = {"joints": {"q": DELTA}, "motors": {"q": DELTA, "v": V_NEAR, "a": A_NEAR}}


class SecondModel(NamedTuple):
    """A model that has second derivatives.

    Attributes:
        name: Its name, as users write it.
        third: Its input beside positions and rates: "a" or "tau".
        read: Reads this input of a robot: an array of samples, and whether it is a single one.
        result: Its result in programs.
        check: Refuses robots and coordinates.
        write: Builds its program over "joints" and over "motors".
    """

    name: str
    third: str
    read: Callable[[HybridRobot, ArrayLike], tuple[Array, bool]]
    result: str
    check: Callable[[HybridRobot, str, str], None]
    write: Mapping[str, Callable[[Request], Program]]

    def inputs(self, coordinates: str) -> dict[str, str]:
        """Return the inputs over which it is differentiated, with their names in programs."""
        names = OVER[coordinates]
        return {x: names.get(x, x) for x in ("q", "v", self.third)}


def _over_both(model: str) -> dict[str, Callable[[Request], Program]]:
    """Return what writes a model over joints and over motors."""
    return {"joints": partial(along_joints, model=model), "motors": partial(along_motors, model=model)}


#: The models, by name.
MODELS = {
    model.name: model
    for model in (
        SecondModel("idm", "a", as_accelerations, "tau", check_coordinates, _over_both("idm")),
        SecondModel("ddm", "tau", as_efforts, "a", check_coordinates, _over_both("ddm")),
        SecondModel("close", "a", as_accelerations, MOTION, check_closing, {"motors": along_closing}),
    )
}
