"""The result of a simulation, and the file from which a run is resumed."""

from __future__ import annotations

import hashlib
import json
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from ..description.writing import appearing
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .events import Found
from .system import State

#: Layout of the file that `SimulationResult.save` writes.
FORMAT = 5


@dataclass
class Counters:
    """Counters of a run's work.

    Attributes:
        steps: Steps taken.
        rejected: Steps that were repeated with a shorter length.
        evaluations: States at which the direct model was evaluated (outputs not counted).
        iterations: Iterations of nonlinear solves.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    iterations: int = 0


@dataclass(frozen=True)
class Origin:
    """Robot, method and scene of a run.

    Attributes:
        robot: Name of the robot.
        method: The method.
        digest: Digest of the robot's numbers.
        scene: Digest of the scene, empty for a run without one.
    """

    robot: str
    method: str
    digest: str = ""
    scene: str = ""


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """A simulated motion. Equal runs give the same bits, since no wall-clock time is stored.

    Attributes:
        origin: Robot, method and scene of the run.
        t: Times, shape (T,), [s].
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv), [m/s, rad/s].
        a: Accelerations, shape (T, nv), [m/s^2, rad/s^2].
        tau: Motor efforts, shape (T, motors), [N or N m].
        kinetic: Kinetic energy, shape (T,), [J].
        potential: Potential energy under the effects that are on, shape (T,), [J].
        residual: Worst closure residual relative to the module's length, shape (T,).
        pivot: How far closures are from losing rank in every step, shape (steps,): their least relative
            singular value at its start, or, where it was taken in C, the least pivot met over its usual size.
        events: Events that occurred.
        status: "finished", "event", "unreachable", "unsolved", "singular" or "interrupted".
        message: Explanation of the status, empty for "finished".
        counters: Counters of the run's work.
        state: The state reached, from which `simulate(..., resume=result)` goes on.
        next_step: Length of the next step [s].
        on_grid: Number of fixed steps taken since `start`.
        start: Start of the grid of fixed steps [s].
    """

    origin: Origin
    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    kinetic: Array
    potential: Array
    residual: Array
    pivot: Array
    events: tuple[Found, ...]
    status: str
    message: str
    counters: Counters
    state: State
    next_step: float
    on_grid: int
    start: float

    @property
    def method(self) -> str:
        """The method."""
        return self.origin.method

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy together, shape (T,), [J]."""
        return self.kinetic + self.potential

    def save(self, path: str | PathLike[str]) -> None:
        """Write the result to a file of NumPy's npz format; the file appears complete or not at all.

        Raises:
            OSError: The file cannot be written (no space, no such folder); no partial file is left.
        """
        said = {
            "format": FORMAT, "origin": asdict(self.origin), "status": self.status, "message": self.message,
            "counters": asdict(self.counters), "next_step": self.next_step, "on_grid": self.on_grid,
            "start": self.start, "events": [event.name for event in self.events],
        }  # fmt: skip
        data: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS} | {"said": json.dumps(said)}
        for name in _STATE:
            data[f"state_{name}"] = getattr(self.state, name)
        for name in _STATE[:3]:
            data[f"event_{name}"] = [getattr(event, name) for event in self.events]
        with appearing(path) as draft, draft.open("wb") as file:
            np.savez(file, digest=_content(data), **data)

    @staticmethod
    def load(path: str | PathLike[str]) -> SimulationResult:
        """Read a result from the file that `save` wrote.

        Raises:
            TrajectoryError: The file is not a result, was truncated, damaged or edited, or holds invalid
                numbers.
        """
        if os.path.exists(path) and not os.path.isfile(path):  # opening a pipe would block
            raise TrajectoryError("is not a regular file", file=str(path))
        try:
            with open(path, "rb") as opened, np.load(opened, allow_pickle=False) as file:
                data = {name: file[name] for name in file.files}
            if str(data.pop("digest")) != _content(data):
                raise ValueError("its numbers have changed")
            out = SimulationResult._from(data)
        except (ValueError, TypeError, OSError, EOFError, LookupError, SyntaxError, MemoryError, RuntimeError,
                tokenize.TokenError, struct.error, zipfile.BadZipFile, zlib.error) as error:  # fmt: skip
            raise TrajectoryError(
                f"not a result of a simulation as it was written: {error}", file=str(path)
            ) from None
        numbers = (out.state.t, out.state.q, out.state.v, out.state.a, out.next_step, out.start)
        if not all(np.isfinite(x).all() for x in numbers) or out.next_step == 0:
            raise TrajectoryError("holds numbers from which no run can continue", file=str(path))
        return out

    @staticmethod
    def _from(data: dict[str, Array]) -> SimulationResult:
        """Build a result from the arrays that `save` wrote."""
        said = json.loads(str(data["said"]))
        if said.pop("format") != FORMAT:
            raise ValueError("of another version")
        t, *state = (data[f"state_{name}"] for name in _STATE)
        found = zip(said.pop("events"), *(data[f"event_{name}"] for name in _STATE[:3]), strict=True)
        arrays: dict[str, Any] = {name: data[name] for name in _ARRAYS} | said
        return SimulationResult(**arrays | {
            "origin": Origin(**said["origin"]), "counters": Counters(**said["counters"]),
            "state": State(float(t), *state),
            "events": tuple(Found(name, float(t), q, v) for name, t, q, v in found),
        })  # fmt: skip


def digest(robot: HybridRobot) -> str:
    """Compute a digest of a robot's numbers: the content of its files (not their paths), base and gravity."""
    out = hashlib.sha256()

    def add(x: object) -> None:
        """Add a value, and what it holds."""
        if is_dataclass(x):
            add({f.name: getattr(x, f.name) for f in fields(x) if f.name not in ("line", "source", "notes")})
        elif isinstance(x, Mapping):
            add(list(x.items()))
        elif isinstance(x, np.ndarray):
            out.update(f"{x.shape}{x.tolist()}".encode())
        elif isinstance(x, list | tuple):
            out.update(f"[{len(x)}".encode())
            for one in x:
                add(one)
        else:
            out.update(f"{x!r},".encode())

    add((robot.description, robot.base, np.asarray(robot.gravity)))
    return out.hexdigest()


def _content(data: Mapping[str, Any]) -> str:
    """Compute a digest of arrays, their types and their names."""
    out = hashlib.sha256()
    for name, x in ((name, np.asarray(data[name])) for name in sorted(data)):
        out.update(f"{name} {x.dtype} {x.shape} ".encode() + x.tobytes())
    return out.hexdigest()


_STATE = [f.name for f in fields(State)]
_ARRAYS = [f.name for f in fields(SimulationResult) if f.type == "Array"]


def joined(first: SimulationResult, then: SimulationResult) -> SimulationResult:
    """Return the result of a run and its continuation as one."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(then, name)]) for name in _ARRAYS
    }
    spent = [
        a + b for a, b in zip(asdict(first.counters).values(), asdict(then.counters).values(), strict=True)
    ]
    return replace(then, **arrays, events=first.events + then.events, counters=Counters(*spent))
