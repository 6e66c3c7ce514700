"""Poses of links through several modules: reached, and followed by the least motion of the motors."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot, SingularityError, TrajectoryError, closure_residual
from hybridyn.assembly.chain.coupling import ways_between
from hybridyn.assembly.poses import PoseRequest
from hybridyn.cli import main
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.assembly.test_angles import arm
from tests.oracle import Oracle
from tests.robots.excavator import HOME, MOTORS, cylinders, excavator, teeth
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.posing import far_apart, of_joints, of_link
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

REACHED = 1e-10  # of positions, rates and accelerations, relative to the largest
LEAST = 1e-4  # of the rule: joints without a motor count a thousandth of it, squared, times their number
ALMOST = 2e-3  # the same in platforms of motors with short ranges, whose other joints turn much
STEP = 5e-4  # of time in central differences [s]
DIFFERENCED = 2e-4  # relative, of rates: truncation STEP^2 of motions of size 1 in some 0.1 s
DRIFTED = 2e-2  # of positions, whose rule goes from row to row: error STEP
#: Kinds of stacks, with the links between which a pose is given: of the last module's output, or of others.
STACKS = ("stack", "stewart_arm", "scara_delta", "branched", "legged", "chain_of_bars", "serial")
#: Mechanisms of one module, whose outputs have more freedoms than two, or as many.
ALONE = ("gough", "gough_eight_motors", "delta_bars", "planar_rpr", "rps3")
#: Those whose last link moves in all directions.
NUDGED = ("stack", "stewart_arm")


def stacked(kind: str, seed: int, count: int = 2) -> tuple[HybridRobot, tuple[Array, Array, Array]]:
    description = random_mechanism(seed, kind=kind)
    return build_robot(description), random_states(description, "fixed", seed, count)


def ends(robot: HybridRobot, kind: str) -> tuple[str, str]:
    """Return the link whose pose is given, and the link that it is relative to."""
    tips = [k for k in range(len(robot.modules)) if k not in {m.parent for m in robot.modules}]
    other = robot.modules[tips[0]].name if kind in ("legged", "branched") else robot.description.root
    return robot.modules[tips[-1]].name, other


def spans(robot: HybridRobot) -> Array:
    """Return what each motor's motion is measured by, shape (motors,)."""
    lengths = {name: module.mechanism.length for module in robot.modules for name in module.motors}
    out = []
    for name in robot.motors:
        joint = robot.records[name]
        span = joint.upper - joint.lower
        out.append(span if 0 < span < np.inf else lengths[name] if joint.kind == "prismatic" else 2 * np.pi)
    return np.array(out)


def least(
    robot: HybridRobot, q: Array, link: str, other: str, twist: Array, measured: Array | None = None,
    rows: Array | None = None,
) -> Array:  # fmt: skip
    """Compute the least rates of the motors over their spans, by the oracle's motions, Pinocchio's twists.

    `rows` of twists are given, shape (n, 6), all where left out; `measured` holds what the motors' motion is
    measured by instead, shape (motors,).
    """
    by = spans(robot) if measured is None else measured
    Z = Oracle(robot.description).motions(q)
    still = np.zeros_like(Z.T)
    J = of_link(robot, np.tile(q, (Z.shape[1], 1)), Z.T, still, link, other)[1].T
    if rows is not None:
        J, twist = rows @ J, rows @ twist
    Q, R = np.linalg.qr(Z[robot.motor_v] / by[:, None])
    return Q @ np.linalg.pinv(J @ np.linalg.inv(R), rcond=1e-9) @ twist


