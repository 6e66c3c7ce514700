"""No mutation of a robot's files ends in a traceback, a hang or a robot that lost a body, a joint or a loop.

Seeded mutations of valid files of every format. Each is read, or refused with a `ModelError` of one line.
A robot that is read has what still stands in its text, by another parser where there is one: MuJoCo's model
of the same file, and what usd-core finds in the same stage. It has no number that is not finite.
"""

import random
import re
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from lxml import etree

from hybridyn.description import Description, read
from tests.conversion.judge import needs_reader
from tests.description import fuzz_texts as texts
from tests.description.reading import finite, outcome, save_all
from tests.robots.mutations import FLAT, TREE, USDA, Mutation
from tests.robots.robot_texts import LOOP, robot
from tests.support.extras import needs
from tests.support.samples import slow

#: Judges a robot by its file and the text that was broken; False where it cannot.
Judge = Callable[[Path, Description, bytes], object]


def of_urdf(path: Path, found: Description, text: bytes) -> None:
    """Check that a robot has all its loops."""
    plain = re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL)
    closures = len(re.findall(rb"<(?:loop|loop_joint)\b", plain))
    plain, blocks = re.subn(rb"(?s)<gazebo><joint.*?</gazebo>", b"", plain)
    closures += blocks
    closures += all(b'"closing_tip_%d"' % end in plain for end in (1, 2))
    couplings = len(re.findall(rb"<(?:coupling|mimic)\b", plain))
    idle = sum("<mimic> has no effect" in note for note in found.notes)
    assert len(found.closures) >= closures, text
    assert len(found.couplings) + idle >= couplings, text
    assert len(found.joints) >= len(re.findall(rb"<joint\b[^<>]*\btype=", plain)), text


def beside_urdf(path: Path, found: Description, text: bytes) -> None:
    """Check that a robot has all its loops, those of the file beside it included."""
    of_urdf(path, found, path.read_bytes())
    if re.search(rb"^closed_loop: \[\[.+\]\]$", text, re.MULTILINE):
        assert len(found.closures) == 2, text
    told = any("names no link of this robot" in note for note in found.notes)
    if re.search(rb"^  - cut_joint|^(closures|ball_loops):\n- ", text, re.MULTILINE) and not told:
        assert len(found.closures) == 1, text


def of_mjcf(path: Path, found: Description, text: bytes) -> object:
    """Compare a robot with MuJoCo's model of its file; False where that refuses what hybridyn leaves out."""
    mujoco = needs("mjcf")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return False
    inactive = sum('active="false"' in note for note in found.notes)
    assert len(found.closures) + len(found.couplings) + inactive == model.neq, text
    movable = sum(joint.kind != "fixed" for joint in found.joints)
    assert movable + (found.base == "floating") == model.njnt, text
    ours, theirs = sorted(link.mass for link in found.links if link.mass), model.body_mass
    if not any("do not move" in note for note in found.notes):
        np.testing.assert_allclose(ours, sorted(mass for mass in theirs if mass), err_msg=str(text))
    return True


def of_sdf(path: Path, found: Description, text: bytes) -> None:
    """Compare a robot with the names and masses that stand in its text."""
    root = etree.fromstring(text)
    links = [node.get("name").strip() for node in root.iter("link")]
    joints = [node for node in root.iter("joint") if node.find("parent") is not None]
    names = {link.name.rpartition("::")[2] for link in found.links}
    known = {joint.name for joint in found.joints} | {closure.name for closure in found.closures}
    parts = {name.rpartition("::")[2] for name in known}
    if len(root.findall("model")) == 1:  # else the other model is static, and said to be left out
        assert set(links) <= names, text
        for node in joints:
            name = node.get("name").strip()
            ground = node.find("parent").text.strip() == "world" and found.root != "world"
            assert name in parts or f"{name}_1" in parts or f"{name}_closure" in parts or ground, text
        mimics = sum(1 for _ in root.iter("mimic"))
        gears = sum(node.get("type", "").strip() in ("screw", "gearbox") for node in joints)
        assert mimics <= len(found.couplings) <= mimics + gears, text
    for one in found.joints:
        assert abs(np.linalg.norm(one.axis) - 1) < 1e-12, text


