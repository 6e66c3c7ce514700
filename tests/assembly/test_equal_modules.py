"""Equal modules are assembled together; one that needs more than plain steps, each by itself."""

from functools import partial

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot, TrajectoryError
from hybridyn.assembly import assemble
from hybridyn.assembly.task import Task
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.comparing import close_to, refused
from tests.posing import far_apart, of_joints, of_link
from tests.shipped import shipped, states_near_home

SAME = 1e-9  # the same posture and rates, through the conditioning of the modules

Poses = dict[str, tuple[Array, Array, Array]]


def stacked_poses() -> tuple[HybridRobot, tuple[Array, Array, Array], Poses]:
    """Return four stacked modules, states of theirs, and the pose of each platform on the one below."""
    robot = build_robot(shipped("lx4"))
    states = states_near_home(robot.description, "fixed", 8, 3)
    links = [robot.description.root, *(m.outputs[0] for m in robot.modules)]
    pairs = zip(links[1:], links[:-1], strict=True)
    return robot, states, {f"{link}@{below}": of_link(robot, *states, link, below) for link, below in pairs}


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows are followed together, call by call."""
    counts, follow = [], assemble.follow

    def counted(task: Task, guess: Array, **how: bool) -> Array:
        if how.get("keep_branch", True):  # wrists keep none
            counts.append(len(guess))
        return follow(task, guess, **how)

    monkeypatch.setattr(assemble, "follow", counted)
    return counts


def test_equal_modules_are_followed_together(followed: list[int]) -> None:
    """Each mechanism is followed once, with the samples of all its modules."""
    robot, (q, v, a), poses = stacked_poses()
    found = hybridyn.assemble(robot, platforms=poses)
    mechanisms = [m.mechanism for m in robot.modules]
    assert followed == [mechanisms.count(m) for m in dict.fromkeys(mechanisms)]
    assert max(followed) > 1
    assert far_apart(robot, found[0], q) < SAME
    close_to(found[1:], (v, a), SAME)


def test_the_module_out_of_reach_is_named_among_equal_ones() -> None:
    """A leg five metres too long beside legs that are not."""
    robot, states, _ = stacked_poses()
    motors = of_joints(robot, *states, robot.motors)
    motors[robot.modules[2].motors[0]][0][1] += 5.0
    asked, module = partial(hybridyn.assemble, robot, motors=motors), robot.modules[2].name
    refused(asked, AssemblyError, "do not close at sample 1", module=module, sample=1)


def test_a_long_step_of_one_module_leaves_the_others_alone() -> None:
    """One module moves by 0.15 m beside equal modules that stand still, which keep their posture."""
    robot, _, poses = stacked_poses()
    name = list(poses)[2]
    for pose, twist, accel in poses.values():
        pose[:], twist[:], accel[:] = pose[0], 0.0, 0.0
    alone = {**poses, name: tuple(x[:1] for x in poses[name])}
    still = hybridyn.assemble(robot, platforms={key: tuple(x[:1] for x in alone[key]) for key in alone})[0]
    poses[name][0][1:, 2] += 0.15
    moved = hybridyn.assemble(robot, platforms=poses)[0]
    others = [i for k, m in enumerate(robot.modules) if k != 2 for i in m.q_index]
    np.testing.assert_allclose(moved[:, others], np.repeat(still[:, others], 3, axis=0), atol=SAME)
    assert np.abs(moved[2] - still[0])[robot.modules[2].q_index].max() > 0.01


def test_long_trajectories_of_equal_modules_are_assembled_in_parts(
    followed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory grows with the samples that are assembled at once: they are bounded."""
    robot, states, _ = stacked_poses()
    motors = of_joints(robot, *states, robot.motors)
    whole = hybridyn.assemble(robot, motors=motors)
    monkeypatch.setattr(assemble, "MOST_TOGETHER", 2 * len(states[0]))
    followed.clear()
    parts = hybridyn.assemble(robot, motors=motors)
    assert max(followed) == 2
    close_to(parts, whole, SAME, 1.0)


def test_a_trajectory_without_samples_is_an_error() -> None:
    robot, states, _ = stacked_poses()
    motors = of_joints(robot, *(x[:0] for x in states), robot.motors)
    refused(lambda: hybridyn.assemble(robot, motors=motors), TrajectoryError, "no samples")
