"""Drake's bushings, in URDF and SDF: as Drake computes them, as the definition says, and in compiled code."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.drake_plant import Plant
from tests.description.reading import refused
from tests.description.sdf_texts import WORLD, joint, link, sdf
from tests.robots.robot_texts import robot
from tests.support.comparing import SOLVED, close_to
from tests.support.extras import needs
from tests.support.files import save

#: Two programs that evaluate the same few formulas, and the conditioning of the mass matrix.
AGAINST_DRAKE = 1e-11
#: Central differences of fourth order over this step [s], and what they leave of the largest torque.
STEP, AGAINST_DIFFERENCES = 1e-3, 1e-8

NUMBERS = {
    "torque_stiffness": "30 20 50", "torque_damping": "3 1 2", "force_stiffness": "2000 900 600",
    "force_damping": "20 9 5",
}  # fmt: skip
FRAMES = (
    '<frame name="tip" link="coupler" xyz="1.5 0 0.1" rpy="0.1 0.2 0.3"/>'
    '<frame name="end" link="rocker" xyz="1 0.05 0" rpy="-0.2 0.4 0.1"/>'
)
BUSHING = (
    '<drake:linear_bushing_rpy><drake:bushing_frameA name="tip"/><drake:bushing_frameC name="end"/>'
    + "".join(f'<drake:bushing_{word} value="{x}"/>' for word, x in NUMBERS.items())
    + "</drake:linear_bushing_rpy>"
)
FIXED = '<joint name="hold" type="fixed"><parent link="world"/><child link="ground"/></joint>'
WITH_BUSHING = robot(FRAMES, BUSHING)
#: Links of a wrist that turn about different axes, whose tips a bushing ties; each frame is turned.
IN_SDF = sdf(
    link("base"), WORLD,
    link("a", "<pose>0.1 0 0.2 0.3 0 0</pose>"),
    link("b", "<pose>0 0.3 0 0 0.2 0.1</pose>"),
    joint("j", "revolute", "base", "a", axis="0 1 1"), joint("k", "revolute", "base", "b", axis="1 0.5 0"),
    '<frame name="f" attached_to="a"><pose relative_to="b">0.1 0.2 0.3 0.4 0.5 0.6</pose></frame>',
    "<drake:linear_bushing_rpy><drake:bushing_frameA>f</drake:bushing_frameA><drake:bushing_frameC>b"
    "</drake:bushing_frameC>" + "".join(f"<drake:bushing_{word}>{x}</drake:bushing_{word}>" for word, x in
    NUMBERS.items()) + "</drake:linear_bushing_rpy>",
    more=' xmlns:drake="http://drake.mit.edu"',
)  # fmt: skip
FILES = {"r.urdf": WITH_BUSHING, "r.sdf": IN_SDF}


def moving(found: hybridyn.HybridRobot, seed: int) -> tuple[np.ndarray, ...]:
    """Draw angles, positions, rates and efforts of hinges."""
    rng = np.random.default_rng(seed)
    angles, v, tau = (rng.uniform(-1, 1, found.nv) for _ in range(3))
    parts = [
        (np.cos(x), np.sin(x)) if kind == "continuous" else (x,)
        for kind, x in zip(found.kinds, angles, strict=True)
    ]
    return angles, np.concatenate(parts), v, tau


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("seed", range(3))
def test_a_bushing_moves_a_robot_as_in_drake(name: str, seed: int, tmp_path: Path) -> None:
    text = FILES[name].replace("</robot>", f"{FIXED}</robot>")
    file = save(tmp_path, text, name)
    found = hybridyn.load(save(tmp_path / "own", FILES[name], name))
    angles, q, v, tau = moving(found, seed)
    drake = Plant(file, re.findall(r'<(?:robot|model) name="(\w+)"', text)[0])
    order = [drake.joints[joint].velocity_start() for joint in found.joints]
    given = [np.zeros(found.nv) for _ in range(3)]
    for into, x in zip(given, (angles, v, tau), strict=True):
        into[order] = x
    theirs = drake.accelerations(*given)[order]
    ours = hybridyn.ddm(found, q, v, tau, effects=["default", "viscous_friction", "bushings"])
    close_to(ours, theirs, AGAINST_DRAKE)


def by_hand(found: hybridyn.HybridRobot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the efforts of the bushing on the freedoms, with rates of angles by differences."""
    ((_, numbers),) = found.description.effects
    ((name, links),) = numbers["ends"].items()
    ends = [pin.XYZQUATToSE3(np.array(x)) for x in numbers["frames"][name]]
    k_turn, d_turn, k_way, d_way = (np.array(numbers[word][name]) for word in NUMBERS)
    model, data, ids = (
        found.model,
        found.model.createData(),
        [found.model.getFrameId(x, pin.BODY) for x in links],
    )

    def frames(h: float) -> list[pin.SE3]:
        """Return the frames at a time from now."""
        pin.framesForwardKinematics(model, data, pin.integrate(model, q, h * v))
        return [data.oMf[i] * end for i, end in zip(ids, ends, strict=True)]

    def seen(h: float) -> tuple[np.ndarray, np.ndarray]:
        """Return roll, pitch and yaw of C in A, and the way from A to C in A."""
        A, C = frames(h)
        return pin.rpy.matrixToRpy(A.actInv(C).rotation), A.actInv(C).translation

    weights = {1: 8.0, 2: -1.0}
    rates = [
        sum(w * (seen(n * STEP)[i] - seen(-n * STEP)[i]) for n, w in weights.items()) / 12 / STEP
        for i in (0, 1)
    ]
    (rpy, way), (A, C) = seen(0.0), frames(0.0)
    jacobians = [pin.computeFrameJacobian(model, data, q, i, pin.LOCAL_WORLD_ALIGNED) for i in ids]
    spin = A.rotation.T @ (jacobians[1] - jacobians[0])[3:] @ v
    half = pin.exp3(0.5 * pin.log3(A.actInv(C).rotation))
    force = half @ -(k_way * (half.T @ way) + d_way * (half.T @ (rates[1] - 0.5 * np.cross(spin, way))))
    # The torque does the work of the torques on the angles: E times their rates is the angular velocity.
    pitch, yaw = rpy[1:]
    E = pin.rpy.rpyToMatrix(0, 0, yaw) @ [[np.cos(pitch), 0, 0], [0, 1, 0], [-np.sin(pitch), 0, 1]]
    torque = np.linalg.solve(E.T, -(k_turn * rpy + d_turn * rates[0]))
    f, t = A.rotation @ force, A.rotation @ torque
    middle, out = 0.5 * (A.translation + C.translation), np.zeros(model.nv)
    for i, J, sign in zip(ids, jacobians, (-1.0, 1.0), strict=True):
        arm = middle - data.oMf[i].translation
        out += sign * J.T @ np.concatenate([f, t + np.cross(arm, f)])
    return out


