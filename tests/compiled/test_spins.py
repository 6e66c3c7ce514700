"""Rods between two balls spin idly: compiled models compute them, whatever spins the caller gives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.code.kernels import kernel_graph
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.loops.loop_rows import shape_of
from hybridyn.compiled.programs.closing.closing_library import place_of
from hybridyn.compiled.programs.closing.closing_source import closing_programs
from hybridyn.compiled.programs.closing.kernels import ModuleKernels
from hybridyn.compiled.programs.closing.members import parts_of
from hybridyn.compiled.programs.closing.module_parts import motors_given, numbers, places_at
from hybridyn.compiled.programs.closing.own_requests import module_requests
from hybridyn.compiled.programs.designs import changed
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.dynamics.forward import forward
from hybridyn.effects.joint_laws import ViscousFriction
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from tests.compiled import rods
from tests.compiled.test_derivatives import DIFFERENCES, along_a_motion
from tests.robots.shipped import shipped
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import slow
from tests.support.written_out import Interpreted

#: Of the largest entry: some hundred roundings, of both paths.
ROUNDING = 1e-12
#: Rounding through the condition of loops.
CLOSED = 1e-10
#: A rod's inertia about its line is 1e-5 of those of the other motions, from which the general path takes it.
SPUN = 1e-7


#: A small machine by name, and the large ones, with thin rods and with universal joints, too.
MACHINES = [
    (slow if name != "crank" else pytest.param)(name, *how)
    for name in ("crank", "ball_delta", "ball_gough", "slides")
    for how in (
        (0, "ball", False),
        (1, "ball", True),
        (2, "universal", False),
        (3, "floating", False),
        (4, "floating aside", True),
    )
]


def compare(robot: hybridyn.HybridRobot, size: float, samples: int = 25) -> None:
    """Compare both models along a motion with spins that no motor drives; no sample may be handed over."""
    q, v, a = rods.moved(robot, samples, size)
    models = Interpreted(robot, ("idm", "ddm"))
    wanted = hybridyn.idm(robot, q, v, a)
    (tau,), guard = models.batch("idm", q, v, a)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(tau - wanted).max() <= ROUNDING * np.abs(wanted).max()
    (found,), guard = models.batch("ddm", q, v, wanted)
    assert (guard <= GUARD_LIMIT).all()
    general = hybridyn.ddm(robot, q, v, wanted)
    assert np.abs(found - general).max() <= SPUN * np.abs(general).max()
    motors = robot.motor_v
    assert np.abs(found - general)[:, motors].max() <= 1e3 * ROUNDING * np.abs(general).max()


def spins(robot: hybridyn.HybridRobot) -> int:
    """Count the spins that compiled models know."""
    return sum(len(plan.parts.all_idle) for plan in request(robot, None).plans)


@pytest.mark.parametrize(
    ("name", "thin"),
    [("ball_gough", True), slow("ball_gough", False), slow("slides", True), slow("slides", False)],
)
def test_equal_legs_carry_their_spins(name: str, thin: bool) -> None:
    """As with universal joints, legs share their code, wherever the line of a rod is in its frame."""
    (plan,) = request(build_robot(getattr(rods, name)(1, thin=thin)), None).plans
    assert [len(group) for group in plan.parts.groups] == [6]
    assert not plan.parts.idle


@pytest.mark.parametrize(("name", "seed", "foot", "thin"), MACHINES)
def test_no_sample_is_handed_over(name: str, seed: int, foot: rods.Foot, thin: bool) -> None:
    """Away from singular postures, where motions are as wide as the machine allows."""
    robot = build_robot(getattr(rods, name)(seed, foot, thin=thin))
    assert spins(robot) == (0 if foot == "universal" else 1 if name == "crank" else 6)
    compare(robot, 0.04 if name in ("ball_gough", "slides") else 0.4)


def test_motors_of_rods_that_spin_are_redundant() -> None:
    """Spins are no motions that motors drive: seven slides share the load of six freedoms."""
    robot = build_robot(rods.slides(1, spare=True))
    q, v, _, tau = random_states(robot, 5)
    a = hybridyn.ddm(robot, q, v, tau)
    wanted = hybridyn.idm(robot, q, v, a)
    (found,), guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
    alone = rods.crank(1)
    slide = next(joint.name for joint in alone.joints if "slide" in joint.name)
    both = build_robot(replace(alone, motors=(*alone.motors, slide)))
    q, v, a = rods.moved(build_robot(alone), 5, 0.4)
    words = "2 motors, some in N and some in N m, share 1 freedom. Give weights"
    refused(lambda: hybridyn.idm(both, q, v, a), hybridyn.ActuationError, words)
    tau, rates = hybridyn.idm(both, q, v, a, weights=np.ones(2)), v[:, both.motor_v]
    power = hybridyn.idm(build_robot(alone), q, v, a)[:, 0] * rates[:, 0]
    assert np.abs((tau * rates).sum(axis=1) - power).max() <= CLOSED * np.abs(power).max()
    across = tau[:, 0] * rates[:, 1] - tau[:, 1] * rates[:, 0]  # the least efforts are as the rates
    assert np.abs(across).max() <= CLOSED * np.abs(power).max()


def test_a_floating_base_feels_the_spins_of_its_legs() -> None:
    """No friction takes them along; the other joints feel those of rods that are not round."""
    description, skew = rods.slides(6), 0.01 * np.outer([0.3, 0.5, 0.8], [0.3, 0.5, 0.8])
    links = [replace(x, inertia=x.inertia + skew * ("rod" in x.name)) for x in description.links]
    robot = build_robot(replace(description, links=tuple(links)), base="floating")
    assert len(request(robot, None).plans[1].parts.groups) == 1
    q, v, _, tau = random_states(robot, 5)
    rods.spin(robot, q, v, None, np.random.default_rng(7))
    (found,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau)
    wanted = hybridyn.ddm(robot, q, v, tau)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(found - wanted).max() <= 1e2 * ROUNDING * np.abs(wanted).max()


@pytest.mark.parametrize(
    ("name", "count", "size", "left"),
    [("crank", 1, 0.4, 5e-15), ("crank", 1, 0.4, -5e-15), slow("slides", 6, 0.04, 0.0)],
)
def test_thin_rods_on_revolutes_get_no_spin_and_bear_no_force(
    name: str, count: int, size: float, left: float
) -> None:
    """What rounding leaves of their inertia, of either sign, is none; friction at a spin is refused.

    Frames of a crank are along its rod, so that none is left; it is added, as a part of the inertia across.
    """
    description, links = getattr(rods, name)(4, "revolutes", thin=True), []
    for link in description.links:
        d = link.com / (np.linalg.norm(link.com) or 1.0)
        more = left * np.abs(link.inertia).max() * np.outer(d, d) if "rod" in link.name else 0.0
        links.append(replace(link, inertia=link.inertia + more))
    robot = build_robot(replace(description, links=tuple(links)))
    assert spins(robot) == count
    q, v, a = rods.moved(robot, 5, size)
    tau = hybridyn.idm(robot, q, v, a)
    (found,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau)
    wanted = hybridyn.ddm(robot, q, v, tau)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(found - wanted).max() <= CLOSED * np.abs(wanted).max()
    names = [joint.name for joint in robot.description.joints if "rod" in joint.name]
    spun = [robot.v_slices[robot.joint_index[name]].start for name in names]
    assert np.abs(found[:, spun]).max() == 0.0
    effects = ["default", ViscousFriction({names[-1]: 0.01})]
    refused(lambda: hybridyn.ddm(robot, q, v, tau, effects=effects), hybridyn.SingularityError, "no inertia")
    _, guard = Interpreted(robot, ("ddm",), effects).batch("ddm", q, v, tau)
    assert not (guard <= GUARD_LIMIT).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "legs", "size"),
    [
        ("lx4", 24, 0.02),
        ("gough_stewart", 6, 0.03),
        ("delta", 6, 0.3),
        ("scara_delta", 6, 0.3),
        ("stewart_ur5", 6, 0.03),
    ],
)
def test_shipped_robots_with_balls_at_their_feet(name: str, legs: int, size: float) -> None:
    robot = build_robot(rods.with_balls(shipped(name)))
    assert spins(robot) == legs
    compare(robot, size, 9)


@pytest.mark.slow
def test_twelve_rods_in_two_modules() -> None:
    """The upper Delta is carried by the lower one's platform, so its spins feel the motion of their base."""
    robot = build_robot(rods.stack())
    assert [len(plan.parts.all_idle) for plan in request(robot, None).plans] == [6, 6]
    compare(robot, 0.3, 9)


