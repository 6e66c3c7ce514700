"""No mutation of a USD file ends in a traceback, a hang, a crash or a robot that lost a body or a loop.

Each mutated file is read, or refused with a `ModelError` of one line. A robot that is read has the bodies and
as many loops as usd-core's own parser finds in the same stage.
"""

import contextlib
import os
import random
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from hybridyn.description import Description, read
from hybridyn.description.usd import opening
from hybridyn.errors import ModelError
from tests.description import ending
from tests.description.reading import mutated, outcome, refused
from tests.extras import needs
from tests.files import save
from tests.mutations import NUMBERS, WORDS, cut, flip_bytes
from tests.samples import slow
from tests.usd_texts import DRIVE, FIVE_BAR, KINDS, at, body, joint, prim
from tests.waiting import must_end

needs("usd")
from pxr import Sdf, Tf, Usd, UsdPhysics  # noqa: E402

CASES = 20  # per seed

MORE = (
    body("g", prim("Cube", "shape", "double size = 3", schemas=("PhysicsCollisionAPI",)), at="1, 0, 0"),
    joint("Revolute", "j8", "d", "g", at(0, "1, 2, 3"), "float physxJoint:armature = .1",
          "float drive:angular:physics:maxForce = 5", "float state:angular:physics:position = 20",
          schemas=(DRIVE, "PhysicsJointStateAPI:angular", "PhysxJointAPI")),
    joint("Spherical", "j9", "g", "f", "bool physics:excludeFromArticulation = true"),
    joint("Prismatic", "k1", "g", "h", "rel physxMimicJoint:rotX:referenceJoint = </robot/j8>",
          "float physxMimicJoint:rotX:gearing = 3", schemas=("PhysxMimicJointAPI:rotX",)),
    body("h"),
    prim("PhysicsScene", "scene", "float physics:gravityMagnitude = 981"),
    'def "part" (\n references = @part.usda@\n) {\n}',
)  # fmt: skip
TEXT = KINDS.rstrip().removesuffix("}") + "\n".join(MORE) + "\n}\n"
PART = '#usda 1.0\n(\n defaultPrim = "part"\n)\ndef Xform "part" {\n' + body("i") + "\n}\n"

Mutation = Callable[[str, random.Random], bytes]


def lines(text: str, draw: random.Random) -> bytes:
    """Drop, double or move a line."""
    rows = text.split("\n")
    i = draw.randrange(len(rows))
    row = rows.pop(i)
    if draw.random() < 0.6:
        for _ in range(draw.choice([1, 2])):
            rows.insert(draw.choice([i, draw.randrange(len(rows))]), row)
    return "\n".join(rows).encode()


def replaced(pattern: str, words: list[str]) -> Mutation:
    def change(text: str, draw: random.Random) -> bytes:
        found = draw.choice(list(re.finditer(pattern, text)))
        others = [*words, draw.choice(re.findall(pattern, text))]
        return (text[: found.start()] + draw.choice(others) + text[found.end() :]).encode()

    return change


TYPES = ["Xform", "PhysicsJoint", "PhysicsFixedJoint", "PhysicsDistanceJoint", "Mesh", "Plane", "Foo", ""]
MUTATIONS: list[Mutation] = [
    flip_bytes,
    cut,
    lines,
    lines,
    replaced(r"(?<![\w.])-?\d*\.?\d+(?!\w)", [*NUMBERS, "1e39", "180", "2"]),
    replaced(r"</[\w/]+>", ["</robot>", "</robot/j1>", "</robot/g/shape>", "</x>", "<>"]),
    replaced(r"(?<=def )\w+", TYPES),
    replaced(r'(?<=")\w[\w:]+(?=")', [*WORDS, "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI", "transX"]),
    replaced(
        r"(?<=\n)(float|point3f|quatf|bool|token|rel)(?= )", ["float", "double3", "string", "token[]", "rel"]
    ),
    replaced(r"[\w:]+:[\w:]+(?= =)", ["physics:mass", "physics:localPos0", "xformOp:translate", "foo:bar"]),
]


