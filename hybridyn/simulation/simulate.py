"""`simulate`: integrate a robot's motion in time, on the manifold of its assembled postures."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from ..dynamics.state_checks import REST, STATE_CLOSED, largest_rates, natural_sizes
from ..effects.choice import Choice
from ..errors import AssemblyError, SingularityError, TrajectoryError
from ..manifold.manifold import Manifold
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_positions, as_rates, one_of
from ..threads import one_thread
from .events import Event
from .motion_law import Effort, MotionLaw, Wrenches
from .result import Origin, SimulationResult, digest
from .run import Progress, Run
from .solver import Solver, SolverOptions, build_method, solver_of
from .stepping import Stepper
from .system import State, System

if TYPE_CHECKING:
    from ..compiled import CompiledRobot

#: Memory of one number of a row, in samples, result, table and text together [bytes].
NUMBER_BYTES = 48
#: Memory of a row besides its numbers, and of a step: list entries and headers of small arrays [bytes].
ROW_BYTES, STEP_BYTES = 400, 40
#: File in which Linux states the memory limit of a container.
CONTAINER = Path("/sys/fs/cgroup/memory.max")
#: Largest relative change of v0 by projection; away from lost rank the change is as small as v0's residual.
MOST_RATE_CHANGE = 1e-3


@one_thread()
def simulate(
    robot: HybridRobot,
    q0: Array | None,
    v0: Array | None,
    times: Sequence[float] | Array,
    *,
    effort: Effort | Array | None = None,
    effects: Choice = None,
    wrenches: Wrenches | Mapping[str, Array] | None = None,
    events: Sequence[Event] = (),
    output_times: Sequence[float] | Array | None = None,
    initial_velocity: str = "refuse",
    progress: Progress | None = None,
    checkpoint: str | PathLike[str] | None = None,
    resume: SimulationResult | str | PathLike[str] | None = None,
    compiled: CompiledRobot | None = None,
    scene: str = "",
    **options: Unpack[SolverOptions],
) -> SimulationResult:
    """Integrate a robot's motion.

    Args:
        robot: The robot.
        q0: Positions at the start, shape (nq,), assembled; not used with `resume`.
        v0: Rates at the start, shape (nv,), [m/s, rad/s]; not used with `resume`.
        times: Start and end [s], or all output times, in order; an end before the start runs backwards.
        effort: Efforts in the order of `robot.motors`, shape (motors,), [N or N m], or a function of (t, q,
            v) that returns them; zero by default.
        effects: As in `ddm`; tables over time are evaluated at the simulated time.
        wrenches: For each link a wrench ON it, shape (6,), [N, N m], in its frame, or a function of (t, q, v)
            that returns such a mapping.
        events: Events to detect; they are located on the dense output to rounding.
        output_times: Times of the samples; by default the ends of the steps (or `times`, if more than
            two).
        initial_velocity: "refuse" raises an error for a v0 that does not keep the loops closed; "project"
            projects it.
        progress: Called after every step with the time reached and the end.
        checkpoint: File for the result so far, written every 1,000 steps and at the end.
        resume: An earlier result, or its file, from which the run continues. With the same arguments the
            result is the same, bit for bit, as that of one run.
        compiled: `hybridyn.compile(robot, effects)`, which then computes the accelerations, and takes steps
            of "rk4" and "dopri5" in C. Accelerations agree to rounding. Steps in C use coordinates of
            independent joints instead of those of the tangent space, so results differ by the error of the
            method. If the compiled model is not valid at a state, the general path is used.
        scene: Digest of the scene (`hybridyn.scenes.stage.identity`). It is stored in the checkpoint, and a
            run that resumes it must have the same one.
        **options: Method, length of steps and tolerances: the fields of
            `hybridyn.simulation.solver.Solver`; adaptive steps of "dopri5" by default.

    Returns:
        The motion; `status` and `message` state how it ended. If loops cannot be closed any more, or at a
        keyboard interrupt, the run ends and the motion so far is returned.

    Raises:
        AssemblyError: q0 or v0 does not close the loops.
        SingularityError: At the start, a force acts on a motion without inertia, or closures lose rank and
            the rates are on none of the branches that meet there.
        ActuationError: A gear locks itself, or friction that grows with load may jam joints.
        TrajectoryError: Wrong arguments, more steps than fit in memory, or a run to resume that does not
            match.
        ModelError: Effects are unknown, lack parameters or contradict each other, or "inertia" is missing;
            `compiled` is of another robot or other effects; the method does not support this robot; no
            joint can stick where stiction is asked for; or the motion does not determine a load on which
            friction depends.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> run = hybridyn.simulate(robot, robot.home, [0.0] * robot.nv, [0.0, 0.1])
        >>> run.status
        'finished'
        >>> bool(abs(run.energy[-1] - run.energy[0]) < 1e-6)  # it falls without losses
        True
    """
    solver = solver_of(options)
    one_of("initial_velocity", initial_velocity, "refuse", "project")
    times, wanted = _sampled(robot, solver, times, output_times)
    law = MotionLaw(robot, effort, wrenches, effects, compiled, stiction=solver.stiction)
    if solver.stiction and times[-1] < times[0]:
        raise TrajectoryError("stiction: time must rise, since what joints at rest did before is not known")
    system = System(Manifold(robot), law)
    origin = Origin(robot.name, solver.method, digest(robot), scene)
    earlier = _earlier(resume, origin, times, len(law.signs))
    state = earlier.state if earlier else _start(system, q0, v0, float(times[0]), initial_velocity)
    sticking = None
    if law.sticking is not None:
        from .sticking import Sticking  # which most runs need not

        sticking = Sticking(system)
        state = sticking.resume(state) if earlier else sticking.begin(state)
    stepper = Stepper(system, build_method(solver.method, system), solver, float(times[-1]), state)
    if earlier is not None:
        stepper.resume(earlier.next_step, earlier.on_grid, earlier.start)
    run = Run(system, stepper, origin, tuple(events), wanted, state, earlier, sticking)
    return run.to(float(times[-1]), progress, checkpoint)


def _sampled(
    robot: HybridRobot, solver: Solver, times: Sequence[float] | Array,
    output_times: Sequence[float] | Array | None,
) -> tuple[Array, Array | None]:  # fmt: skip
    """Return the times of the run and of its samples, None for the ends of steps; check their number."""
    times = _times(times, "times")
    wanted = None if output_times is None else _times(output_times, "output_times")
    if wanted is None and len(times) > 2:
        wanted = times
    if solver.fixed is not None:
        steps = abs(float(times[-1] - times[0])) / solver.fixed
        check_run_size(robot, steps if wanted is None else len(wanted), steps, "take longer steps")
    return times, wanted


def _earlier(
    resume: SimulationResult | str | PathLike[str] | None, origin: Origin, times: Array, sticking: int
) -> SimulationResult | None:
    """Return the run to continue, from its file if that is given; so many joints can stick.

    Raises:
        TrajectoryError: It is of another robot, method or scene, or ended before this run's start.
    """
    file = str(resume) if isinstance(resume, str | PathLike) else None
    earlier = SimulationResult.load(resume) if isinstance(resume, str | PathLike) else resume
    if earlier is None:
        return None
    there = earlier.origin
    backwards = (earlier.state.t - times[0]) * (times[-1] - times[0]) < 0
    of_scene = "was not begun with this scene as it stands now" if origin.scene else "is of a scene"
    for wrong, message in (
        (
            (there.robot, there.method) != (origin.robot, origin.method),
            f"resume: that run was of '{there.robot}' by '{there.method}'",
        ),
        (
            there.digest != origin.digest,
            f"resume: that run was of a robot '{there.robot}' with other numbers",
        ),
        (there.scene != origin.scene, of_scene),
        (
            len(earlier.state.signs) != sticking,
            "resume: that run was of other joints that stick: give 'stiction' and dry friction as there",
        ),
        (backwards, f"resume: that run reached t = {earlier.state.t:g} s, before the start, {times[0]:g} s"),
    ):
        if wrong:
            raise TrajectoryError(message, file=file)
    return earlier


def _times(times: Sequence[float] | Array, name: str) -> Array:
    """Return times as an array, shape (T,), [s]."""
    out = np.asarray(times, dtype=float)
    least = 2 if name == "times" else 1
    if out.ndim != 1 or len(out) < least or not np.isfinite(out).all():
        raise TrajectoryError(f"{name} must be at least {least} finite numbers in order, not {times}")
    steps = np.diff(out)
    if len(steps) and not ((steps > 0).all() or (steps < 0).all()):
        raise TrajectoryError(f"{name} must all rise or all fall")
    return out


def _check_projected_rates(manifold: Manifold, given: Array, v: Array, rest: float) -> None:
    """Check that projection left the initial rates unchanged.

    If closures lose rank nearby, rates may close the loops to first order without being on any branch.

    Args:
        manifold: The closed postures.
        given: Initial rates, shape (nv,).
        v: Projected rates, shape (nv,).
        rest: Rates up to this are rounding [rad/s], as in a module that its loops lock.
    """
    change, size = (float(np.abs(x / manifold.unit).max(initial=0.0)) for x in (v - given, given))
    if change > max(MOST_RATE_CHANGE * size, rest):
        raise SingularityError(
            f"v0 differs by {change / size:.2g} of its size from rates that the loops allow: closures lose "
            "rank next to q0, and these rates are on none of the branches that meet there. Take them from "
            'hybridyn.assemble, or pass initial_velocity="project"',
            what="closures", condition=np.inf,
        )  # fmt: skip


def _start(system: System, q0: Array | None, v0: Array | None, t: float, initial_velocity: str) -> State:
    """Build the initial state, closed to rounding.

    Raises:
        AssemblyError: q0 or v0 leaves the loops of a module open; the message names the module.
        TrajectoryError: Wrong shapes.
    """
    manifold, law = system.manifold, system.law
    robot = manifold.robot
    if q0 is None or v0 is None:
        raise TrajectoryError("q0 and v0 are needed where nothing is resumed")
    q, v = as_positions(robot, q0, "q0")[0][0].copy(), as_rates(robot, v0, "v0")[0][0].copy()
    law.place_base(t, q, v)
    rounding = max((m.mechanism.rounding for m, _ in manifold.looped), default=0.0)
    residual, name = manifold.residual(q)
    if residual > STATE_CLOSED + rounding:
        raise AssemblyError(
            f"module '{name}': q0 does not close the loops: open by {residual:.2g} of the module's length "
            f"(limit {STATE_CLOSED + rounding:.0e}). Take it from hybridyn.assemble",
            module=name, residual=residual,
        )  # fmt: skip
    largest = largest_rates(robot, v[None], np.zeros((1, robot.nv)))
    rest = REST * float(natural_sizes(robot, largest, robot.bodies.size)[0][0])
    opening, name = manifold.opening(q, v, least=rest / STATE_CLOSED)
    if opening > STATE_CLOSED + rounding and initial_velocity == "refuse":
        raise AssemblyError(
            f"module '{name}': v0 does not keep the loops closed: they open at {opening:.2g} of the largest "
            f"rate (limit {STATE_CLOSED + rounding:.0e}). Take it from hybridyn.assemble, or pass "
            'initial_velocity="project"',
            module=name, residual=opening,
        )  # fmt: skip
    if manifold.looped:
        given = v
        q, v = manifold.project(q, v)
        if initial_velocity == "refuse":
            _check_projected_rates(manifold, given, v, rest)
    return State(t, q, v, law.acceleration(t, q, v))


def check_run_size(robot: HybridRobot, rows: float, steps: float, mend: str) -> None:
    """Check, before a run starts, that its rows and steps fit in memory.

    Args:
        rows: Number of output samples; may be infinite.
        steps: Number of fixed steps, 0 for adaptive methods; may be infinite.
        mend: Advice that ends the message.

    Raises:
        TrajectoryError: The run needs more memory than is available.
    """
    numbers = 1 + robot.nq + 2 * robot.nv + len(robot.motors) + 4
    needed = rows * (ROW_BYTES + numbers * NUMBER_BYTES) + steps * STEP_BYTES
    if not needed <= (there := memory()):
        counts = [f"{rows:.3g} rows"] * bool(rows) + [f"{steps:.3g} steps"] * bool(steps)
        raise TrajectoryError(
            f"{' and '.join(counts)} need {needed / 1e9:.2g} GB of memory, and there are {there / 1e9:.2g} "
            f"GB: {mend}"
        )


def memory() -> float:
    """Return the memory of this machine, or of its container where that is less [bytes]."""
    own = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    with contextlib.suppress(OSError, ValueError):  # no such file, or "max"
        own = min(own, float(CONTAINER.read_text()))
    return own