def test_mass_beside_the_line_is_no_idle_spin() -> None:
    """Its spin moves mass: the efforts of accelerations that no motor gives it are refused, as before."""
    robot = build_robot(rods.crank(3, beside=0.02))
    assert not request(robot, None).plans[0].parts.all_idle
    turning = build_robot(rods.crank(3))
    q, v, a = rods.moved(turning, 5, 0.4)
    refused(lambda: hybridyn.idm(robot, q, v, a), hybridyn.ActuationError, "no motor can produce")
    _, guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a)
    assert not (guard <= GUARD_LIMIT).any()


@pytest.mark.parametrize(("name", "stem", "size"), [("crank", "rod", 0.4), slow("ball_gough", "slide", 0.02)])
def test_where_parameters_move_mass_or_an_end_beside_the_line_the_general_path_decides(
    name: str, stem: str, size: float
) -> None:
    """A longer rod spins as before; a centre of mass or an end beside the line makes it no idle spin."""
    robot = build_robot(getattr(rods, name)(4))
    closure = robot.description.closures[0]
    side, end, frame = (
        ("predecessor", closure.link_a, closure.frame_a)
        if stem in closure.link_a
        else ("successor", closure.link_b, closure.frame_b)
    )
    link = next(link for link in robot.description.links if link.name == end)
    names = [f"centre:{link.name}", f"position:{closure.name}/{side}"]
    parameters = Parameters(robot.description, names)
    program = programs(robot, None, models=("idm",), parameters=parameters.slots)["idm"]
    across = np.cross(link.com, [0.3, -0.5, 0.8])
    for centre, end, idle in (
        (link.com, frame[:3, 3], True),
        (0.9 * link.com, 1.03 * frame[:3, 3], True),
        (link.com + 1e-3 * across, frame[:3, 3], False),
        (link.com, frame[:3, 3] + 0.02 * across, False),
    ):
        design = robot.with_parameters(dict(zip(names, (centre, end), strict=True)))
        q, v, a = rods.moved(design, 4, size) if idle else random_states(design, 4)[:3]
        numbers = parameters.slot_values(np.concatenate([centre, end])[None])[0]
        samples = [function_of(program)(*sample, numbers) for sample in zip(q, v, a, strict=True)]
        assert all((guard <= GUARD_LIMIT) == idle for _, guard in samples)
        if idle:
            wanted = hybridyn.idm(design, q, v, a)
            found = np.array([np.array(tau).ravel() for tau, _ in samples])
            assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()


