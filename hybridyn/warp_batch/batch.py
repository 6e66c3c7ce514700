"""`Batch`, the result of `hybridyn.warp`: the models of one robot for many samples on a device."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..compiled import DesignsInSlots, as_compile_error
from ..effects.choice import Effects
from ..errors import ModelError, TrajectoryError
from ..structure.parameters.chosen import Parameters
from ..structure.robot import HybridRobot
from .arrays import Arrays
from .derivatives import DerivativeKernels
from .drawing import Draw
from .fallback import Fallback, General
from .functions import Functions, InWarp, in_warp, wp
from .launching import Launcher
from .maps import BatchMap
from .native_models import NativeModels, read_by
from .taping import Taping


class Batch:
    """The models of one robot for many samples at once, one thread each.

    Threads that close loops share the modules of all samples.

    Arrays have the shape (N, n), or (n,) for the same numbers at each sample. Warp arrays, tensors of torch
    and JAX, and all that DLPack exchanges are read without a copy; NumPy's are copied to the device. Results
    have the kind of the first array. The last result of each call is the guard, shape (N,): samples whose
    guard is above 1 or NaN are NaN, and are counted in `failed`.

    On a tape of Warp `idm`, `ddm` and `close` have gradients over arrays of Warp that require one, in double
    precision and with smooth effects; other calls refuse such arrays. Those of samples in doubt are NaN.
    Those of `idm` and `ddm` hold along motions that keep loops closed, like `hybridyn.idm_jacobian`.

    Attributes:
        robot, effects: The robot, and effects in the models.
        parameters: Numbers that calls may change.
        dtype, device: Type of all numbers, and device of Warp.
        functions: The models as Warp functions, for kernels of your own.
    """

    def __init__(
        self, robot: HybridRobot, effects: Effects, parameters: Parameters, dtype: str, device: Any
    ) -> None:
        self.robot, self.effects, self.parameters = robot, effects, parameters
        self.dtype, self.device = dtype, device
        self._designs = DesignsInSlots(robot, effects, parameters)
        self._arrays = Arrays(device, dtype)
        self._models = NativeModels(robot, effects, parameters.slots, dtype)
        self._general = General(self._designs, dtype)
        self._made: dict[str, InWarp] = {}
        self._launcher = Launcher(robot, self._arrays)
        derivatives = DerivativeKernels(robot, effects, parameters.slots, self._launcher)
        self._taping = Taping(robot, effects, self._arrays, derivatives)
        self.functions = Functions(tuple(self._models.makers), self.made)

    @property
    def failed(self) -> dict[str, int]:
        """Number of samples so far whose guard was above 1, by call. Reading it waits for the device."""
        return self._launcher.failed

    def idm(
        self, q: Any, v: Any, a: Any, *, parameters: Any = None, fallback: bool = False
    ) -> tuple[Any, ...]:
        """Compute motor efforts, like `hybridyn.idm`.

        Args:
            q: Positions, shape (N, nq).
            v: Rates, shape (N, nv), [m/s, rad/s].
            a: Accelerations, shape (N, nv), [m/s^2, rad/s^2].
            parameters: Numbers in the order of `parameters.labels`, shape (k,) or (N, k), or what `numbers`
                made of them; None for those of the robot.
            fallback: Whether the general path computes samples whose guard is above 1.

        Returns:
            Efforts in the order of `robot.motors`, shape (N, motors), [N or N m], and guards, shape (N,).

        Raises:
            HybridynError: An array is wrong; or what `hybridyn.idm` raises, with `fallback`.
        """
        given = {"q": q, "v": v, "a": a} | self._numbers(parameters)
        return self._run("idm", given, partial(self._general.model, "idm") if fallback else None)

    def ddm(
        self, q: Any, v: Any, tau: Any, *, base_acceleration: Any = None, parameters: Any = None,
        fallback: bool = False,
    ) -> tuple[Any, ...]:  # fmt: skip
        """Compute accelerations, like `hybridyn.ddm`.

        Args:
            q, v: Positions and rates, as in `idm`.
            tau: Efforts in the order of `robot.motors`, shape (N, motors), [N or N m].
            base_acceleration: Spatial acceleration of a "moving" base in its own frame, shape (6,) or (N, 6);
                default zero.
            parameters, fallback: As in `idm`.

        Returns:
            Accelerations of the spanning tree, shape (N, nv), [m/s^2, rad/s^2], and guards, shape (N,).

        Raises:
            HybridynError: An array is wrong; or what `hybridyn.ddm` raises, with `fallback`.
        """
        given = {"q": q, "v": v, "tau": tau} | self._numbers(parameters)
        if self.robot.base == "moving" or base_acceleration is not None:
            given["base_acceleration"] = np.zeros(6) if base_acceleration is None else base_acceleration
        return self._run("ddm", given, partial(self._general.model, "ddm") if fallback else None)

    def kinematics(
        self, q: Any, v: Any, a: Any, *, parameters: Any = None, fallback: bool = False
    ) -> tuple[Any, ...]:
        """Compute the motion of every body in the world.

        Args:
            q, v, a: The motion, as in `idm`.
            parameters, fallback: As in `idm`.

        Returns:
            24 numbers for each body, shape (N, 24 bodies): axes row by row, origin, velocity, angular
            velocity, acceleration (classical), angular acceleration; and guards, shape (N,).

        Raises:
            HybridynError: An array is wrong.
        """
        given = {"q": q, "v": v, "a": a} | self._numbers(parameters)
        general = partial(self._general.model, "kinematics") if fallback else None
        return self._run("kinematics", given, general)

    def close(
        self, position: Any, rate: Any = None, acceleration: Any = None, *, near: Any = None,
        parameters: Any = None, fallback: bool = False,
    ) -> tuple[Any, ...]:  # fmt: skip
        """Compute the motion of all joints from the motors', like `CompiledRobot.close` for each sample.

        Args:
            position: Positions in the order of `robot.motors`, shape (N, motors), [m or rad].
            rate, acceleration: Theirs, of the same shape; zero by default.
            near: Closed postures, shape (N, nq) or (nq,), from which the motors move straight to `position`,
                on the same assembly branch; the home posture by default. A base keeps its pose, and
                joints that no motor moves keep their positions; rods that spin idly take the least rates.
            parameters, fallback: As in `idm`.

        Returns:
            q, v, a on the spanning tree, shapes (N, nq), (N, nv), (N, nv), and guards, shape (N,).

        Raises:
            HybridynError: An array is wrong; or what `hybridyn.assemble` raises, with `fallback`.
        """
        given = self._motion(position, rate, acceleration, near, parameters)
        return self._run("close", given, self._general.close if fallback else None)

    def idm_from_motors(
        self, position: Any, rate: Any = None, acceleration: Any = None, *, near: Any = None,
        parameters: Any = None, fallback: bool = False,
    ) -> tuple[Any, ...]:  # fmt: skip
        """Compute the efforts of the motors from what they do: `close`, then `idm`, in one call.

        Args:
            position, rate, acceleration, near: As in `close`.
            parameters, fallback: As in `idm`.

        Returns:
            Efforts, shape (N, motors), then q, v, a and guards as of `close`.

        Raises:
            HybridynError: As `close` and `idm` raise.
        """
        given = self._motion(position, rate, acceleration, near, parameters)
        q, v, a, tau, guard = self._run("idm_from_motors", given, self._general.control if fallback else None)
        return tau, q, v, a, guard

    def step(
        self, q: Any, v: Any, h: float, steps: int = 1, *, law: str = "constant", parameters: Any = None,
        fallback: bool = False, **reads: Any,
    ) -> tuple[Any, ...]:  # fmt: skip
        """Take time steps of Runge-Kutta's method of order four on the closed loops.

        The law computes the efforts at each stage. Times count from the start of the call.

        Args:
            q, v: Assembled positions, shape (N, nq), and rates, shape (N, nv), [m/s, rad/s].
            h: Length of a step [s].
            steps: Number of steps.
            law: "constant" reads `tau`; "table" `tau`, `tau_rate` and `tau_bend`, the efforts and their
                derivatives at the start; "pd" and "torque" (computed torque) `position`, `rate` and
                `acceleration` that the motors shall have at the start, from where the reference moves at
                that acceleration, and the gains `kp` and `kd`. Computed torque knows the robot's own numbers,
                not the samples' parameters.
            parameters: As in `idm`; none that change the loops.
            fallback: Whether the general path takes the steps of samples whose guard is above 1, in
                coordinates of its own: results agree to the error of the method.
            reads: What the law reads, a number, shape (motors,) or (N, motors); zero where left out.

        Returns:
            q, v and a after the steps, and guards, shape (N,): 0.05 over the smallest pivot of the closures
            relative to its usual size; infinite if a step could not be taken with certainty.

        Raises:
            HybridynError: An array or the law is wrong, or the robot has no such steps; or what
                `hybridyn.simulate` raises, and a SingularityError where it ends early, with `fallback`.
        """
        given = {"q": q, "v": v, "clock": np.array([h, steps])} | self._numbers(parameters)
        given |= read_by(law, reads)
        return self._run(f"step_{law}", given, partial(self._general.step, law) if fallback else None)

    def joint_map(self, joints: Sequence[str]) -> BatchMap:
        """Return the map between output joints and motors, as of a parallel ankle, see `hybridyn.joint_map`.

        Args:
            joints: Names of the output joints.

        Raises:
            HybridynError: The joints do not fit their modules, or the batch has parameters.
        """
        with as_compile_error(self.robot):
            made = {native.name: in_warp(native, self.dtype) for native in self._models.maps(joints)}
        return BatchMap(self.robot.home, made, self._launcher.run, partial(self._general.map, tuple(joints)))

    def random_states(self, count: int, seed: int = 0, *, tries: int = 64) -> tuple[Any, Any, Any, int]:
        """Draw closed states within the limits of the joints, on the device.

        The motors' positions are drawn within their limits, and the loops are closed along the way from
        home. Motors without limits turn by up to half a turn, or move by up to the length of their module.
        Rates are drawn up to the limits, or 1. A state outside a limit or out of reach is drawn again,
        and so is one whose pivots would give `step` a guard above 1/2.

        Args:
            count, seed: Number of states, and seed of the draws; the same seed gives the same states.
            tries: Most draws of a state; a state that is not found in as many is the home posture at rest.

        Returns:
            q, v, a, Warp arrays of shapes (N, nq), (N, nv), (N, nv), where motors have no acceleration, and
            the number of failed draws.

        Raises:
            HybridynError: The number of states is not positive, or the device is full.
        """
        if count < 1:
            raise TrajectoryError(f"random_states needs one state at least, not {count}")
        if self._drawn is None:
            raise ModelError("a batch with parameters draws no states: draw them by a batch without")
        return self._drawn.states(count, seed, tries)

    def numbers(self, parameters: Any) -> Any:
        """Return parameters as the kernels read them, an array of Warp: make it once for many calls.

        Args:
            parameters: Numbers in the order of `parameters.labels`, shape (k,) or (N, k).

        Raises:
            HybridynError: As `hybridyn.compile`'s models raise.
        """
        if hasattr(parameters, "__dlpack__"):
            parameters = np.asarray(parameters.cpu() if hasattr(parameters, "cpu") else parameters)
        slots = np.ascontiguousarray(self._designs.numbers(parameters, np.shape(parameters)[:-1]))
        return self._arrays.given("parameters", slots, slots.shape[-1])

    def made(self, name: str) -> InWarp:
        """Return a model in Warp."""
        if name not in self._made:
            with as_compile_error(self.robot):
                self._made[name] = in_warp(self._models.makers[name](), self.dtype)
        return self._made[name]

    @cached_property
    def _drawn(self) -> Draw | None:
        if self.parameters.size:
            return None
        with as_compile_error(self.robot):
            regular = in_warp(self._models.regular(), self.dtype)
        return Draw(self.robot, self.made("close"), regular, self._arrays)

    def _numbers(self, parameters: Any) -> dict[str, Any]:
        """Return the input "parameters" of the models, or nothing if they have none."""
        if not self.parameters.size and parameters is None:
            return {}
        given = self.parameters.nominal if parameters is None else parameters
        return {"parameters": given if isinstance(given, wp.array) else self.numbers(given)}

    def _motion(
        self, position: Any, rate: Any, acceleration: Any, near: Any, parameters: Any
    ) -> dict[str, Any]:
        """Return the inputs of "close"; the positions decide how many samples there are."""
        still = np.zeros(len(self.robot.motors))
        given = {"position": position, "near": self.robot.home if near is None else near}
        given |= {"rate": still if rate is None else rate}
        given |= {"acceleration": still if acceleration is None else acceleration}
        return given | self._numbers(parameters)

    def _run(self, name: str, given: dict[str, Any], fallback: Fallback | None = None) -> tuple[Any, ...]:
        """Run a model, which is compared with the general path before it is first used."""
        made = self.made(name)
        if name in ("idm", "ddm") and not self._launcher.has_run(name):
            self._general.check(made.native, partial(self._launcher.run, made))
            self._launcher.forget(name)  # its samples are not the user's
        return self._launcher.run(made, given, fallback, self._taping.of(name))