@pytest.mark.parametrize(
    ("kind", "seed"),
    [*zip(STACKS, range(7), strict=True), *(slow(kind, seed) for kind in STACKS for seed in range(8, 22))],
)
def test_poses_through_random_stacks_are_reached_by_the_least_motion(kind: str, seed: int) -> None:
    robot, (q0, v0, a0) = stacked(kind, seed)
    link, other = ends(robot, kind)
    pose, twist, change = of_link(robot, q0, v0, a0, link, other)
    key = f"{link}@{other}"
    between = {k for way in ways_between(robot, PoseRequest(link, other, None, {})) for k, _ in way}
    beside = [name for k, module in enumerate(robot.modules) if k not in between for name in module.motors]
    for i in range(len(q0)):
        held = {n: tuple(x[i] for x in one) for n, one in of_joints(robot, q0, v0, a0, beside).items()}
        given = {key: (pose[i], twist[i], change[i])}
        q, v, a = hybridyn.assemble(robot, motors=held, platforms=given, guess=q0[i])
        assert far_apart(robot, q[None], q0[i : i + 1]) < REACHED  # it is there already
        found = of_link(robot, q[None], v[None], a[None], link, other)
        for one, wanted in zip(found, (pose, twist, change), strict=True):
            close_to(one, wanted[i : i + 1], REACHED)
        if not beside:
            close_to(v[robot.motor_v] / spans(robot), least(robot, q, link, other, twist[i]), LEAST)
        if kind in NUDGED:
            near = pose[i].copy()
            near[:3] += 0.01 * np.random.default_rng(seed).normal(size=3)
            q = hybridyn.assemble(robot, motors=held, platforms={key: near}, guess=q0[i])[0]
            assert closure_residual(robot, q) < REACHED
            close_to(of_link(robot, q[None], v[None], a[None], link, other)[0][0, :3], near[:3], REACHED)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [*zip(ALONE, range(5), strict=True), *(slow(kind, seed) for kind in ALONE for seed in range(8, 14))],
)
def test_a_partial_pose_within_one_module_moves_its_motors_least(kind: str, seed: int) -> None:
    """Of platforms with three to six freedoms, two numbers are given; or one of three."""
    robot, (q0, v0, a0) = stacked(kind, seed)
    link, base = robot.modules[0].name, robot.modules[0].base
    pose, twist, change = of_link(robot, q0, v0, a0, link, base)
    for i, names in enumerate((("x", "y"), ("x",))):
        levels = tuple(dict(zip(names, x[i], strict=False)) for x in (pose, twist, change))
        q, v, a = hybridyn.assemble(robot, platforms={f"{link}@{base}": levels}, guess=q0[i])
        assert far_apart(robot, q[None], q0[i : i + 1]) < REACHED
        found = of_link(robot, q[None], v[None], a[None], link, base)
        for one, wanted in zip(found, (pose, twist, change), strict=True):
            close_to(one[0, : len(names)], wanted[i, : len(names)], REACHED)
        close_to(
            v[robot.motor_v] / spans(robot),
            least(robot, q, link, base, twist[i], rows=np.eye(6)[: len(names)]),
            ALMOST,
        )


@pytest.mark.parametrize(("name", "names"), [("gough_stewart", "xy"), ("delta", "z"), slow("lx4", "xz")])
def test_a_platform_follows_some_coordinates_by_the_rule(name: str, names: str) -> None:
    """Rates are by differences those of the positions, accelerations those of the rates."""
    robot = build_robot(shipped(name))
    link, base = robot.modules[0].name, robot.modules[0].base
    still = np.zeros((1, robot.nv))
    home = of_link(robot, robot.home[None], still, still, link, base)[0][0, :3]
    t = 0.5 + STEP * np.arange(-3, 4)
    waves = [
        (0.03 * (np.sin(w * t) - np.sin(w / 2)), 0.03 * w * np.cos(w * t), -0.03 * w * w * np.sin(w * t))
        for w in (2.0, 3.0)
    ]
    at = ["xyz".index(n) for n in names]
    levels = tuple(
        {n: home[i] * (k == 0) + w[k] for n, i, w in zip(names, at, waves, strict=False)} for k in range(3)
    )
    others = {m: 0.0 for m in robot.motors if m not in robot.modules[0].motors}
    q, v, a = hybridyn.assemble(robot, motors=others, platforms={f"{link}@{base}": levels})
    close_to((q[4] - q[2])[robot.motor_q] / (2 * STEP), v[3][robot.motor_v], DRIFTED)
    close_to((v[4] - v[2]) / (2 * STEP), a[3], DIFFERENCED)