def test_mass_beside_the_line_by_rounding_of_a_file_is_weighed() -> None:
    """Its weight turns the rod, whose inertia about the line is small."""
    description = rods.slides(6)
    links = [
        replace(x, com=x.com + 2e-12 * np.cross(x.com, [0.3, -0.5, 0.8]) * ("rod" in x.name))
        for x in description.links
    ]
    robot = build_robot(replace(description, links=tuple(links)))
    assert not request(robot, None).plans[0].parts.idle
    q, v, _, tau = random_states(robot, 5)
    (found,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau)
    wanted = hybridyn.ddm(robot, q, v, tau)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(found - wanted).max() <= 1e2 * ROUNDING * np.abs(wanted).max()


@pytest.mark.parametrize("foot", ["ball", "floating", "floating aside"])
@pytest.mark.parametrize(
    ("name", "size"), [("crank", 0.4), slow("ball_delta", 0.4), slow("ball_gough", 0.02)]
)
def test_rates_of_closed_loops_are_those_of_the_general_path(name: str, size: float, foot: rods.Foot) -> None:
    """The spins get the least rates and accelerations, and joints beyond a rod follow it."""
    robot = build_robot(getattr(rods, name)(5, foot))
    motors = rods.swings(robot, 5, size)
    q, v, a = hybridyn.assemble(robot, motors=motors)
    wanted = module_requests(robot, gather_requests(robot, motors, {}))
    parts = parts_of(robot, wanted)
    (part,), (g, g_dot, g_ddot) = parts, numbers(parts, wanted)
    assert part.idle
    kernels = ModuleKernels([part.module], part.given, part.blocks, idle=part.idle_freedoms)
    settle, numbers_of = kernels.write()["settle"]
    table = numbers_of[0].astype(float)
    p, _ = places_at(parts, [state.q for state in forward(robot, q, v, a)], len(q))
    for t in range(len(q)):
        at = q[t], p[t], q[t], p[t], g[t], g[t], g_dot[t], g_ddot[t], table
        *_, rate, acceleration, step, open_by, _, guard = (np.array(x).ravel() for x in settle(*at))
        assert guard <= GUARD_LIMIT
        assert max(step[0], open_by[0]) <= ROUNDING
        assert np.abs(rate - v[t]).max() <= CLOSED * np.abs(v).max()
        assert np.abs(acceleration - a[t]).max() <= CLOSED * np.abs(a).max()


