"""`hybridyn.compile`: generate C for a robot's models, build it, and check it against the general path."""

from __future__ import annotations

from ..effects.choice import Choice, choose
from ..errors import ModelError
from ..linkage.threads import one_thread
from ..structure.robot import HybridRobot
from .code.scalars import Scalar
from .failures import as_compile_error
from .library.cache import Built
from .library.calls import Library, loaded
from .library.compilers import best_lanes, find_compiler
from .model import CompiledRobot
from .programs.sources import built_library
from .verifying import verify


@one_thread()
def compile(
    robot: HybridRobot, effects: Choice = None, *, threads: int = 1, dtype: str = "float64"
) -> CompiledRobot:
    """Generate C for a robot's models, build it, and check it against the general path.

    Libraries are kept in the user's cache folder, so that each model is built once.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.
        threads: Number of threads that share a batch.
        dtype: "float64", or "float32", which computes a batch twice as fast with seven digits.

    Returns:
        The compiled models. Call `idm` and `ddm` like the functions of the general path.

    Raises:
        CompileError: There is no C compiler; casadi is not installed; the built model differs from the
            general path or would hand every sample to it; or the models cannot be generated for another
            reason.
        ModelError: `dtype` or `threads` is invalid, an effect is not available in compiled models, or
            `robot.model` was changed.
    """
    if dtype not in ("float64", "float32"):
        raise ModelError(f"dtype must be 'float64' or 'float32', not {dtype!r}")
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    robot.check_model()
    on = choose(robot, effects)
    find_compiler()
    scalar = Scalar(dtype, best_lanes(dtype))

    def accept(built: Built) -> None:
        verify(Library(built), robot, on)

    with as_compile_error(robot):
        library = loaded(lambda: built_library(robot, on, scalar, accept))
        return CompiledRobot(robot, on, library, threads)
