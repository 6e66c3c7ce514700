"""Steps of motors end where a fine motion ends; equal modules are followed together, or each by itself."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot, TrajectoryError
from hybridyn.assembly import assemble, walk
from hybridyn.assembly.task import Task
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.posing import far_apart, of_joints, of_link, position
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Computes a posture from positions of the motors and the last posture.
Step = Callable[[Array, Array], Array]
#: Largest difference of two closed postures that are the same [rad, m].
SAME = 1e-6
#: Rows of the fine motion.
FINE = 60
#: A step of the delta's motors that meets a singularity on its straight way.
BEYOND = np.array([0.1509, 0.1798, -1.6443]), np.array([0.9059, 1.1365, -1.7454])


def end_of_fine_motion(robot: HybridRobot, q: Array, x: Array, target: Array) -> Array | None:
    """Return the end of the straight motion of the motors from x to a target; None if it raises."""
    rows = x + np.linspace(0.0, 1.0, FINE + 1)[:, None] * (target - x)
    motors = {name: rows[:, i] for i, name in enumerate(robot.motors)}
    try:
        return hybridyn.assemble(robot, motors=motors, guess=q)[0][-1]
    except AssemblyError:
        return None


def step_of(robot: HybridRobot) -> Step:
    """Return the function that assembles a posture at motor positions from a last one."""
    return lambda x, q: hybridyn.assemble(robot, motors=dict(zip(robot.motors, x, strict=True)), guess=q)[0]


def compiled_step(robot: HybridRobot) -> Step:
    """Return the same function of the compiled robot."""
    compiled = hybridyn.compile(robot)
    return lambda x, q: compiled.close(x, last=q)[0]


def judged(robot: HybridRobot, steps: int, largest: float, step_to: Step) -> int:
    """Compare random steps from postures of the branch of home; return how many can be followed."""
    rng, followed = np.random.default_rng(0), 0
    home = robot.home, np.array([position(robot, name, robot.home) for name in robot.motors])
    q, x = home
    for step in range(steps):
        q, x = (q, x) if step % 5 else home
        way = rng.normal(size=len(x)) * np.exp(rng.uniform(np.log(0.02), np.log(largest)))
        wanted = end_of_fine_motion(robot, q, x, x + way)
        try:
            found = step_to(x + way, q)
        except AssemblyError:
            assert wanted is None, step
            continue
        assert wanted is not None, step
        assert far_apart(robot, found[None], wanted[None]) < SAME, step
        q, x, followed = found, x + way, followed + 1
    return followed


@pytest.mark.parametrize("finest", [16, slow(walk.FINEST)])
def test_a_step_that_straight_motions_cannot_make_is_an_error(
    finest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The straight motion of the delta's arms meets a singularity; Newton's method finds a posture beyond."""
    monkeypatch.setattr(walk, "FINEST", finest)
    robot = hybridyn.load("delta")
    x, target = BEYOND
    q = hybridyn.assemble(robot, motors=x)[0]
    refused(
        lambda: step_of(robot)(target, q),
        AssemblyError,
        r"at sample 0 straight from the guess|do not close at sample 0",
    )


@pytest.mark.slow
def test_the_fine_motion_ends_there_too() -> None:
    """As the step of the test above."""
    robot = hybridyn.load("delta")
    x, target = BEYOND
    assert end_of_fine_motion(robot, hybridyn.assemble(robot, motors=x)[0], x, target) is None


def test_a_step_whose_ends_look_alike_ends_on_its_branch() -> None:
    """Newton's method goes straight to another branch here, and both checks of the whole step hold."""
    robot = hybridyn.load("five_bar")
    q = np.array([2.2748787687703027, -2.17463662079532, -0.8852704267081961, 1.7001928700739788])
    x, target = q[[0, 2]], np.array([0.24282016420201735, 0.43762760946090973])
    wanted = end_of_fine_motion(robot, q, x, target)
    assert wanted is not None
    found = step_of(robot)(target, q)
    assert far_apart(robot, found[None], wanted[None]) < SAME