@pytest.mark.parametrize(
    ("name", "foot", "size"),
    [
        ("crank", "ball", 0.4),
        ("crank", "floating", 0.4),
        ("crank", "floating aside", 0.4),
        slow("ball_delta", "ball", 0.4),
        slow("ball_gough", "floating aside", 0.02),
        slow("gough_stewart", "ball", 0.02),
    ],
)
def test_newton_steps_close_loops_of_spinning_rods(name: str, foot: rods.Foot, size: float) -> None:
    """From an open posture few steps close the loops."""
    own = getattr(rods, name, None)
    robot = build_robot(own(6, foot) if own else rods.with_balls(shipped(name)))
    q, v, a = rods.moved(robot, 5, size)
    models = Interpreted(robot, ("close", "lift"))
    manifold, (module,) = Manifold(robot), robot.modules
    xi = 1e-3 * robot.unit * np.random.default_rng(6).normal(size=v.shape)
    near, left = module.mechanism.spanning.integrate(q, xi), np.full(len(q), np.inf)
    for _ in range(7):  # each step of "close" leaves its square, one of "lift" a hundredth: the chart's
        (near, *_), _ = models.batch("close", near, v, a)
        (lifted, xi, *_), _ = models.batch("lift", q, xi, v)
        before, left = left, np.array([manifold.residual(x)[0] for x in near])
        assert (left <= np.maximum(100.0 * before**2, ROUNDING)).all()
    assert max(manifold.residual(x)[0] for x in lifted) <= ROUNDING


def test_mirrored_modules_close_each_along_its_own_rods(tmp_path: Path) -> None:
    """They share a kernel, and the line of each rod in its body is another."""
    robot = hybridyn.load(save(tmp_path, rods.mirrored_cranks()), motors=["crank_l", "crank_r"])
    assert len({shape_of(module) for module in robot.modules}) == 1
    q, v, a = random_states(robot, 3, 1)[:3]
    (_, rates, _), guard = Interpreted(robot, ("close",)).batch("close", q, v, a)
    assert (guard <= 1).all()
    manifold, step = Manifold(robot), 1e-5
    for x, rate in zip(q, rates, strict=True):
        moved = x.copy()
        for m in robot.modules:
            moved[m.q_index] = m.mechanism.spanning.integrate(
                x[m.q_index][None], step * rate[m.v_index][None]
            )
        assert manifold.residual(moved)[0] <= 10.0 * step**2  # of second order