@pytest.mark.parametrize("name", ["stewart_ur5", *map(slow, ("lx4", "scara_delta"))])
def test_rates_and_accelerations_are_the_derivatives_of_the_rule(name: str) -> None:
    """Rates by differences of positions, and accelerations by those of rates."""
    robot = build_robot(shipped(name))
    link, root = robot.modules[-1].outputs[0], robot.description.root
    still = np.zeros((1, robot.nv))
    home = of_link(robot, robot.home[None], still, still, link, root)[0]
    t = 0.5 + STEP * np.arange(-3, 4)
    pose, zero = np.repeat(home, len(t), axis=0), np.zeros_like(t)
    pose[:, 0] += 0.04 * np.sin(3 * t) - 0.04 * np.sin(1.5)
    pose[:, 2] -= 0.02 * t * t
    twist = np.stack([0.12 * np.cos(3 * t), zero, -0.04 * t, zero, zero, zero], axis=1)
    change = np.stack([-0.36 * np.sin(3 * t), zero, zero - 0.04, zero, zero, zero], axis=1)
    q, v, a = hybridyn.assemble(robot, platforms={link: (pose, twist, change)})
    assert (v[1:] != v[:-1]).any()
    joints = robot.motor_v
    moved = (q[4] - q[2])[robot.motor_q] / (2 * STEP)
    close_to(moved, v[3][joints], DRIFTED)
    close_to((v[4] - v[2]) / (2 * STEP), a[3], DIFFERENCED)


def test_an_excavator_follows_its_teeth(tmp_path: Path) -> None:
    """Three numbers for three freedoms, against triangles; 80 to 60 degrees of the stick was mirrored."""
    robot = hybridyn.load(excavator(tmp_path))
    rng = np.random.default_rng(0)
    angles = HOME + rng.uniform(-0.3, 0.3, (5, 3))
    for one in angles:
        x, z, pitch = teeth(one)
        q, _, _ = hybridyn.assemble(robot, platforms={"teeth": ({"x": x, "z": z, "pitch": pitch},)})
        rods = q[[robot.q_slices[robot.joint_index[name]].start for name in MOTORS]]
        close_to(rods, cylinders(one) - cylinders(HOME), REACHED)
    way = np.radians(np.linspace(80, 60, 5))
    held = {name: np.zeros(5) for name in ("boom_rod", "bucket_rod")}
    q, _, _ = hybridyn.assemble(robot, motors=held, platforms={"stick@boom": ({"pitch": way},)})
    rod = q[:, robot.q_slices[robot.joint_index["stick_rod"]].start]
    wanted = [cylinders(np.array([HOME[0], angle, HOME[2]]))[1] - cylinders(HOME)[1] for angle in way]
    close_to(rod, np.array(wanted), REACHED)


