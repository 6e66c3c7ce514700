"""The code of single calls: the same bits as a batch; on plain numbers what has no copies."""

import ctypes
import re
import time
from dataclasses import replace
from pathlib import Path

import pytest

from hybridyn.compiled.code.library_source import library_source
from hybridyn.compiled.code.scalars import Scalar, c_text
from hybridyn.compiled.library.building import find_compiler, run_one
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.program import Program
from tests.compiled.toys import cached, inputs, single, toy

SAMPLES = 5


def program_of(copies: int) -> Program:
    """Return a toy that is called like a model whose single calls matter."""
    return replace(toy(3, copies), name="idm")


@pytest.mark.parametrize(
    ("program", "kernels"),
    [(program_of(1), 4), (program_of(6), 2), (toy(3, 1), 0)],
    ids=["one", "six", "else"],
)
def test_what_has_no_copies_runs_on_plain_numbers_where_it_is_called_alone(
    program: Program, kernels: int
) -> None:
    units = library_source([program], Scalar("float64", 8)).units
    assert (
        sum(len(re.findall(r"^IN_SECTION\(\w+\) void n\w{12}\(", unit, re.M)) for unit in units.values())
        == kernels
    )


@pytest.mark.parametrize("copies", [1, 10])
@pytest.mark.parametrize(
    ("number", "lanes"), [("float64", 8), pytest.param("float32", 16, marks=pytest.mark.slow)]
)
def test_single_calls_give_the_bits_of_a_batch(
    number: str, lanes: int, copies: int, empty_cache: Path
) -> None:
    program = program_of(copies)
    source = library_source([program], Scalar(number, lanes))
    library = Library(cached("single", lambda: source))
    given = [x.astype(number) for x in inputs(program, SAMPLES)]
    parts, guard = library.batch("idm", *given)
    for t in range(SAMPLES):
        found, worst = single(library, "idm", *(x[t] for x in given))
        assert all((one == many[t]).all() for one, many in zip(found, parts, strict=True))
        assert worst == guard[t]


FETCHING = """
#define main other
{text}
#ifdef LONG_AGO
IN_SECTION(part) int code(int x) {{ return 3 * x; }}
int fetched;
#define fetch(from, to) (fetched += (const char *)(to) > (const char *)(from))
int call(void) {{
    char numbers[100];
    FETCH(part, numbers, numbers + 100);
    return fetched;
}}
#else
int call(void) {{ return -1; }}
#endif
"""


def test_code_is_fetched_after_a_while_and_not_in_a_row(tmp_path: Path) -> None:
    file, made = tmp_path / "fetching.c", tmp_path / "fetching.so"
    file.write_text(FETCHING.format(text=c_text("fetching.h")))
    run_one([*find_compiler(), "-fPIC", "-shared", str(file), "-o", str(made)])
    call = ctypes.CDLL(str(made)).call
    if call() == -1:
        pytest.skip("code is fetched on Linux with x86-64 alone")
    assert call() in (2, 4)  # the first call fetches code and numbers; the second one if this process waited
    before = call()
    time.sleep(0.01)
    assert call() == before + 2
