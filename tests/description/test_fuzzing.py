"""Many files in forked batches: what may go wrong is told, and a share of the cases holds by default."""

import itertools
import os
import select
import signal
import time
from pathlib import Path

import pytest

from tests.conversion.judge import needs_reader
from tests.description import fuzzing
from tests.description.fuzzing import KINDS, HangError, batches
from tests.support.samples import slow
from tests.support.waiting import PATIENCE


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzzing, "BATCH", 4)


def test_every_case_is_counted(tmp_path: Path) -> None:
    tally = batches(lambda seed, folder: (seed, folder.is_dir()), range(3, 13))
    assert tally.counts == {"cases": 10, "read": sum(range(3, 13)), "refused": 10}
    assert tally.found == []


def refuse(seed: int) -> None:
    raise KeyError(f"of {seed}")


def hang_outside(seed: int) -> None:
    """Wait for what never comes, where no clock of the process runs; a file says that it does."""
    Path("waits").touch()
    time.sleep(PATIENCE)


def heard(pipe: int) -> bool:
    """Wait until a pipe has more, or the process waits for what never comes."""
    while not select.select([pipe], [], [], 0.02)[0]:
        if Path("waits").exists() and not select.select([pipe], [], [], 0.0)[0]:
            Path("waits").unlink()  # the batches after it do not wait
            return False
    return True


#: What may go wrong, and what is told of it.
FAULTS = {
    "traceback": (refuse, "KeyError: 'of 6'"),
    "failure": (lambda seed: pytest.fail("lost"), "lost"),
    "ended": (lambda seed: os._exit(0), "ended its process"),
    "killed": (lambda seed: os.kill(os.getpid(), signal.SIGKILL), "ended its process"),
    "silent": (hang_outside, "ended its process, or never ended"),
    "memory": (lambda seed: b"1" * (256 * 2**20), "takes "),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told_and_the_cases_after_it_run(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    act, words = FAULTS[name]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fuzzing, "MEMORY", 2**25)
    monkeypatch.setattr(fuzzing, "heard", heard)
    tally = batches(lambda seed, _: (1, 0) if seed != 6 else (act(seed), (1, 0))[1], range(9))
    assert [seed for seed, _ in tally.found] == [6]
    assert words in tally.found[0][1]
    assert tally.counts["cases"] == 9


def test_a_hang_is_no_error_that_a_reader_may_keep(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock of the process runs out at once."""
    monkeypatch.setattr(fuzzing, "SECONDS", 1e-3)

    def hang(seed: int, _: Path) -> tuple[int, int]:
        for _ in itertools.count():
            try:
                sum(range(1000))
            except Exception:
                continue
        return 1, 0

    tally = batches(hang, range(1))
    assert HangError.__name__ in tally.found[0][1]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [name if "usd" not in name else slow(name) for name in KINDS])
@pytest.mark.parametrize("cases", [3, slow(400)])
def test_files_of_every_kind(name: str, cases: int, tmp_path: Path) -> None:
    for ending in (".usda", ".xml", ".sdf", ".xacro"):
        needs_reader(tmp_path / f"r{ending}")
    tally = batches(KINDS[name], range(100, 100 + cases))
    assert tally.found == []
    assert tally.counts["cases"] == cases