def test_a_platform_on_a_ball_is_no_rod() -> None:
    """A leg that carries a module is in no group: the closures of the other legs are not beside its own."""
    s = rods.plain(0)
    p = s.place()
    platform = s.joint("spherical", "base", p(0.0, 0.0, 0.6), stem="platform")
    cranks = []
    for x in (0.5, -0.4):
        cranks.append(s.joint("revolute", "base", p(x, 0.1, 0.0), motor=True))
        rods.rod(s, cranks[-1], p(x, 0.0, 0.2), platform, p(0.6 * x, 0.1, 0.7), "ball")
    s.joint("revolute", cranks[0], s.poses[cranks[0]][:3, 3], motor=True)
    robot = build_robot(s.description("on a ball"))
    q, v, a, tau = random_states(robot, 2)
    (found,), guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a)
    assert (guard <= GUARD_LIMIT).all()
    assert np.abs(found - tau).max() <= CLOSED * np.abs(tau).max()


@pytest.mark.slow
@pytest.mark.parametrize("foot", ["ball", "floating", "floating aside"])
@pytest.mark.parametrize(("name", "size"), [("crank", 0.4), ("ball_delta", 0.3)])
def test_loops_of_spinning_rods_close_in_c(name: str, size: float, foot: rods.Foot) -> None:
    """Tables and control steps: no sample is left to the general path, and efforts are the same.

    The least rates of a rod whose frame is beside its line turn it, by rates that depend on how far it has
    spun: there it is thin.
    """
    robot = build_robot(getattr(rods, name)(5, foot, thin=foot == "floating aside"))
    motors = rods.swings(robot, 25, size)
    q, v, a = hybridyn.assemble(robot, motors=motors)
    wanted = hybridyn.idm(robot, q, v, a)
    compiled = hybridyn.compile(robot)
    found = compiled.assemble(motors=motors)
    assert np.abs(compiled.idm(*found) - wanted).max() <= CLOSED * np.abs(wanted).max()
    last, rows = found[0][0], np.moveaxis(np.array([motors[name] for name in robot.motors]), -1, 0)
    compiled.close(*rows[0].T, last=last)
    for row, tau in zip(rows.transpose(0, 2, 1), wanted, strict=True):
        efforts, last = compiled.idm_from_motors(*row, last=last)[:2]
        assert np.abs(efforts - tau).max() <= CLOSED * np.abs(wanted).max()
        compiled.close(*row, last=last)
    assert compiled.recomputed == 0


@pytest.mark.parametrize("name", ["crank", slow("slides"), slow("delta"), slow("lx4")])
def test_loops_with_balls_take_operations_as_with_universal_joints(name: str) -> None:
    """At most 1.2 times as many, in steps from row to row and in the last one."""
    own, counts = getattr(rods, name, None), []
    pair = (own(1, "ball"), own(1, "universal")) if own else (rods.with_balls(shipped(name)), shipped(name))
    for robot in map(build_robot, pair):
        requests = gather_requests(robot, rods.swings(robot, 2, 0.01), {})
        closing = closing_programs(robot, parts_of(robot, module_requests(robot, requests)))
        steps = closing["newton"], closing["settle"]
        counts.append([sum(len(kernel_graph(k).nodes) for k in step.kernels) for step in steps])
    balls, universal = np.array(counts)
    assert (balls <= 1.2 * universal).all()


