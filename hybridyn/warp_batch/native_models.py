"""What the functions compute: the robot's programs, and the C that walks, controls and steps with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

from ..compiled import Program, RobotPrograms, c_text
from ..description.names import did_you_mean
from ..dynamics.quantities.joint_map import motors_beside
from ..effects.choice import Effects
from ..errors import ModelError
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from .functions import Ends, Native, native, of_program, own_text, sizes_text
from .module_lanes import following, modules_text

#: Fields of numbers on which the closures depend.
GEOMETRY = ("placement", "frame_a", "frame_b", "offset")
#: Models that are one program.
PLAIN = ("idm", "ddm", "kinematics")
#: What each law of a step reads, one number a motor, and its kind in `laws.h`.
LAWS = {"constant": ("tau",), "table": ("tau", "tau_rate", "tau_bend")} | dict.fromkeys(
    ("pd", "torque"), ("position", "rate", "acceleration", "kp", "kd")
)
#: Length of Newton's last step in a time step, by the type of the numbers.
LAST_NEWTON_STEP = {"float64": "1e-12", "float32": "1e-5"}
LIFT_HEAD = "#define EXPORT static CUDA_CALLABLE\n#define LAST_STEP {}\n"
#: C of a program that a law does not call.
ABSENT = "static int {0}_single_at(const S *const *in, S *out) {{ return !in || !out || 1; }}\n"
#: Why a walk cannot be made.
CONTRADICTING = "its motors depend on each other: their positions contradict each other but by chance"


class NativeModels:
    """Native functions of a robot.

    Attributes:
        fixed: Whether no parameter changes the closures.
        makers: What writes each function, but for the maps of output joints, by name.
    """

    def __init__(self, robot: HybridRobot, effects: Effects, slots: Sequence[Slot], dtype: str) -> None:
        self.robot, self.dtype, self._slots = robot, dtype, tuple(slots)
        self._programs = RobotPrograms(robot, effects, self._slots, dtype)
        self._constant = RobotPrograms(robot, effects, dtype=dtype) if self._slots else self._programs
        self.fixed = all(slot.field not in GEOMETRY for slot in slots)
        self.makers: dict[str, Callable[[], Native]] = {name: partial(self._plain, name) for name in PLAIN}
        self.makers |= {"close": self._close, "idm_from_motors": self._control}
        self.makers |= {f"step_{law}": partial(self.step, law) for law in LAWS}

    def _plain(self, name: str) -> Native:
        return of_program(self._programs.model(name), self.dtype)

    def maps(self, joints: Sequence[str]) -> list[Native]:
        """Return the map between output joints and motors, "map_to_joints" and "map_to_motors".

        Raises:
            ModelError: Some numbers are parameters.
            HybridynError: As `RobotPrograms.maps` raises.
        """
        if self._slots:
            raise ModelError("the map of output joints has no parameters: make a batch without them")
        sides = motors_beside(self.robot, joints), tuple(joints)
        run = f"walk(given, given + {self.robot.nq}, result, 0)"
        return [
            native(program.name, (program.inputs, program.outputs), self._along(program, side), run,
                   self.dtype, self._programs.walk(program, side))
            for program, side in zip(self._programs.maps(joints), sides, strict=True)
        ]  # fmt: skip

    @cached_property
    def _modules(self) -> tuple[str, int]:
        """The C that closes modules from their motors, and how many there are.

        Raises:
            SingularityError: The motors depend on each other.
        """
        motors = self.robot.motors
        self._programs.check_independent(motors, "motors", CONTRADICTING)
        return modules_text(self._programs, motors)

    def _close(self, idm: Program | None = None) -> Native:
        """Return the motion of all joints from the motors', or with "idm" the efforts behind it.

        Raises:
            SingularityError: The motors depend on each other.
        """
        return following(self._programs, self.robot.motors, self._modules, idm)

    def _control(self) -> Native:
        """Return the efforts from the motors' motion; the inverse model need not compare the loops again."""
        return self._close(self._programs.model("idm", compared=False))

    def _along(self, close: Program, side: Sequence[str]) -> dict[str, Program]:
        """Return the programs of a walk: that which closes the loops, and that which compares them.

        Raises:
            SingularityError: The joints depend on each other.
        """
        self._programs.check_independent(side, "motors", CONTRADICTING)
        return {"close": close, "turning": self._programs.turning(side)}

    def step(self, law: str) -> Native:
        """Return closed time steps under a law, one of `LAWS`.

        Raises:
            ModelError: The robot has no such steps.
        """
        robot, motors, lift = self.robot, len(self.robot.motors), self._constant.lift
        if lift is None or not self.fixed:
            why = (
                "its parameters change the loops" if not self.fixed else "its loops close by more than pivots"
            )
            raise ModelError(f"robot '{robot.description.name}' has no closed steps in a batch: {why}")
        called = {"lift": lift, "ddm": self._programs.model("ddm")}
        if law == "torque":
            called["close"] = self._constant.model("close")
            called["idm"] = self._constant.model("idm", compared=False)
        given = [("q", robot.nq), ("v", robot.nv), ("clock", 2), *((name, motors) for name in LAWS[law])]
        given += self._programs.parameter_inputs
        outputs = [("q_next", robot.nq), ("v_next", robot.nv), ("a_next", robot.nv)]
        parts = [
            self._lift_text(),
            sizes_text(EFFORTS=motors),
            own_text("calls.h"),
            self._programs.joints(robot.motors),
        ]
        parts += [ABSENT.format(name) for name in ("close", "idm") if name not in called]
        parts += [c_text("laws.h"), c_text("steps.h"), sizes_text(KIND=law.upper())]
        text = "".join([*parts, own_text("step.h")])
        return native(f"step_{law}", (given, outputs), called, "stepped(given, result)", self.dtype, text)

    def regular(self) -> Native:
        """Return the guard of a posture by the pivots of its closures, as of a step; zero without steps."""
        ends: Ends = [("q", self.robot.nq), ("v", self.robot.nv)], []
        if self._constant.lift is None:
            more = "static S regular(const S *given) { return 0; }\n"
            return native("regular", ends, {}, "regular(given)", self.dtype, more)
        more = self._lift_text() + own_text("regular.h")
        return native("regular", ends, {"lift": self._constant.lift}, "regular(given)", self.dtype, more)

    def _lift_text(self) -> str:
        """Return the C that closes the loops of a time step."""
        sizes = {"NQ": self.robot.nq, "NV": self.robot.nv, "MODULES": len(self.robot.modules)}
        head = LIFT_HEAD.format(LAST_NEWTON_STEP[self.dtype]) + sizes_text(**sizes)
        return head + c_text("newton.h") + c_text("lift.h")


def read_by(law: str, reads: Mapping[str, Any]) -> dict[str, Any]:
    """Return all that a law of a step reads; zero where left out.

    Raises:
        ModelError: There is no such law, or it does not read what is given.
    """
    if law not in LAWS:
        raise ModelError(f"there is no law '{law}'{did_you_mean(law, LAWS)}: {', '.join(LAWS)}")
    for name in reads:
        if name not in LAWS[law]:
            raise ModelError(f"the law '{law}' reads {', '.join(LAWS[law])}, not '{name}'")
    return {name: reads.get(name, 0.0) for name in LAWS[law]}