def test_a_table_of_the_teeth_is_a_table_of_the_rods(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = excavator(tmp_path)
    t = np.linspace(0, 2, 41)
    angles = HOME + 0.2 * np.sin(np.outer(t, [1.0, 1.3, 0.7]))
    rods = np.array([cylinders(one) for one in angles]) - cylinders(HOME)
    tips = np.array([teeth(one) for one in angles])
    efforts = []
    for name, columns, numbers in (
        ("rods", [f"{rod}/position" for rod in MOTORS], rods),
        ("teeth", [f"teeth/pose/{axis}" for axis in ("x", "z", "pitch")], tips),
    ):
        table = tmp_path / f"{name}.csv"
        np.savetxt(
            table,
            np.column_stack([t, numbers]),
            "%.17g",
            ",",
            header=",".join(["time", *columns]),
            comments="",
        )
        assert main(["idm", str(path), str(table), "-o", str(tmp_path / f"{name}_tau.csv")]) == 0
        lines = (tmp_path / f"{name}_tau.csv").read_text().splitlines()
        rows = [line for line in lines if line and line[0] in "-0123456789"]
        efforts.append(np.array([[float(x) for x in row.split(",")] for row in rows]))
    close_to(efforts[1], efforts[0], 1e-4)  # rates are those of splines through different columns


def test_poses_may_be_mixed_with_motors_and_platforms_between(tmp_path: Path) -> None:
    """The second platform of an lx4 stays level; its first module is held by motors."""
    robot = build_robot(shipped("lx4"))
    states = states_near_home(robot.description, "fixed", 3, 1)
    root, links = robot.description.root, [m.outputs[0] for m in robot.modules]
    motors = of_joints(robot, *states, robot.modules[0].motors)
    tool = of_link(robot, *states, links[3], root)
    part = of_link(robot, *states, links[1], links[0])
    level = (dict(zip(("x", "y", "z"), part[0].T[:3], strict=True)),)
    q, v, a = hybridyn.assemble(
        robot, motors=motors, platforms={links[3]: tool, f"{links[1]}@{links[0]}": level}
    )
    for one, wanted in zip(of_link(robot, q, v, a, links[3], root), tool, strict=True):
        close_to(one, wanted, REACHED)
    close_to(of_link(robot, q, v, a, links[1], links[0])[0][:, :3], part[0][:, :3], REACHED)
    assert closure_residual(robot, q).max() < REACHED


@pytest.mark.parametrize(
    ("names", "motors", "told"),
    [
        (("x", "z", "pitch"), (), ""),
        (("x", "z"), (), "leaves 1 freedom of 'boom', 'stick', 'rocker' open"),
        (("z",), (), "leaves 2 freedoms of 'boom', 'stick', 'rocker' open"),
        (("z",), ("stick_rod",), "leaves 1 freedom of 'boom', 'rocker' open"),
        (("x", "z"), ("boom_rod",), ""),
    ],
)
def test_freedoms_that_are_left_to_the_rule_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str],
    names: tuple[str, ...], motors: tuple[str, ...], told: str,
) -> None:  # fmt: skip
    """By the log of `assemble`, and in the summary of a table."""
    path = excavator(tmp_path)
    t, there = np.linspace(0, 1, 7), dict(zip(("x", "z", "pitch"), teeth(HOME), strict=True))
    columns = {f"{motor}/position": 0.01 * t for motor in motors}
    columns |= {f"teeth/pose/{name}": there[name] + 0.01 * t for name in names}
    rows, files = np.column_stack([t, *columns.values()]), [str(tmp_path / x) for x in ("t.csv", "tau.csv")]
    np.savetxt(files[0], rows, "%.17g", ",", header=",".join(["time", *columns]), comments="")
    with caplog.at_level("INFO", logger="hybridyn.assembly"):
        assert main(["idm", str(path), files[0], "-o", files[1]]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "the motors move least" in line]
    assert [told in line for line in lines] == [True] * bool(told)
    assert [record.getMessage() for record in caplog.records if record.levelname == "INFO"] == lines


