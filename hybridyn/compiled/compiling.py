"""`hybridyn.compile`: generate C for a robot's models, build it, and check it against the general path."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects.choice import Choice, choose
from ..errors import ModelError
from ..linkage.threads import one_thread
from ..structure.parameters.entries import Parameters
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from .code.scalars import Scalar
from .equations.arguments.coefficients import at_robot, check_coefficients, with_stated_springs
from .failures import as_compile_error
from .library.cache import Built
from .library.calls import Library, loaded
from .library.compilers import best_lanes, find_compiler
from .model import CompiledRobot
from .programs.designs import AtDesign, designs_to_verify
from .programs.sources import library_of
from .verifying import verify


@one_thread()
def compile(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    parameters: Sequence[str | Slot] = (),
    threads: int = 1,
    dtype: str = "float64",
    quick: bool = False,
) -> CompiledRobot:
    """Generate C for a robot's models, build it, and check it against the general path.

    Libraries are kept in the user's cache folder, so that each model is built once.

    Args:
        robot: The robot.
        effects: Effects to include, as for `hybridyn.idm`.
        parameters: Numbers of the robot that calls may change, such as "mass:LINK", "position:JOINT",
            "spring_stiffness:JOINT" or "payload_mass:LINK" (`structure.parameters.entries.entry_of` lists
            them), or slots; all others are constants of the code.
        threads: Number of threads that share a batch.
        dtype: "float64", or "float32", which computes a batch twice as fast with seven digits.
        quick: Whether to return after a quick build of the library (-O1), which gives the same bits in about
            a third more time. A thread then builds the optimised one, and the model uses it when it is there.
            A program that ends first ends its compiler, and the next one begins again.

    Returns:
        The compiled models. Call `idm` and `ddm` like the functions of the general path.

    Raises:
        CompileError: There is no C compiler; casadi is not installed; the built model differs from the
            general path or would hand every sample to it; or the models cannot be generated for another
            reason.
        ModelError: A parameter is unknown, `dtype` or `threads` is invalid, an effect is not available in
            compiled models, or `robot.model` was changed.
    """
    if dtype not in ("float64", "float32"):
        raise ModelError(f"dtype must be 'float64' or 'float32', not {dtype!r}")
    if threads < 1:
        raise ModelError(f"threads must be at least 1, not {threads}")
    robot.check_model()
    on = choose(robot, effects)
    find_compiler()
    scalar = Scalar(dtype, best_lanes(dtype))

    robot = with_stated_springs(robot, on) if parameters else robot
    chosen = Parameters(robot.description, parameters)
    check_coefficients(robot, on, chosen.slots)

    def accept(built: Built) -> None:
        """Compare a new library with the general path at each design to verify."""
        library = Library(built)
        for design, like, required in designs_to_verify(robot, chosen):
            verify(
                AtDesign(library, design) if parameters else library,
                like,
                at_robot(on, like) if parameters else on,
                required=required,
            )

    with as_compile_error(robot):
        find = library_of(robot, on, scalar, chosen.slots)
        library = loaded(lambda: find(accept=accept, quick=quick))
        compiled = CompiledRobot(robot, on, library, threads, chosen)
    if compiled.quick:
        compiled.optimise(find)
    return compiled
