"""Load a scene file (robot, controller, effects, start, events) and simulate it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..description.side_cars.toml_file import Keys
from ..effects import Effects, choose, with_effects
from ..loading import load
from ..simulation.events import Event
from ..simulation.motion_law import Effort
from ..simulation.result import SimulationResult
from ..simulation.run import Progress
from ..simulation.simulate import check_run_size, simulate
from ..spatial import Array
from ..structure.parameters.xacro import text_of
from ..structure.robot import HybridRobot
from . import controllers
from .added_controllers import added_law
from .controller_tables import EffortsTable, PdTable, PythonTable, ReferenceTable, TorqueTable
from .effects import check_covers, events, read_rows, units
from .prescribed import follow_motion
from .references import Reference, RestPosture, from_points, from_table
from .scene_file import SceneFile, read_scene
from .start import initial_state
from .toml_source import naming

if TYPE_CHECKING:
    from ..compiled import CompiledRobot


@dataclass(frozen=True, eq=False)
class SceneStage:
    """A loaded scene, its start assembled.

    Attributes:
        robot: The robot, with its payloads.
        effects: The effects that are computed.
        q0: Positions at the start, shape (nq,).
        v0: Rates at the start, shape (nv,).
        effort: The motor efforts: a function of (t, q, v), or constant efforts.
        motion: The prescribed motion of the motors, where nothing is integrated; else None.
        events: The events to detect.
        output_times: Times of the samples [s], or None for the ends of the steps.
    """

    source: SceneFile
    robot: HybridRobot
    effects: Effects
    q0: Array
    v0: Array
    effort: Effort | Array | None
    motion: Reference | None
    events: tuple[Event, ...]
    output_times: Array | None


def stage(
    path: str | PathLike[str] | SceneFile, *, effort: Effort | Array | None = None,
    allow_python: bool = False, robot: HybridRobot | None = None,
) -> SceneStage:  # fmt: skip
    """Load a scene and assemble its start.

    Args:
        effort: A controller that replaces the scene's.
        allow_python: Whether a Python controller named by the scene may run; it has all rights of this
            process.
        robot: A robot that replaces the scene's.

    Raises:
        HybridynError: The scene is wrong; the message names file, line and key.
    """
    source = path if isinstance(path, SceneFile) else read_scene(Path(path))
    if robot is None:
        with naming(source, ("robot", "file")):
            robot = _load(source)
    acting = units(source, robot) or "none"
    with naming(source, ("effects",)):
        robot = with_effects(robot, acting)
        on = choose(robot, acting)
    times = _output_times(source, robot)
    scene = source.scene
    home = initial_state(source, robot, None)
    if scene.motion is not None:
        motion = _reference(source, ("motion",), scene.motion, robot, home[0])
        return SceneStage(source, robot, on, *home, None, motion, events(source, robot), times)
    made, reference = (
        (effort, None) if effort is not None else _effort(source, robot, on, home[0], allow_python)
    )
    start = home if reference is None else initial_state(source, robot, reference)
    return SceneStage(source, robot, on, *start, made, None, events(source, robot), times)


def _load(source: SceneFile) -> HybridRobot:
    stated = source.scene.robot
    gravity = stated.gravity
    return load(
        source.robot, base=stated.base, motors=stated.motors,
        gravity=None if gravity is None else (gravity[0], gravity[1], gravity[2]),
        xacro_args={name: text_of(value) for name, value in stated.xacro.items()} or None,
        package_dirs=[source.beside(folder) for folder in stated.package_dirs], strict=stated.strict,
    )  # fmt: skip


def play(
    ready: SceneStage, *, progress: Progress | None = None, checkpoint: str | PathLike[str] | None = None,
    resume: SimulationResult | str | PathLike[str] | None = None, compiled: CompiledRobot | None = None,
) -> SimulationResult:  # fmt: skip
    """Simulate a scene to its end; the other arguments are those of `simulate`.

    Raises:
        HybridynError: The motion cannot start from the scene's start.
    """
    scene, source = ready.source.scene, ready.source
    if ready.motion is not None:
        if resume is not None:
            raise source.error(("motion",), "nothing is integrated, so there is nothing to resume")
        times = np.array([0.0, scene.duration]) if ready.output_times is None else ready.output_times
        with naming(source, ("motion",)):
            return follow_motion(ready.robot, ready.motion, times, ready.effects, ready.q0, compiled)
    with naming(source, ("solver",)):
        return simulate(
            ready.robot, ready.q0, ready.v0, (0.0, scene.duration), effort=ready.effort,
            effects=ready.effects, events=ready.events, **scene.solver.model_dump(),
            output_times=ready.output_times, progress=progress, checkpoint=checkpoint, resume=resume,
            compiled=compiled, scene=identity(source),
        )  # fmt: skip


def identity(source: SceneFile) -> str:
    """Compute a digest of a scene and of the files it names; duration and outputs are left out."""
    said = source.scene.model_dump(mode="json", exclude={"duration": True, "output": {"file", "columns"}})
    digest = hashlib.sha256(json.dumps(said, sort_keys=True).encode())
    for path in map(Path, files_of(source)[1:]):
        digest.update(path.read_bytes() if path.is_file() else b"")
    return digest.hexdigest()


def files_of(source: SceneFile) -> list[str]:
    """Return the paths of a scene and of the files that it reads."""
    said = source.scene.model_dump(mode="json", exclude={"output"})
    names = sorted(set(_files(said)))
    return [
        source.file,
        *(source.robot if name == source.scene.robot.file else source.beside(name) for name in names),
    ]


def _files(said: object) -> Iterator[str]:
    """Yield the names of the files in a scene's content."""
    if isinstance(said, dict):
        for key, value in said.items():
            if key in ("file", "table") and isinstance(value, str):
                yield value
            else:
                yield from _files(value)
    elif isinstance(said, list):
        for value in said:
            yield from _files(value)


