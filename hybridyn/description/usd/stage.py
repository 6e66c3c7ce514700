"""The composed prims of a USD file, and their values with units and checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import ModelError
from ..placement import rotation_from_quaternion
from ..records import Array
from ..urdf.xml_node import LARGEST_NUMBER

#: Numbers beyond this are no limit; USD's own parser uses it, since files state the largest float.
UNBOUNDED = 0.5e38


@dataclass(eq=False)
class Prim:
    """A prim.

    Attributes:
        stage: The stage that holds it.
        kind: Its type, "" for none.
        schemas: Names of its applied schemas; instances of one are named "PhysicsDriveAPI:angular".
        values: Authored values by name of the attribute.
        animated: Names of the attributes that have time samples or splines.
        targets: Paths that its relationships name.
        matrix: Its transform in its parent as USD writes it (rows are images of axes), shape (4, 4), or None.
        resets: Whether its transform is one in the world.
        parent: The prim above it, or None.
    """

    stage: Stage
    path: str
    kind: str
    schemas: tuple[str, ...]
    values: dict[str, Any]
    animated: frozenset[str]
    targets: dict[str, list[str]]
    matrix: Array | None
    resets: bool
    parent: Prim | None

    @property
    def name(self) -> str:
        """The last part of its path."""
        return self.path.rpartition("/")[2]

    def has(self, schema: str) -> bool:
        """Return whether a schema is applied."""
        return schema in self.schemas

    def instances(self, schema: str) -> list[str]:
        """Return the names of the instances of a schema that are applied ("angular")."""
        return [name.partition(":")[2] for name in self.schemas if name.startswith(schema + ":")]

    def error(self, message: str) -> ModelError:
        """Return (not raise) the error that names this prim."""
        return ModelError(f"<{self.path}>: {message}", file=self.stage.file, element=self.path)

    def states(self, name: str) -> bool:
        """Return whether an attribute has an authored value.

        Raises:
            ModelError: It is animated.
        """
        if name in self.animated:
            raise self.error(f"'{name}' is animated (time samples); give it one default value")
        return self.values.get(name) is not None

    def number(self, name: str, default: float) -> float:
        """Return a finite number; a default may be infinite."""
        value = self.any_number(name, default)
        if value != default and not np.isfinite(value):
            raise self.error(f"'{name}' is not a finite number")
        return value

    def any_number(self, name: str, default: float) -> float:
        """Return a number, infinite where its size is beyond `UNBOUNDED`."""
        if not self.states(name):
            return default
        value = self._value(name, (int, float), "a number")
        if np.isnan(value):
            raise self.error(f"'{name}' is not a number (nan)")
        return float(np.copysign(np.inf, value)) if abs(value) > UNBOUNDED else float(value)

    def vector(self, name: str, default: Sequence[float], finite: bool = True) -> Array:
        """Return a vector, shape (len(default),)."""
        if not self.states(name):
            return np.array(default, dtype=float)
        value = self.values[name]
        if not isinstance(value, list) or len(value) != len(default) or not _are_numbers(value):
            raise self.error(f"'{name}' is not a vector of {len(default)} numbers")
        out = np.array([float(x) for x in value])
        if finite and not (np.abs(out) <= LARGEST_NUMBER).all():
            raise self.error(f"'{name}' is not finite, or too large")
        return out

    def rotation(self, name: str) -> Array:
        """Return the rotation matrix of a quaternion w, x, y, z, shape (3, 3); identity without one."""
        stated = self.vector(name, (1.0, 0.0, 0.0, 0.0))
        length = float(np.linalg.norm(stated))
        if not length:
            raise self.error(f"'{name}' is the zero quaternion, which is no rotation")
        w, x, y, z = (float(part) for part in stated / length)
        return rotation_from_quaternion(x, y, z, w)

    def flag(self, name: str, default: bool) -> bool:
        """Return a truth value."""
        return bool(self._value(name, (bool, int), "true or false")) if self.states(name) else default

    def word(self, name: str, default: str) -> str:
        """Return a text."""
        return str(self._value(name, (str,), "a word")) if self.states(name) else default

    def _value(self, name: str, kinds: tuple[type, ...], what: str) -> Any:
        """Return the value of an attribute, which has to be of some kind."""
        value = self.values[name]
        if not isinstance(value, kinds) or (bool not in kinds and isinstance(value, bool)):
            raise self.error(f"'{name}' is not {what}")
        return value


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(x, int | float) and not isinstance(x, bool) for x in values)


@dataclass(eq=False)
class Stage:
    """A USD file.

    Attributes:
        file: Its path, for messages.
        prims: Its prims by path, each after its parent.
        meters: Length unit [m].
        kilograms: Mass unit [kg].
        up: The axis that points up, "X", "Y" or "Z".
        authored: Names of the units and axes that the file states.
        default: The default prim, or None.
    """

    file: str
    prims: dict[str, Prim] = field(default_factory=dict)
    meters: float = 0.01
    kilograms: float = 1.0
    up: str = "Y"
    authored: tuple[str, ...] = ()
    default: Prim | None = None

    def __init__(self, file: str, dump: dict[str, Any]) -> None:
        self.file, self.prims = file, {}
        self.meters, self.kilograms = float(dump["meters"]), float(dump["kilograms"])
        self.up, self.authored = str(dump["up"]), tuple(dump["authored"])
        for unit in (self.meters, self.kilograms):
            if not (0 < unit < LARGEST_NUMBER):
                raise ModelError("metersPerUnit and kilogramsPerUnit must be positive numbers", file=file)
        for one in dump["prims"]:
            path = str(one["path"])
            matrix = np.array(one["matrix"], dtype=float) if "matrix" in one else None
            self.prims[path] = Prim(
                self, path, str(one["type"]), tuple(one["schemas"]), one.get("values", {}),
                frozenset(one.get("animated", ())), one.get("targets", {}), matrix,
                bool(one.get("resets")), self.prims.get(path.rpartition("/")[0]),
            )  # fmt: skip
        self.default = self.prims.get(dump["default"])
