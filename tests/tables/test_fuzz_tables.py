"""Seeded mutations of a valid table: whatever a file holds, it is read or refused with its name."""

import random
from pathlib import Path

import numpy as np
import pytest

from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from hybridyn.tables.trajectory import full_state, read_motions
from tests.files import save
from tests.tables.arm import ARM
from tests.waiting import outcome

ROUNDS = 2_000
NASTY = [
    b"nan", b"inf", b"-inf", b"1e400", b"1e308", b"-1e-400", b"", b" ", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf",
    b'"', b'""', b"'", b"#", b";", b"\t", b"\r", b"\r\n", b"\n\n", b",", b",,", b"1_0", b"0x1", b"1,5",
    b"time", b"true", b"tool/pose/", b"/", b"@", b"tool@slider/pose/x", b"lift/effort", b"9999999999999",
    b"1e", b"--1", b"\x1b[31m", b"\xc3\xa9", b"\xef\xbc\x91", b"=1+1", b"\\n", b"%s", b"{}",
]  # fmt: skip


def valid_table(with_pose: bool) -> bytes:
    time = 0.1 * np.arange(12)
    columns = {"time": time, "lift/position": np.sin(time), "lift/velocity": np.cos(time)}
    if with_pose:
        half = 0.3 * time
        pose = {"x": 0 * time, "y": 0 * time, "z": time, "qx": 0 * time, "qy": 0 * time}
        pose |= {"qz": np.sin(half), "qw": np.cos(half)}
        columns |= {f"tool/pose/{name}": values for name, values in pose.items()}
        columns |= {f"tool/wrench/{name}": time for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    else:
        columns |= {"spin/position": time**2}
    rows = np.column_stack(list(columns.values())).tolist()
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]).encode()


def mutated(content: bytes, draw: random.Random) -> bytes:
    for _ in range(draw.choice([1, 1, 1, 2, 5])):
        at, length = draw.randrange(len(content) + 1), draw.choice([0, 1, 1, 3, 20])
        cells = content.split(b",")
        cell = draw.randrange(len(cells))
        content = draw.choice(
            [
                content[:at] + draw.choice(NASTY) + content[at + length :],
                content[:at] + bytes([draw.randrange(256)]) + content[at + 1 :],
                content[:at],
                content[:at] + content[at : at + length] * draw.choice([2, 50]) + content[at + length :],
                b",".join([*cells[:cell], draw.choice(NASTY), *cells[cell + 1 :]]),
                b",".join([*cells[:cell], *cells[cell + 1 :]]),
                content.replace(b",", b";"),
                content.replace(b".", b","),
            ]
        )
    return content


def use(path: Path) -> None:
    """Read a table to the end, and check that what comes out is finite."""
    with open_table(path, block_rows=5) as table:
        layout = read_layout(table.columns, ARM, motors=("lift", "spin"), file=table.file)
        for motion in read_motions(table, layout):
            for triple in [*motion.joints.values(), *motion.platforms.values()]:
                for level in triple:
                    for numbers in level.values() if isinstance(level, dict) else [level]:
                        assert np.isfinite(numbers).all()
            if layout.full_state:
                assert all(np.isfinite(numbers).all() for numbers in full_state(motion, ARM.joints))


@pytest.mark.parametrize("with_pose", [False, True])
def test_a_mutated_table_is_read_or_refused(tmp_path: Path, with_pose: bool) -> None:
    content = valid_table(with_pose)
    path = save(tmp_path, content, "t.csv")
    use(path)
    draw = random.Random(20_10)
    read = 0
    for _ in range(ROUNDS // 2):
        path.write_bytes(mutated(content, draw))
        _, message = outcome(str(path), lambda: use(path))
        read += not message
        assert not message or (str(path) in message and message.isprintable()), message
    assert 0.02 * ROUNDS < read < 0.4 * ROUNDS  # most are refused, harmless ones are not