def _output_times(source: SceneFile, robot: HybridRobot) -> Array | None:
    """Return the times of the samples, shape (T,), [s], or None for every step."""
    scene = source.scene
    steps = scene.duration / scene.solver.step if scene.solver.step and scene.motion is None else 0.0
    with naming(source, ("solver", "step")):
        check_run_size(robot, 0.0, steps, "take longer steps, or a shorter duration")
    if scene.output.rate is None:
        return None
    rows = np.floor(scene.duration * scene.output.rate * (1 + 1e-12))
    with naming(source, ("output", "rate")):
        check_run_size(robot, float(rows), steps, "lower the rate or the duration")
    count = int(rows)
    return np.minimum(np.arange(count + 1) / scene.output.rate, scene.duration)


def _reference(
    source: SceneFile, keys: Keys, table: ReferenceTable, robot: HybridRobot, start: Array
) -> Reference:
    """Build a reference motion, and check that it covers the scene."""
    if table.points is not None:
        for i, point in enumerate(table.points):
            for name in point.joints:
                source.check((*keys, "points", i, "joints", name), "motor", name, robot.motors)
        with naming(source, (*keys, "points")):
            points = [
                RestPosture(p.time, p.joints, {k: (pose,) for k, pose in p.platforms.items()})
                for p in table.points
            ]
            return from_points(robot, points, start, source.scene.redundancy)
    assert table.table is not None
    with naming(source, (*keys, "table")):
        out = from_table(robot, source.beside(table.table), source.scene.redundancy)
    check_covers(source, (*keys, "table"), out.time)
    return out


def _effort(
    source: SceneFile, robot: HybridRobot, on: Effects, start: Array, allow_python: bool
) -> tuple[Effort | Array | None, Reference | None]:
    """Build the scene's controller and the reference that it follows."""
    table = source.scene.controller
    with naming(source, ("controller",)):
        if isinstance(table, EffortsTable):
            if table.efforts is not None:
                return controllers.constant(robot, table.efforts), None
            columns = [f"{motor}/effort" for motor in robot.motors]
            rows = read_rows(source, ("controller", "table"), str(table.table), columns)
            return controllers.EffortTable(rows[:, 0], rows[:, 1:]), None
        if isinstance(table, PdTable):
            reference = _reference(source, ("controller", "reference"), table.reference, robot, start)
            return controllers.Pd(robot, reference, table.kp, table.kd), reference
        if isinstance(table, TorqueTable):
            reference = _reference(source, ("controller", "reference"), table.reference, robot, start)
            known = on if table.effects is None else choose(robot, table.effects)
            return controllers.ComputedTorque(robot, reference, table.kp, table.kd, known), reference
        if isinstance(table, PythonTable):
            return _python(source, robot, table, allow_python), None
        if table is not None:
            return added_law(robot, table), None
    return None, None


def _python(source: SceneFile, robot: HybridRobot, table: PythonTable, allow: bool) -> Effort:
    """Load a Python controller, if this is allowed and its file is beside the scene."""
    if Path(table.file).name != table.file or not table.file.endswith(".py"):
        raise source.error(("controller", "file"), "must be the name of a .py file beside the scene")
    if not allow:
        raise source.error(
            ("controller", "file"),
            f"the scene wants to run '{table.file}', a program with all your rights: read it, then pass "
            "allow_python=True",
        )
    return controllers.from_file(robot, source.beside(table.file), table.function)