def of_usd(path: Path, description: Description, text: bytes) -> object:
    """Compare a robot with what usd-core's own parser finds; False where it fails."""
    needs("usd")
    from pxr import Tf, Usd, UsdPhysics

    stage = Usd.Stage.Open(str(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
        except Tf.ErrorException:  # what hybridyn leaves out
            return False
    bodies: set[str] = set()
    joints: list[tuple[str, str]] = []
    unread = " ".join(description.notes)
    for paths, records in found.values():
        for place, record in zip(paths, records, strict=True):
            if isinstance(record, UsdPhysics.RigidBodyDesc):
                bodies |= {str(place)} if record.rigidBodyEnabled and not record.kinematicBody else set()
            elif isinstance(record, UsdPhysics.JointDesc):
                words = ("has physics:jointEnabled", "locks no")
                noted = any(f"<{place}> {word}" in unread for word in words)
                joints += [] if noted else [(str(record.body0), str(record.body1))]
    links = [link for link in description.links if not link.between_joints and link.name != "world"]
    assert len(links) == len(bodies), text
    above = {path: path for path in ("", *bodies)}

    def top(path: str) -> str:
        path = path if path in above else ""
        return path if above[path] == path else top(above[path])

    loops = 0
    for one, other in joints:
        first, second = top(one), top(other)
        loops += first == second
        above[max(first, second)] = min(first, second)
    assert len(description.closures) == loops, text
    return True


class Case(NamedTuple):
    """A robot whose files are broken.

    Attributes:
        files: The texts of its files, of which the first is the robot's.
        name: The file that is broken.
        counts: Numbers of closures and of couplings of the robot as it stands.
        judge: Judges a robot that is read.
        mutations: How the file is broken.
        seeds: Number of seeds.
        count: Number of mutations for each seed.
        never: Words that no refusal may have.
    """

    files: dict[str, str]
    name: str
    counts: tuple[int, int]
    judge: Judge
    mutations: Sequence[Mutation] = TREE
    seeds: int = 1
    count: int = 60
    never: str | None = None


MJCF_FILES = {"r.xml": texts.MJCF, "part.obj": texts.TETRAHEDRON, "scene.xml": texts.SCENE}
OPEN = {"r.urdf": robot(texts.FRAMES, LOOP)}
OF_HYRODYN = {"r.urdf": robot(), "submechanisms.yml": texts.SUBMECHANISMS}
CASES = {
    "urdf": Case({"r.urdf": texts.URDF}, "r.urdf", (4, 2), of_urdf, seeds=3, count=120),
    "dialects": Case({"r.urdf": texts.DIALECTS}, "r.urdf", (2, 0), of_urdf, count=120),
    "side-car": Case(OPEN | {"r.yaml": texts.SIDE_CAR}, "r.yaml", (2, 0), beside_urdf, FLAT),
    "model file": Case(OPEN | {"r.model.toml": texts.MODEL}, "r.model.toml", (1, 0), beside_urdf, FLAT),
    **{
        name: Case(
            {"r.urdf": robot(), "loop_closures.yaml": text}, "loop_closures.yaml", (1, 0), beside_urdf, FLAT
        )
        for name, text in (("loop closures", texts.HINGES), ("balls of loop closures", texts.BALLS))
    },
    "submechanisms": Case(OF_HYRODYN, "submechanisms.yml", (1, 0), beside_urdf, FLAT),
    "xacro": Case({"r.urdf.xacro": texts.XACRO}, "r.urdf.xacro", (1, 0), lambda *_: None, count=10),
    "mjcf": Case(MJCF_FILES, "r.xml", (2, 2), of_mjcf, seeds=30, count=40),
    **{
        f"sdf {n}": Case({"r.sdf": text, "part.sdf": texts.ARM}, "r.sdf", counts, of_sdf, seeds=10, count=40)
        for n, (text, counts) in enumerate(zip(texts.SDF, ((1, 1), (2, 0), (2, 0)), strict=True))
    },
    "usd": Case(
        {"r.usda": texts.USD, "part.usda": texts.USD_PART}, "r.usda", (2, 1), of_usd, USDA, 30, 20,
        never="ended while",
    ),
}  # fmt: skip
#: Seeds of the default suite, where there are more.
QUICK = {"urdf": 3, "mjcf": 3}


@pytest.mark.parametrize("name", CASES)
def test_the_files_are_good_as_they_stand(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    path = save_all(tmp_path, case.files)
    needs_reader(path)
    found, text = read(path), case.files[case.name].encode()
    assert (len(found.closures), len(found.couplings)) == case.counts
    case.judge(path, found, text)
    finite(found, text)


@pytest.mark.filterwarnings("ignore")  # MuJoCo's own, of masses that differ by 20 digits
@pytest.mark.parametrize(
    ("name", "seed"),
    [
        (name, seed) if seed < QUICK.get(name, 1) else slow(name, seed)
        for name, case in CASES.items()
        for seed in range(case.seeds)
    ],
)
def test_mutations(name: str, seed: int, tmp_path: Path) -> None:
    case, draw = CASES[name], random.Random(f"{name} {seed}")
    path = save_all(tmp_path, case.files)
    needs_reader(path)
    refused = judged = 0
    for _ in range(case.count):
        text = draw.choice(case.mutations)(case.files[case.name], draw)
        (tmp_path / case.name).write_bytes(text)
        found = outcome(path, text, never=case.never)
        if found is None:
            refused += 1
            continue
        finite(found, text)
        judged += case.judge(path, found, text) is not False
    assert refused > 0 < judged, "mutations must hit, and must not hit always"