@pytest.mark.parametrize("name", ["stewart_ur5", slow("lx4")])
def test_weights_multiply_the_motions_of_motors_in_the_rule(name: str) -> None:
    """The rates are the least in the weighted norm; those of a motor of large weight are small."""
    robot = build_robot(shipped(name))
    link, root = robot.modules[-1].outputs[0], robot.description.root
    still = np.zeros((1, robot.nv))
    pose = of_link(robot, robot.home[None], still, still, link, root)[0][0]
    rng = np.random.default_rng(0)
    twist, factors = rng.normal(size=6), np.exp(rng.normal(size=len(robot.motors)))
    factors[0] = 1e3
    weights = dict(zip(robot.motors, map(float, factors), strict=True))
    q, v, _ = hybridyn.assemble(robot, platforms={link: (pose, twist)}, weights=weights, guess=robot.home)
    measured = spans(robot) / factors
    close_to(v[robot.motor_v] / measured, least(robot, q, link, root, twist, measured), LEAST)
    plain = hybridyn.assemble(robot, platforms={link: (pose, twist)}, guess=robot.home)[1]
    assert abs(v[robot.motor_v[0]]) < 1e-3 * abs(plain[robot.motor_v[0]])


def test_held_joints_stay_where_the_guess_has_them(tmp_path: Path) -> None:
    robot = hybridyn.load(excavator(tmp_path))
    start = hybridyn.assemble(robot, motors=dict(zip(MOTORS, (0.1, -0.05, 0.02), strict=True)))[0]
    still = np.zeros((1, robot.nv))
    x, _, z = of_link(robot, start[None], still, still, "teeth", robot.description.root)[0][0, :3]
    way = {"teeth": ({"x": x + np.linspace(0, 0.2, 5), "z": z + np.linspace(0, -0.1, 5)},)}
    held = hybridyn.assemble(robot, platforms=way, guess=start, hold=["stick_rod"])
    given = hybridyn.assemble(robot, platforms=way, guess=start, motors={"stick_rod": -0.05})
    for one, other in zip(held, given, strict=True):
        close_to(one, other, REACHED)


# -------------------------------------------------------------------- wrong


@pytest.mark.slow
def test_what_is_out_of_reach_is_refused(tmp_path: Path) -> None:
    """Restarts look for another posture first."""
    robot = hybridyn.load(excavator(tmp_path))
    far, (x, z, _) = {"teeth": ({"x": 100.0, "z": 0.0},)}, teeth(HOME)
    words = "modules 'boom', 'stick', .*out of reach"
    refused(partial(hybridyn.assemble, robot, platforms=far), AssemblyError, words)
    across = {"teeth": np.array([x, 0.5, z, 0, np.sin(0.8), 0, np.cos(0.8)])}
    refused(partial(hybridyn.assemble, robot, platforms=across), AssemblyError, "contradicts another one")


@pytest.mark.parametrize(
    ("axes", "pose", "words"),
    [
        ("yyy", {"x": 3.0}, r"x of 'l2': not reached at sample 0: .* misses it by 2 m \(limit 5e-05\)"),
        ("yyy", {"distance": 2.5}, r"the distance of 'l2': not reached .* misses it by 1.5 m"),
        ("zy", dict.fromkeys(("roll", "pitch", "yaw"), 0.5), r"the orientation of 'l1': .* by 0\S+ rad \("),
        slow(
            "zyxzyzx",
            {**dict.fromkeys(("x", "y", "roll", "pitch", "yaw"), 0.1), "z": 0.2, "distance": 1.0},
            "; poses prescribe 7 numbers, of which 6 are independent",
        ),
    ],
)
def test_by_how_much_a_target_is_missed_is_told_in_its_unit(
    axes: str, pose: dict[str, float], words: str, tmp_path: Path
) -> None:
    robot = arm(tmp_path, axes)
    refused(partial(hybridyn.assemble, robot, platforms={f"l{len(axes) - 1}": (pose,)}), AssemblyError, words)