@pytest.mark.slow
@pytest.mark.parametrize("foot", ["ball", "floating"])
def test_designs_of_spinning_rods_close_in_c(foot: rods.Foot) -> None:
    """Also where a design makes the rod longer; beside its line it is no longer idle, which is told."""
    robot = build_robot(rods.crank(4, foot))
    link = next(link.name for link in robot.description.links if "rod" in link.name)
    closure = robot.description.closures[-1]
    side, frame = (
        ("predecessor", closure.frame_a) if closure.link_a == link else ("successor", closure.frame_b)
    )
    names = [f"position:{closure.name}/{side}", f"mass:{link}"]
    compiled, motors = hybridyn.compile(robot, parameters=names), rods.swings(robot, 9, 0.1)
    p = np.outer(np.linspace(0.98, 1.02, 3), compiled.parameters.nominal)
    found = compiled.designs(p, motors=motors)
    assert found.recomputed == 0
    for one, tau in zip(p, found.tau, strict=True):
        design = robot.with_parameters(dict(zip(names, (one[:3], one[3]), strict=True)))
        wanted = hybridyn.idm(design, *hybridyn.assemble(design, motors=motors))
        assert np.abs(tau - wanted).max() <= CLOSED * np.abs(wanted).max()
    beside = p[:1].copy()
    beside[0, :3] += 0.01 * np.cross(frame[:3, 3], [0.3, 0.5, -0.2])
    assert "could still move" in compiled.designs(beside, motors=motors).errors[0]


def test_loops_close_where_a_position_moves_a_slide_off_the_line_of_its_rod() -> None:
    """Turns of a rod on a universal joint move its end along the rod then; other rods still spin."""
    description = rods.two_legs(1)
    robot, (slide,) = build_robot(description), description.motors
    parameters = Parameters(description, [f"position:{slide}"])
    slots = parameters.slot_values(parameters.nominal[None] + 0.02)[0]
    design, arguments = changed(robot, parameters, slots), request(robot, None, parameters=parameters.slots)
    q, v, a, _ = random_states(design, 1, 3)
    at = [design.q_slices[design.joint_index[name]].start for name in design.motors]
    given = q[0, at], v[0, design.motor_v], a[0, design.motor_v]
    motors = {name: tuple(x[i : i + 1] for x in given) for i, name in enumerate(design.motors)}
    wanted = hybridyn.assemble(design, motors=motors, guess=q[0])
    parts = parts_of(robot, module_requests(robot, gather_requests(robot, motors, {})))
    assert len(parts[0].idle) == 1
    settle = function_of(closing_programs(robot, parts, arguments.arguments)["settle"])
    (own,) = parts_of(design, module_requests(design, gather_requests(design, motors, {})))
    posture, p, g = place_of(design, [own], q[0])
    order = motors_given(robot, parts)
    found = settle(posture, p, posture, p, g, g, given[1][order], given[2][order], [], slots)
    assert float(found[-1]) <= GUARD_LIMIT
    for x, right in zip(found[2:4], wanted[1:], strict=True):
        assert np.abs(x.full().ravel() - right[0]).max() <= CLOSED * np.abs(right).max()


@pytest.mark.parametrize(
    ("name", "foot", "thin"),
    [
        slow("crank", "ball", False),
        ("crank", "ball", True),
        ("crank", "floating", True),
        slow("crank", "floating aside", True),
        slow("ball_gough", "ball", False),
        slow("ball_gough", "ball", True),
    ],
)
def test_derivatives_along_a_closed_motion(name: str, foot: rods.Foot, thin: bool, interpreted: None) -> None:
    """Without inertia about its line a rod's spin gets the least acceleration, at every state alike."""
    robot = build_robot(getattr(rods, name)(1, foot, thin=thin))
    found, jerk = along_a_motion(robot)
    limits = np.full(robot.nv, DIFFERENCES * np.abs(jerk).max())
    for kind, at in zip(robot.kinds, robot.v_slices, strict=True):
        limits[at] *= SPUN / ROUNDING if kind in ("spherical", "floating") and not thin else 1.0
    assert (np.abs(found - jerk) <= limits).all()
