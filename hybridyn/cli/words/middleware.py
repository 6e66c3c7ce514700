"""Words of the command that serves other programs while it runs: ros."""

from functools import partial

import click

from ..common.files import complete_robot, robot_file
from ..common.options import RobotCommand, split_names
from .shared import option, run_module

#: The word after which the words are those of ROS.
ROS_ARGS = "--ros-args"


class RosCommand(RobotCommand):
    """A command whose words from `--ros-args` on are those of ROS; the command receives `ros_args`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words of ROS, and parse the others."""
        at = args.index(ROS_ARGS) if ROS_ARGS in args else len(args)
        left = super().parse_args(ctx, args[:at])
        ctx.params["ros_args"] = tuple(args[at:])
        return left


ros = RosCommand(
    "ros",
    callback=partial(run_module, "ros"),
    short_help="Serve ROS 2: complete joint states, motor trajectories, efforts.",
    help="""Run a ROS 2 node for ROBOT (URDF, MJCF, SDF, USD), until Ctrl-C.

    From the motors' joint states on the topic 'motor_states', it publishes those of all joints on
    'joint_states', with all loops closed, for robot_state_publisher and RViz. It turns trajectories of output
    joints into those of motors, and back, and computes efforts. A message that is wrong is refused, and named
    in the log and in /diagnostics. docs/ros.md has topics and parameters.

    Without ROBOT, the node waits for the topic 'robot_description'. Words after --ros-args are those of ROS:
    '-p NAME:=VALUE', '--params-file FILE', '-r FROM:=TO'.
    """,
    robot=click.Argument(
        ["robot"], required=False, shell_complete=complete_robot,
        callback=lambda ctx, param, value: value and robot_file(ctx, param, value),
    ),
    params=[
        option(
            "--joints", metavar="A,B,...", callback=split_names,
            help="Output joints, such as pitch and roll of an ankle, to which trajectories of motors are "
            "turned.",
        ),
        option(
            "--rate", type=click.FloatRange(0), default=0.0, metavar="HZ",
            help="Highest rate of complete states.  [default: one for each message]",
        ),
    ],
)  # fmt: skip
