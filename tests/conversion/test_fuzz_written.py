"""No mutation of a file that `convert` wrote ends in a traceback or a hang."""

import random
from pathlib import Path

import pytest

from tests.conversion.judge import bodily, read_back
from tests.description.reading import outcome
from tests.robots.mechanisms import random_mechanism
from tests.robots.mutations import FLAT, TREE
from tests.support.samples import slow

CASES = 8  # per seed

KINDS = ("serial_all", "loop_universal", "gear_three", "star_five")


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", slow(".usda")])
@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 20))])
def test_mutations(ending: str, seed: int, tmp_path: Path) -> None:
    draw, file, refused = random.Random(seed), tmp_path / f"robot{ending}", 0
    read_back(bodily(random_mechanism(3, kind=KINDS[seed % len(KINDS)])), file)
    text = file.read_text()
    for _ in range(CASES):
        changed = draw.choice(FLAT if ending == ".usda" else TREE)(text, draw)
        file.write_bytes(changed)
        refused += outcome(file, changed) is None
    assert refused
