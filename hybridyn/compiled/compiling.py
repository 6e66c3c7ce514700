"""Write a robot's models out as C, build them, and check them against the general path."""

from __future__ import annotations

from ..effects.choice import Choice, choose
from ..errors import ModelError
from ..linkage.threads import one_thread
from ..structure.robot import HybridRobot
from .code.scalars import Scalar
from .failures import failing_as_ours
from .library.cache import Built
from .library.calls import Library, loaded
from .library.compilers import best_lanes, find_compiler
from .model import CompiledRobot, built_library
from .verifying import verify


@one_thread()
def compile(
    robot: HybridRobot, effects: Choice = None, *, threads: int = 1, dtype: str = "float64"
) -> CompiledRobot:
    """Write a robot's models out as C, build them, and check them against the general path.

    What was built once is found again in the user's cache folder.

    Args:
        robot: The robot.
        effects: As `hybridyn.idm` takes them.
        threads: Threads that share a batch.
        dtype: "float64", or "float32" for twice the speed of a batch and seven digits.

    Returns:
        The models; call its `idm` and `ddm` as those of the general path.

    Raises:
        CompileError: There is no C compiler, casadi is not installed, or the built model differs from the
            general path or would leave everything to it, or something else went wrong.
        ModelError: An effect is not for written-out models.
    """
    if dtype not in ("float64", "float32"):
        raise ModelError(f"dtype must be 'float64' or 'float32', not {dtype!r}")
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    on = choose(robot, effects)
    find_compiler()
    scalar = Scalar(dtype, best_lanes(dtype))

    def accept(built: Built) -> None:
        verify(Library(built), robot, on)

    with failing_as_ours(robot):
        library = loaded(lambda: built_library(robot, on, scalar, accept))
        return CompiledRobot(robot, on, library, threads)