def test_what_cannot_be_met_is_refused(tmp_path: Path) -> None:
    robot, rods = hybridyn.load(excavator(tmp_path)), dict.fromkeys(MOTORS, 0.0)
    both = partial(hybridyn.assemble, robot, motors=rods, platforms={"teeth": ({"x": 5.0},)})
    refused(both, AssemblyError, "so are all motions between them; leave one out")
    across = partial(hybridyn.assemble, robot, platforms={"teeth": ({"y": 0.3},)})
    refused(across, AssemblyError, r"'stick', 'rocker', changes it \(y of 'teeth'\); leave it out")
    empty = partial(hybridyn.assemble, robot, platforms={"teeth": ({},)})
    refused(empty, TrajectoryError, "pose of 'teeth' is empty; give some of x, y")
    two = arm(tmp_path, "yyy")
    stretched = {"l2": ({"x": 1.0, "z": 0.0}, {"x": 1.0, "z": 0.0})}
    moved = partial(hybridyn.assemble, two, motors={"j2": 0.0}, platforms=stretched, guess=np.zeros(3))
    refused(moved, SingularityError, "lose a direction there")


@pytest.mark.parametrize(
    ("motors", "coordinates", "words"),
    [
        (("boom_rod", "bucket_rod"), {}, r"1 of 1 freedom of module 'stick' .*further out, such as 'rocker'"),
        (("boom_rod", "stick_rod"), {}, r"'rocker' open.*'bucket_rod', too.*links, 1 in all$"),
        (
            ("stick_rod",), {"x": (0.0, 1.0), "z": (0.0, 0.0), "y": (0.0, 1.0)},
            r"the rates of .* poses prescribe 3 numbers, and find 2 freedoms .1 of 'boom', 1 of 'rocker'.\. "
            r"y of 'teeth' is missed most",
        ),
    ],
)  # fmt: skip
def test_what_is_too_little_or_too_much_is_counted_by_module(
    tmp_path: Path, motors: tuple[str, ...], coordinates: dict[str, tuple[float, float]], words: str
) -> None:
    robot, (x, z, _) = hybridyn.load(excavator(tmp_path)), teeth(HOME)
    home = {"x": x, "y": 0.0, "z": z}
    pose = tuple({name: home[name] * (k == 0) + one[k] for name, one in coordinates.items()} for k in (0, 1))
    given = partial(
        hybridyn.assemble, robot, motors=dict.fromkeys(motors, 0.0),
        platforms={"teeth": pose} if coordinates else {},
    )  # fmt: skip
    refused(given, AssemblyError, words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"hold": ["stik_rod"]}, "unknown joint 'stik_rod' .did you mean 'stick_rod'"),
        ({"hold": ["boom_rod"]}, "'boom_rod' is held, and its position is given"),
        ({"weights": {"stik_rod": 1.0}}, "unknown motor 'stik_rod' .did you mean 'stick_rod'"),
        ({"weights": {"stick_rod": 0.0}}, "weight of 'stick_rod' is 0.0; give a positive number"),
        ({"weights": {"stick_rod": np.nan}}, "weight of 'stick_rod' is nan; give a positive number"),
    ],
)
def test_what_cannot_be_held_or_weighted_is_refused(
    tmp_path: Path, options: dict[str, object], words: str
) -> None:
    robot = hybridyn.load(excavator(tmp_path))
    given = partial(hybridyn.assemble, robot, motors={"boom_rod": 0.0}, platforms={"teeth": ({"z": 0.0},)})
    refused(partial(given, **options), TrajectoryError, words)


def test_only_what_no_motor_drives_depends_on_what_came_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Freedoms of motors need columns; what no motor drives needs its history."""
    path, table = excavator(tmp_path), tmp_path / "t.csv"
    table.write_text("time,rocker@stick/pose/pitch\n" + "".join(f"{k},0\n" for k in range(7)))
    words = ["idm", str(path), str(table), "-o", str(tmp_path / "tau.csv")]
    for motors, told in ((MOTORS, False), (MOTORS[1:], True)):
        assert main([*words, "--motors", ",".join(motors)]) == 1
        said = capsys.readouterr().err
        assert "t.csv: what is given leaves 1 of 1 freedom of module 'boom' open" in said
        assert ("depends on what came before" in said) == told