def check(path: Path, description: Description, text: bytes) -> None:
    """Compare a robot with what usd-core's own parser finds."""
    stage = Usd.Stage.Open(str(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
        except Tf.ErrorException:  # what hybridyn leaves out
            return
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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "part.usda").write_text(PART)
    return tmp_path


def test_the_file_is_good_as_it_stands(folder: Path) -> None:
    found = outcome(save(folder, TEXT, "r.usda"), TEXT.encode(), never="ended while")
    assert found is not None
    assert (len(found.closures), len(found.couplings), found.motors) == (2, 1, ("j8",))
    check(folder / "r.usda", found, TEXT.encode())


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30))])
def test_mutations(folder: Path, seed: int) -> None:
    draw, file = random.Random(seed), folder / "r.usda"
    judge = partial(check, file)
    mutated(file, lambda: draw.choice(MUTATIONS)(TEXT, draw), CASES, judge, never="ended while")


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 20))])
def test_mutations_of_binary_files(folder: Path, seed: int) -> None:
    draw = random.Random(seed)
    (folder / "r.usda").write_text(TEXT)
    Sdf.Layer.FindOrOpen(str(folder / "r.usda")).Export(str(folder / "r.usdc"))
    good = (folder / "r.usdc").read_bytes()
    for _ in range(CASES // 2):
        raw = bytearray(good)
        for _ in range(draw.choice([1, 1, 3, 30])):
            raw[draw.randrange(len(raw))] = draw.randrange(256)
        (folder / "r.usdc").write_bytes(
            bytes(raw[: draw.choice([len(raw)] * 4 + [draw.randrange(len(raw))])])
        )
        with contextlib.suppress(ModelError), must_end(raw):
            read(folder / "r.usdc")


def test_a_file_that_ends_the_process_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = save(folder, TEXT, "r.usda")
    assert read(file).motors == ("j8",)
    monkeypatch.setattr(opening, "read_stage", ending.abort)
    refused(file, "OpenUSD ended while it read the file")
    monkeypatch.undo()
    assert read(file).motors == ("j8",)
    _, process = opening._started(os.getpid())
    os.kill(process, signal.SIGKILL)  # while it waits
    assert read(file).motors == ("j8",)


@pytest.mark.slow
def test_a_file_that_hangs_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = save(folder, TEXT, "r.usda")
    monkeypatch.setattr(opening, "read_stage", ending.hang)
    with must_end("a hang"):
        refused(file, "OpenUSD ended while it read the file")
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        read(file)
    signal.signal(signal.SIGALRM, before)
    monkeypatch.undo()
    assert read(file).motors == ("j8",)


@pytest.mark.slow
def test_a_file_that_needs_much_memory_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = save(folder, TEXT, "r.usda")
    opening._started.cache_clear()
    monkeypatch.setattr(opening, "MEMORY", 2**28)
    refused(file, "OpenUSD")
    opening._started.cache_clear()
    monkeypatch.undo()
    assert read(file).motors == ("j8",)


@pytest.mark.slow
def test_a_script_without_a_main_guard_reads_usd(folder: Path) -> None:
    """Its process does not run the script once more."""
    save(folder, FIVE_BAR, "r.usda")
    (folder / "script.py").write_text("import hybridyn\nprint(hybridyn.load('r.usda').motors)\n")
    done = subprocess.run([sys.executable, "script.py"], cwd=folder, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("('motor_left', 'motor_right')\n", "")


@pytest.mark.slow
def test_references_that_double_at_each_level_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    levels = "".join(
        f'def "l{i}" {{\n'
        + "".join(f'def "{name}" (references = </l{i + 1}>) {{}}\n' for name in "ab")
        + "}\n"
        for i in range(40)
    )
    monkeypatch.setattr(opening, "SECONDS", 1)
    file = save(folder, "#usda 1.0\n" + levels + 'def Xform "l40" {}\n', "r.usda")
    refused(file, "more than 1 s of processor time")
