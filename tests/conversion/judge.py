"""Judge a robot that was written in another format and read back: the same motion, efforts and closures.

    folder, file -> read_back(description, folder / "robot.xml")
    same_robot(description, other, states)

Joints are known by their names. Poses of closure frames come from Pinocchio's tree of each robot, at open
postures too, so that every row is compared and not only those that hold.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from hybridyn import HybridRobot, assemble, ddm, idm, mass_matrix
from hybridyn.assembly.task import closure_residual
from hybridyn.conversion.convert import write
from hybridyn.conversion.request import ConversionRequest, Losses, Written
from hybridyn.conversion.target_files import MODEL, file_beside
from hybridyn.description import Closure, Description, read
from hybridyn.errors import HybridynError
from hybridyn.structure.building import build_robot
from tests.support.comparing import close_to
from tests.support.extras import needs

#: The claim of a round trip: each rotation passes through angles or a quaternion once.
SAME = 1e-12
#: The claim for USD, which states numbers in single precision (6e-8), of a robot whose matrices are solved.
SINGLE = 1e-5
#: Efforts and accelerations of a locked robot are rounding: they are compared with this [N, m/s^2, ...].
LOCKED = 1e-2
#: A link that MuJoCo has beside those of the robot.
WORLD = "world"
#: Motors of a robot of which one state is enough.
LARGE = 20

#: The extra that reads a format.
EXTRAS = {".xml": "mjcf", ".usda": "usd", ".usd": "usd"}

States = tuple[np.ndarray, np.ndarray, np.ndarray]


def states(description: Description, seed: int = 5, count: int = 2) -> States:
    """Assemble a robot with its motors near home, at random rates and accelerations."""
    robot, draw = build_robot(description), np.random.default_rng(seed)
    count = 1 if len(robot.motors) > LARGE else count  # a trajectory of many modules takes long to follow
    asked = {}
    for name in robot.motors:
        x = robot.home[robot.q_slices[robot.joints.index(name)]]
        here = np.arctan2(x[1], x[0]) if len(x) == 2 else x[0]
        asked[name] = (
            here + 0.002 * draw.normal(size=count),
            draw.normal(size=count),
            draw.normal(size=count),
        )
    return assemble(robot, motors=asked)


def bodily(description: Description) -> Description:
    """Return a robot with inertias that bodies can have: drawn ones may lack a part about some axis."""

    def with_more(inertia: np.ndarray) -> np.ndarray:
        moments = np.linalg.eigvalsh(inertia)
        lack = float(2 * moments[2] - moments.sum())
        return np.asarray(inertia + max(lack, 0.0) * 1.01 * np.eye(3))

    links = tuple(replace(link, inertia=with_more(link.inertia)) for link in description.links)
    return replace(description, links=links)


def needs_reader(file: Path) -> None:
    """Skip a test where the package that reads a file is not installed."""
    if file.suffix in EXTRAS:
        needs(EXTRAS[file.suffix])


def written(description: Description, target: Path) -> Written:
    """Write a robot, and the files beside it."""
    out = write(ConversionRequest(description, target), Losses())
    target.write_text(out.text)
    for ending, text in out.beside.items():
        file_beside(target, ending).write_text(text)
    assert set(out.beside) <= {MODEL, ".yaml"}
    return out


def read_back(description: Description, target: Path) -> tuple[Description, Written]:
    """Write a robot and read the file; skip the test where what reads it is not installed."""
    needs_reader(target)
    out = written(description, target)
    return read(target), out


def mapped(a: HybridRobot, b: HybridRobot, q: np.ndarray) -> np.ndarray:
    """Return positions of one robot as those of another with joints of the same names, shape (T, nq)."""
    out = np.zeros((len(q), b.model.nq))
    for name, kind, at in zip(a.joints, a.kinds, a.q_slices, strict=True):
        number = b.joints.index(name)
        part, other = q[:, at], b.kinds[number]
        if kind == "continuous" and other != "continuous":
            part = np.arctan2(part[:, 1:], part[:, :1])
        elif other == "continuous" and kind != "continuous":
            part = np.hstack([np.cos(part), np.sin(part)])
        out[:, b.q_slices[number]] = part
    return out


def order(a: HybridRobot, b: HybridRobot) -> list[int]:
    """Return where each rate of the second robot stands in the first."""
    return [
        column
        for name in b.joints
        for at in [a.v_slices[a.joints.index(name)]]
        for column in range(at.start, at.stop)
    ]


def same_robot(
    a: Description, b: Description, states: States, *, links: bool = True, tolerance: float = SAME
) -> None:
    """Compare two robots whose joints have the same names.

    Args:
        a: A robot.
        b: The robot as read back.
        states: Closed positions, rates and accelerations of the first, shapes (T, nq), (T, nv), (T, nv).
        links: Whether links of the same name have the same frames.
        tolerance: Difference of efforts and accelerations, relative to the largest.
    """
    one, two = build_robot(a), build_robot(b)
    q, v, acc = states
    theirs, columns = mapped(one, two, q), order(one, two)
    rounding = max(closure_residual(one, q).max(initial=0.0), 1e-13, tolerance if tolerance == SINGLE else 0)
    assert closure_residual(two, theirs).max(initial=0.0) < 10 * rounding
    for effects in ("model", None):
        mine = answer(idm, one, q, v, acc, effects=effects)
        found = answer(idm, two, theirs, v[:, columns], acc[:, columns], effects=effects)
        same_answer(found, mine, tolerance)
    tau = np.random.default_rng(7).normal(size=(len(q), len(a.motors)))
    tau *= max(np.abs(mine).max(initial=0.0), 1.0) if isinstance(mine, np.ndarray) else 1.0
    mine = answer(ddm, one, q, v, tau)
    mine = mine[:, columns] if isinstance(mine, np.ndarray) else mine
    same_answer(answer(ddm, two, theirs, v[:, columns], tau), mine, tolerance)
    same_structure(one, two, links=links, tolerance=SINGLE if tolerance == SINGLE else SAME)


def same_structure(
    one: HybridRobot, two: HybridRobot, *, links: bool = True, tolerance: float = SAME
) -> None:
    """Compare joints, motors, frames of links, closures, couplings and home."""
    assert sorted(one.joints) == sorted(two.joints)
    assert two.motors == one.motors
    same_frames(one, two, open_postures(one, 3), links=links, tolerance=tolerance)
    same_couplings(one, two, tolerance)
    ours, theirs = mapped(one, two, one.home[None])[0], two.home.copy()
    for kind, at in zip(two.kinds, two.q_slices, strict=True):
        q = slice(at.stop - 4, at.stop)
        if kind in ("spherical", "floating") and ours[q] @ theirs[q] < 0:
            theirs[q] *= -1  # a quaternion and its negative are one posture
    close_to(ours, theirs, tolerance)


def same_mass(description: Description, other: Description, tolerance: float) -> None:
    """Compare robots with different joints by their motors, and by the inertia that these feel at home."""
    one, two = build_robot(description), build_robot(other)
    assert (two.mobility, two.motors) == (one.mobility, one.motors)
    if len(one.motors) == one.mobility:
        same_answer(answer(mass_matrix, two, two.home), answer(mass_matrix, one, one.home), tolerance)


def answer(model: Callable[..., np.ndarray], *given: object, **more: object) -> np.ndarray | type:
    """Return what a model answers, or the type of its error."""
    asked = {"weights": np.ones(len(given[0].motors)), "passive": "solved"} if model is idm else {}  # type: ignore[attr-defined]
    try:
        return model(*given, **asked, **more)
    except HybridynError as error:
        return type(error)


def same_answer(theirs: np.ndarray | type, ours: np.ndarray | type, tolerance: float) -> None:
    """Compare two answers."""
    if isinstance(ours, np.ndarray) and isinstance(theirs, np.ndarray):
        scale = max(np.abs(ours).max(initial=0.0), LOCKED)
        assert np.abs(theirs - ours).max(initial=0.0) <= tolerance * scale
    else:
        assert theirs is ours


def open_postures(robot: HybridRobot, count: int) -> np.ndarray:
    """Draw postures whose loops are open, shape (count, nq)."""
    draw = np.random.default_rng(11)
    return np.array(
        [
            pin.integrate(robot.model, pin.neutral(robot.model), draw.normal(size=robot.nv))
            for _ in range(count)
        ]
    )


def same_frames(a: HybridRobot, b: HybridRobot, q: np.ndarray, *, links: bool, tolerance: float) -> None:
    """Compare frames of links, and rows and frames of the closures, by name, at open postures."""
    ours, theirs = ({c.name: c for c in robot.description.closures} for robot in (a, b))
    assert [(c.name, c.translations, c.rotation) for c in theirs.values()] == [
        (c.name, c.translations, c.rotation) for c in ours.values()
    ]
    for x, y in zip(q, mapped(a, b, q), strict=True):
        here, there = poses(a, x), poses(b, y)
        for name in (here.keys() & there.keys()) - {WORLD} if links else ():
            np.testing.assert_allclose(there[name], here[name], rtol=0, atol=tolerance)
        for name, closure in ours.items():
            for end, other in zip(ends(here, closure), ends(there, theirs[name]), strict=True):
                shift = end[:3, :3].T @ (other[:3, 3] - end[:3, 3])
                seen = list(closure.translations) if closure.rotation == "fixed" else [0, 1, 2]
                np.testing.assert_allclose(shift[seen], 0.0, rtol=0, atol=tolerance)
                axes = {"free": 0, "perpendicular": 1, "parallel": 1, "fixed": 3}[closure.rotation]
                axes = 3 if closure.translations not in ((), (0, 1, 2)) else axes
                np.testing.assert_allclose(
                    other[:3, 3 - axes : 3], end[:3, 3 - axes : 3], rtol=0, atol=tolerance
                )


def poses(robot: HybridRobot, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return the pose of each link in the world, shapes (4, 4)."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return {
        link.name: data.oMf[robot.model.getFrameId(link.name, pin.BODY)].homogeneous
        for link in robot.description.links
    }


def ends(poses: dict[str, np.ndarray], closure: Closure) -> Sequence[np.ndarray]:
    """Return both frames of a closure in the world, each (4, 4)."""
    return [poses[closure.link_a] @ closure.frame_a, poses[closure.link_b] @ closure.frame_b]


def same_couplings(a: HybridRobot, b: HybridRobot, tolerance: float) -> None:
    """Compare couplings, each divided by its largest coefficient, in any order and by any name."""

    def plain(robot: HybridRobot) -> list[dict[str, float]]:
        out = []
        for coupling in robot.description.couplings:
            largest = max((abs(factor), name, factor) for name, factor in coupling.terms)[2]
            out.append(
                {name: factor / largest for name, factor in coupling.terms} | {"": coupling.offset / largest}
            )
        return sorted(out, key=lambda terms: (sorted(terms), sorted(terms.items())))

    for ours, theirs in zip(plain(a), plain(b), strict=True):
        assert ours.keys() == theirs.keys()
        close_to(np.array([theirs[name] for name in ours]), np.array([*ours.values()]), tolerance)