def test_a_whole_turn_of_a_crank_turns_its_rod_back() -> None:
    """Both ends of the step look alike; between them the rod only swings, so the elbow turns as the crank."""
    robot = hybridyn.load("five_bar")
    found = step_of(robot)(np.array([2 * np.pi, 0.0]), robot.home)
    close_to(found - robot.home, 2 * np.pi * np.array([1.0, -1.0, 0.0, 0.0]), SAME)


@pytest.mark.parametrize("compiled", [False, slow(True)])
def test_motors_that_turn_the_rows_beyond_a_fold(compiled: bool) -> None:
    """The motors alone turn the row's Jacobian about: seen from where they end, another branch is ahead."""
    robot = build_robot(random_mechanism(107, kind="loop_rows_x"))
    x = np.array([position(robot, name, robot.home) for name in robot.motors])
    target = x + np.array([-0.1105, 0.1093, 0.0631])
    wanted = end_of_fine_motion(robot, robot.home, x, target)
    assert wanted is not None
    step_to = compiled_step(robot) if compiled else step_of(robot)
    found = step_to(target, robot.home)
    assert far_apart(robot, found[None], wanted[None]) < SAME


@pytest.mark.parametrize(
    ("name", "steps", "largest"), [("five_bar", 10, 2.5), slow("five_bar", 400, 2.5), slow("delta", 100, 1.6)]
)
def test_steps_of_shipped_robots(name: str, steps: int, largest: float) -> None:
    robot = hybridyn.load(name)
    assert judged(robot, steps, largest, step_of(robot)) > 0.4 * steps


@pytest.mark.slow
@pytest.mark.parametrize(("name", "steps", "largest"), [("five_bar", 400, 2.5), ("delta", 150, 1.6)])
def test_steps_of_compiled_robots(name: str, steps: int, largest: float) -> None:
    robot = hybridyn.load(name)
    assert judged(robot, steps, largest, compiled_step(robot)) > 0.4 * steps


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if not kind.startswith(("serial", "sps"))])
def test_steps_of_random_mechanisms(kind: str) -> None:
    """How far legs turn about themselves ("sps") depends on the steps."""
    robot = build_robot(random_mechanism(1, kind=kind))
    judged(robot, 10, 2.0, step_of(robot))


SAME_MODULES = 1e-9  # the same posture and rates, through the conditioning of the modules

Poses = dict[str, tuple[Array, Array, Array]]


def stacked_poses() -> tuple[HybridRobot, tuple[Array, Array, Array], Poses]:
    """Return three stacked modules, two states of theirs, and the pose of each platform on the one below."""
    robot = build_robot(shipped("lx4", modules="3"))
    states = states_near_home(robot.description, "fixed", 8, 2)
    links = [robot.description.root, *(m.outputs[0] for m in robot.modules)]
    pairs = zip(links[1:], links[:-1], strict=True)
    return robot, states, {f"{link}@{below}": of_link(robot, *states, link, below) for link, below in pairs}


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows are followed together, call by call."""
    counts, follow = [], assemble.follow

    def counted(task: Task, guess: Array, **how: bool) -> tuple[Array, Task]:
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
    assert far_apart(robot, found[0], q) < SAME_MODULES
    close_to(found[1:], (v, a), SAME_MODULES)


def test_the_module_out_of_reach_is_named_among_equal_ones() -> None:
    """A leg five metres too long beside legs that are not; and a trajectory without samples is an error."""
    robot, states, _ = stacked_poses()
    none = of_joints(robot, *(x[:0] for x in states), robot.motors)
    refused(lambda: hybridyn.assemble(robot, motors=none), TrajectoryError, "no samples")
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
    np.testing.assert_allclose(moved[:, others], np.repeat(still[:, others], 2, axis=0), atol=SAME_MODULES)
    assert np.abs(moved[1] - still[0])[robot.modules[2].q_index].max() > 0.01


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
    close_to(parts, whole, SAME_MODULES, 1.0)
