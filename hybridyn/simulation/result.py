"""The result of a simulation, and the file from which a run is resumed."""

from __future__ import annotations

import hashlib
import os
import re
import struct
import sys
import tokenize
import zipfile
import zlib
from dataclasses import asdict, astuple, dataclass, fields, replace
from os import PathLike
from typing import Any

import numpy as np

from ..description.writing import appearing
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .events import Found
from .system import State

#: Layout of the file that `Result.save` writes.
FORMAT = 3


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
class Result:
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
    def robot(self) -> str:
        """Name of the robot."""
        return self.origin.robot

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
        data: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        data["format"] = np.array(FORMAT)
        data["texts"] = np.array([*astuple(self.origin), self.status, self.message])
        data["counters"] = np.array(list(asdict(self.counters).values()))
        data["state_t"], data["state_q"], data["state_v"], data["state_a"] = (
            np.asarray(x) for x in (self.state.t, self.state.q, self.state.v, self.state.a)
        )
        data["going_on"] = np.array([self.next_step, float(self.on_grid), self.start])
        data["event_names"] = np.array([e.name for e in self.events], dtype=str)
        data["event_t"] = np.array([e.t for e in self.events])
        data["event_q"] = np.array([e.q for e in self.events]).reshape(-1, self.q.shape[1])
        data["event_v"] = np.array([e.v for e in self.events]).reshape(-1, self.v.shape[1])
        with appearing(path) as draft, draft.open("wb") as file:
            np.savez(file, **data)

    @staticmethod
    def load(path: str | PathLike[str]) -> Result:
        """Read a result from the file that `save` wrote.

        Raises:
            TrajectoryError: The file is not a result, was truncated or damaged, or holds invalid numbers.
        """
        if os.path.exists(path) and not os.path.isfile(path):  # opening a pipe would block
            raise TrajectoryError("is not a regular file", file=str(path))
        try:
            with open(path, "rb") as opened, np.load(opened, allow_pickle=False) as file:
                data = {name: file[name] for name in file.files}
            if int(data.get("format", np.array(0))) != FORMAT:
                raise TrajectoryError("not a result of a simulation, or of another version", file=str(path))
            out = Result._from(data)
        except (ValueError, TypeError, OSError, EOFError, LookupError, SyntaxError, MemoryError, RuntimeError,
                tokenize.TokenError, struct.error, zipfile.BadZipFile, zlib.error) as error:  # fmt: skip
            raise TrajectoryError(
                f"not a result of a simulation, or cut short: {error}", file=str(path)
            ) from None
        numbers = (out.state.t, out.state.q, out.state.v, out.state.a, out.next_step, out.start)
        if not all(np.isfinite(x).all() for x in numbers) or out.next_step == 0:
            raise TrajectoryError("holds numbers from which no run can continue", file=str(path))
        return out

    @staticmethod
    def _from(data: dict[str, Array]) -> Result:
        """Build a result from the arrays that `save` wrote."""
        *origin, status, message = (str(x) for x in data["texts"])
        events = tuple(
            Found(str(name), float(t), q, v)
            for name, t, q, v in zip(*(data[f"event_{x}"] for x in ("names", "t", "q", "v")), strict=True)
        )
        state = State(float(data["state_t"]), data["state_q"], data["state_v"], data["state_a"])
        step, on_grid, start = (float(x) for x in data["going_on"])
        arrays: dict[str, Any] = {name: data[name] for name in _ARRAYS}
        return Result(
            origin=Origin(*origin), **arrays, events=events, status=status, message=message,
            counters=Counters(*(int(x) for x in data["counters"])), state=state, next_step=step,
            on_grid=int(on_grid), start=start,
        )  # fmt: skip


def digest(robot: HybridRobot) -> str:
    """Compute a digest of a robot's numbers: the content of its files (not their paths), base and gravity."""
    numbers = replace(robot.description, source=None, notes=()), robot.base, np.asarray(robot.gravity)
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        said = re.sub(r"line=\d+", "", repr(numbers))
    return hashlib.sha256(said.encode()).hexdigest()


_ARRAYS = [f.name for f in fields(Result) if f.type == "Array"]


def joined(first: Result, then: Result) -> Result:
    """Return the result of a run and its continuation as one."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(then, name)]) for name in _ARRAYS
    }
    spent = [
        a + b for a, b in zip(asdict(first.counters).values(), asdict(then.counters).values(), strict=True)
    ]
    return replace(then, **arrays, events=first.events + then.events, counters=Counters(*spent))