@pytest.mark.parametrize("name", FILES)
def test_a_bushing_exerts_what_its_definition_says(name: str, tmp_path: Path) -> None:
    found = hybridyn.load(save(tmp_path, FILES[name], name))
    assert found.motors == found.joints
    for seed in range(4):
        _, q, v, rest = moving(found, seed)
        felt = hybridyn.idm(found, q, v, rest) - hybridyn.idm(
            found, q, v, rest, effects=["default", "bushings"]
        )
        close_to(felt, by_hand(found, q, v), AGAINST_DIFFERENCES)


@pytest.mark.parametrize("name", FILES)
def test_a_loop_that_a_bushing_closes_is_open_and_said_to_be(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, FILES[name], name)
    found = read(file)
    assert found.closures == ()
    (note,) = [note for note in found.notes if "bushing" in note]
    line = FILES[name][: FILES[name].index("<drake:linear")].count("\n") + 1
    assert note.startswith(f"{file}:{line}: ")
    assert "closes no loop" in note
    assert "effects='model'" in note
    with pytest.raises(hybridyn.ModelError, match="closes no loop"):
        hybridyn.load(file, strict=True)


@pytest.mark.slow
def test_bushings_are_compiled_and_simulated(tmp_path: Path) -> None:
    needs("compiled")
    found = hybridyn.load(save(tmp_path, WITH_BUSHING))
    _, q, v, tau = moving(found, 5)
    compiled = hybridyn.compile(found, "model")
    ours, theirs = compiled.ddm(q, v, tau), hybridyn.ddm(found, q, v, tau, effects="model")
    close_to(ours, theirs, SOLVED)
    runs = [
        hybridyn.simulate(found, q, v, (0.0, 1e-2), effects="model", method="rk4", step=1e-3, compiled=model)
        for model in (None, compiled)
    ]
    assert compiled.recomputed == 0
    close_to(runs[1].q[-1], runs[0].q[-1], SOLVED)


REFUSED = [
    (WITH_BUSHING.replace('"tip"/><drake', '"tpi"/><drake'), "unknown frame 'tpi' (did you mean 'tip'?)"),
    (WITH_BUSHING.replace('frameC name="end"', 'frameC name="coupler"'), "both frames are on link 'coupler'"),
    (WITH_BUSHING.replace("2000 900 600", "2000 -900 600"), "-900 is negative"),
    (WITH_BUSHING.replace("2000 900 600", "2000 900"), "2 numbers instead of 3"),
    (
        re.sub("<drake:bushing_force_damping[^>]*>", "", WITH_BUSHING),
        "<drake:bushing_force_damping> is missing",
    ),
    (WITH_BUSHING.replace("force_damping", "force_dampnig"), "did you mean 'drake:bushing_force_damping'?"),
    (WITH_BUSHING.replace('link="rocker" xyz', 'link="roker" xyz'), "unknown frame 'roker'"),
]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_no_bushing_is_refused(text: str, words: str, tmp_path: Path) -> None:
    refused(save(tmp_path, text), words)


def test_a_model_file_states_bushings(tmp_path: Path) -> None:
    file = save(tmp_path, robot())
    (tmp_path / "four_bar.model.toml").write_text(
        '[effects.bushings]\nends = { mount = ["coupler", "rocker"] }\n'
        "force_stiffness = { mount = [2000, 900, 600] }\n"
    )
    found = hybridyn.load(file)
    ((name, numbers),) = found.description.effects
    assert (name, numbers["ends"]) == ("bushings", {"mount": ["coupler", "rocker"]})
    _, q, v, tau = moving(found, 1)
    assert not np.allclose(hybridyn.ddm(found, q, v, tau, effects="model"), hybridyn.ddm(found, q, v, tau))
