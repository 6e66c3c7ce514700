"""Written-out models run by CasADi, without a compiler, as a library of them."""

from typing import Any

from hybridyn.compiled.programs import whole_robot
from hybridyn.structure.robot import HybridRobot


class Interpreted(whole_robot.Interpreted):
    """Models of a robot that CasADi runs."""

    def __init__(
        self,
        robot: HybridRobot,
        models: tuple[str, ...] = ("idm", "ddm", "kinematics"),
        effects: Any = None,
        **asked: Any,
    ) -> None:
        super().__init__([*whole_robot.programs(robot, effects, models=models, **asked).values()])
