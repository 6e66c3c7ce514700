"""Every attribute that MuJoCo's own schema has: what changes MuJoCo's motion is read, refused or noted."""

import random
import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from hybridyn.description import read
from tests.description.test_engine_words import outcome
from tests.robots.mjcf_texts import mjcf
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

pytestmark = pytest.mark.filterwarnings("ignore")

ROBOT = mjcf(
    """<tendon><fixed name="t1"><joint joint="a1" coef="1"/><joint joint="c1" coef="2"/></fixed>
<fixed name="t2"><joint joint="c2" coef="1"/></fixed></tendon>
<equality><connect name="e1" body1="b" body2="c" anchor=".1 0 .1"/><weld name="e2" site1="sb" site2="sd"/>
<joint name="e3" joint1="c2" joint2="a1"/><tendon name="e4" tendon1="t1" tendon2="t2"/></equality>
<actuator><motor name="m1" joint="a1" gear="2"/></actuator>""",
    world="""<body name="a" pos="0 0 .5"><inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/>
<joint name="a1" axis="0 1 0" damping=".1" armature=".01" stiffness="2" frictionloss=".1"/>
<body name="b" pos=".3 0 0"><joint name="b1" axis="0 1 0"/><geom name="gb" type="capsule" size=".05 .1"/>
<site name="sb" pos=".1 0 .2"/></body></body>
<body name="c" pos="1 0 .5"><joint name="c1" axis="0 1 0"/><joint name="c2" type="slide" axis="1 0 0"/>
<geom name="gc" type="box" size=".1 .1 .2"/><body name="d" pos="0 0 .3"><joint name="d1" type="ball"/>
<geom name="gd" size=".1"/><site name="sd" pos=".1 0 .1"/></body></body>""",
)
#: Parts of a file that no motion depends on, or of which the robot above has nothing.
ASIDE = (
    "visual", "sensor", "statistic", "size", "custom", "keyframe", "extension", "deformable", "asset",
    "default", "contact",
)  # fmt: skip
#: Values of attributes; those that MuJoCo refuses are left out.
VALUES = (
    "1.7", "0.3", "0", "-5", "2", "0.3 0.2", "-5 -3", "0.3 0.4 0.5", "0.1 0.2 0.3 0.4", "0.2 0.3 0.1 0.2 0.1",
    "true", "false", "enable", "disable", "a", "b", "a1", "c1", "t1", "sb", "world", "slide", "sphere",
)  # fmt: skip


def schema(mujoco: Any) -> list[tuple[str, str]]:
    """Return the XPath of each element of MuJoCo's schema with each of its attributes."""
    out: list[tuple[str, str]] = []
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, True).splitlines():
        words = line.split()
        if found := re.match(r"( *)(\w+) \(.\)", line):
            path = [*path[: len(found[1]) // 3], found[2]]
            words = words[2:]
        in_world = path[1:2] in (["worldbody"], ["body"])
        where = f"//worldbody//{path[-1]}" if in_world else "/".join(["", *path])
        if len(path) > 1 and path[1] not in ASIDE:
            out += [(where, word) for word in words if word not in ("name", "class", "user")]
    return out


def motion(mujoco: Any, text: str) -> bytes:
    """Return what moves a model of MuJoCo: inertias, forces, and what each of its equalities holds."""
    model = mujoco.MjModel.from_xml_string(text)
    data, draw = mujoco.MjData(model), np.random.default_rng(1)
    data.qpos = model.qpos0 + 0.1 * draw.standard_normal(model.nq)
    mujoco.mj_normalizeQuat(model, data.qpos)
    data.qvel = draw.standard_normal(model.nv)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    equal = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    J = data.efc_J.reshape(-1, model.nv)
    held = [_span(J[equal & (data.efc_id == number)]) for number in range(model.neq)]
    parts = M, data.qfrc_bias, data.qfrc_passive, data.efc_frictionloss[~equal], *held
    return b"".join((np.round(part, 9) + 0.0).tobytes() for part in parts)


def _span(rows: np.ndarray) -> np.ndarray:
    """Return the projection on what the rows of an equality hold, whatever their scale."""
    _, s, Vt = np.linalg.svd(rows, full_matrices=False)
    held = Vt[s > 1e-9 * s.max(initial=1.0)]
    return held.T @ held


def lost(folder: Path, cases: list[tuple[str, str]]) -> list[tuple[str, str, str]]:
    """Return the attributes and values that change MuJoCo's motion, and that the reader passes over."""
    mujoco = needs("mjcf")
    plain, base = read(save(folder, ROBOT, "plain.xml")), motion(mujoco, ROBOT)
    out = []
    for (where, attribute), value in product(cases, VALUES):
        root = etree.fromstring(ROBOT)
        found = root.xpath(where)
        if not found:
            continue
        found[-1].set(attribute, value)
        text = etree.tostring(root, encoding="unicode")
        try:
            moves = motion(mujoco, text) != base
        except (ValueError, mujoco.FatalError):
            continue
        if moves and outcome(plain, folder / "robot.xml", text) == "silent":
            out.append((where, attribute, value))
    return out


@pytest.mark.parametrize("count", [12, slow(10_000)])
def test_what_changes_the_motion_in_mujoco_is_not_silent(count: int, tmp_path: Path) -> None:
    cases = schema(needs("mjcf"))
    assert len(cases) > 300
    chosen = random.Random(3).sample(cases, min(count, len(cases)))
    assert lost(tmp_path, [*chosen, ("/mujoco/equality/weld", "torquescale")]) == []


def test_a_weld_without_torque_holds_points(tmp_path: Path) -> None:
    needs("mjcf")
    text = ROBOT.replace("<weld ", '<weld torquescale="0" ')
    closures = {one.name: one for one in read(save(tmp_path, text, "robot.xml")).closures}
    assert closures["e2"].rotation == "free"
    assert closures["e2"].translations == (0, 1, 2)
