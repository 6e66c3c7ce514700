"""Calls of built programs: the same bits however a sample is computed."""

import dataclasses
import os
import re
import signal
import sys
from collections.abc import Iterable
from functools import cache

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code import drivers
from hybridyn.compiled.code.rules import check
from hybridyn.compiled.library.calls import BLOCK, Library, load
from hybridyn.compiled.library.direct_calls import REFUSED
from hybridyn.compiled.program import (
    Add,
    Call,
    Constants,
    GivenPlace,
    Kernel,
    Own,
    Program,
    ResultPlace,
    Shared,
)
from hybridyn.compiled.programs.whole_robot import function_of
from tests.compiled.toys import inputs, single, toy
from tests.support.comparing import refused, same_bits
from tests.support.samples import some

ROUNDING = 1e-12  # some hundred operations on numbers around one, some of them quotients

COPIES = (1, 2, 3, 5, 6, 8, 9, 16, 17, 6, 6, 24)
NAMES = [f"toy{seed}_{copies}" for seed, copies in enumerate(COPIES)]
#: One copy, fewer than lanes, and two rounds of lanes and one more.
FEW = ("toy0_1", "toy4_6", "toy8_17")
CASES = some(NAMES, FEW)


@cache
def program_of(seed: int) -> Program:
    """Return a program; the first one has the name of a model, which called alone runs on plain numbers."""
    program = toy(seed, COPIES[seed])
    return program if seed else dataclasses.replace(program, name="idm")


def loaded(names: Iterable[str]) -> Library:
    """Return some programs; in batches, their legs add sums in place, however few they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drivers, "SUMMED", 0.0)
        assert drivers.summed(program_of(4)) == {0: {1}}
        return load([program_of(NAMES.index(name)) for name in names])


@pytest.fixture(scope="module")
def library() -> Library:
    return loaded(FEW)


@pytest.fixture(scope="module")
def others() -> Library:
    return loaded(name for name in NAMES if name not in FEW)


Case = tuple[Library, Program]


@pytest.fixture
def case(request: pytest.FixtureRequest) -> Case:
    """Return a library, and one of its programs."""
    library = request.getfixturevalue("library" if request.param in FEW else "others")
    return library, program_of(NAMES.index(request.param))


@pytest.mark.parametrize("case", CASES, indirect=True)
def test_results_are_casadis(case: Case) -> None:
    library, program = case
    q, v = inputs(program, 20)
    outputs, guard = library.batch(program.name, q, v)
    *wanted, worst = (np.array(x).T for x in function_of(program).map(20)(q.T, v.T))
    for output, reference in zip(outputs, wanted, strict=True):
        np.testing.assert_allclose(output, reference, rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(guard, worst[:, 0], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("case", CASES, indirect=True)
def test_a_sample_has_the_same_bits_alone_and_in_any_batch(case: Case) -> None:
    library, program = case
    q, v = inputs(program, 37)
    (a, b), guard = library.batch(program.name, q, v)
    for size in (1, 2, 7, 8, 9, 31):
        some = library.batch(program.name, q[-size:], v[-size:])
        same_bits(some, ((a[-size:], b[-size:]), guard[-size:]))
    for t in range(37):
        same_bits(single(library, program.name, q[t], v[t]), ((a[t], b[t]), guard[t]))


def test_bits_do_not_depend_on_threads_or_lanes(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    program = program_of(4)
    monkeypatch.setattr(library.programs[program.name], "block", BLOCK)
    q, v = inputs(program, 3 * BLOCK + 5)
    wanted = library.batch(program.name, q, v)
    for threads in (2, 3):
        same_bits(library.batch(program.name, q, v, threads=threads), wanted)
    for lanes in (1, 4):
        same_bits(load([program], lanes=lanes).batch(program.name, q, v), wanted)


def test_the_other_samples_of_a_block_do_not_matter(library: Library) -> None:
    """NaN, infinity and large numbers beside it leave a sample as it is; its own spoil the guard."""
    program = program_of(4)
    q, v = inputs(program, 16)
    (a, _), _ = library.batch(program.name, q, v)
    rough = q.copy()
    rough[1], rough[3], rough[6], rough[9] = np.nan, np.inf, 1e9, 1e300
    (a2, _), guard = library.batch(program.name, rough, v)
    same = [t for t in range(16) if t not in (1, 3, 6, 9)]
    same_bits(a2[same], a[same])
    assert np.isnan(guard[[1, 3]]).all()
    for k in range(q.shape[1]):
        bad = np.where(np.arange(q.shape[1]) == k, np.nan, q[0])
        assert np.isnan(single(library, program.name, bad, v[0])[1])


def test_arrays_of_every_layout_are_taken(library: Library) -> None:
    program = program_of(4)
    q, v = inputs(program, 10)
    (a, _), _ = library.batch(program.name, q, v)
    same_bits(library.batch(program.name, np.asfortranarray(q), v[::-1][::-1])[0][0], a)
    read_only = q[0].copy()
    read_only.flags.writeable = False
    for one in (np.stack([q[0], 0 * q[0]], axis=1)[:, 0], read_only, q[0].astype(">f8"), q[0].tolist()):
        same_bits(library.batch(program.name, [one], [v[0].tolist()])[0][0][0], a[0])


def test_a_batch_of_one_runs_as_a_single_call(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    program = program_of(0)
    calls = library.programs[program.name]
    q, v = inputs(program, 40)
    (a, b), guard = library.batch(program.name, q, v)
    trusted = int(np.argmin(guard))
    assert guard[trusted] <= calls.trusted
    monkeypatch.setattr(calls, "_batch", None)
    at = slice(trusted, trusted + 1)
    same_bits(library.batch(program.name, q[at], v[at]), ((a[at], b[at]), guard[at]))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")  # which is tested
def test_a_forked_process_has_threads_of_its_own(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    program = program_of(0)
    monkeypatch.setattr(library.programs[program.name], "block", BLOCK)
    given = inputs(program, 3 * BLOCK)
    (a, _), _ = library.batch(program.name, *given, threads=2)
    child = os.fork()
    if not child:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(20)  # a child that waits for its parent's threads ends here
        status = 1
        try:
            (again, _), _ = library.batch(program.name, *given, threads=2)
            status = int((again != a).any())
        finally:
            os._exit(status)
    assert os.waitpid(child, 0)[1] == 0


def test_no_samples_give_no_results(library: Library) -> None:
    program = program_of(4)
    q, v = inputs(program, 0)
    (a, b), guard = library.batch(program.name, q, v)
    assert (a.shape, b.shape, guard.shape) == ((0, 12), (0, 6), (0,))


def test_wrong_shapes_are_refused(library: Library) -> None:
    program = program_of(4)
    q, v = inputs(program, 3)
    for given, words in (
        ((q[:, 1:], v), "q has shape (3, 17)"),
        ((q, np.zeros((3, 2))), "v has shape (3, 2)"),
    ):
        refused(lambda given=given: library.batch(program.name, *given), ValueError, re.escape(words))


def _with(program, number: int, **changes):
    steps = list(program.steps)
    steps[number] = dataclasses.replace(steps[number], **changes)
    return dataclasses.replace(program, steps=tuple(steps))


def test_programs_that_would_mean_two_things_are_refused() -> None:
    program = toy(4, 6)
    legs = program.steps[3]
    check(program)
    moved = _with(program, 5, sources=(Own(3, 3), *program.steps[5].sources[1:]))
    for call, words in (
        (
            lambda: check(_with(program, 3, sources=(*legs.sources[:2], Shared(2, 2)))),
            "reads what its copies add up",
        ),
        (
            lambda: check(_with(program, 3, targets=(legs.targets[0], Shared(2, 2), *legs.targets[2:]))),
            "writes shared numbers from 6 copies",
        ),
        (lambda: check(dataclasses.replace(moved, own=program.own + 3)), "otherwise than they were written"),
        (lambda: check(dataclasses.replace(program, steps=program.steps[:-1])), "never written"),
        (
            lambda: check(
                _with(program, 3, sources=(GivenPlace(np.zeros((6, 2), dtype=int)), *legs.sources[1:]))
            ),
            "not of shape",
        ),
        (lambda: check(dataclasses.replace(program, steps=program.steps[1:])), "not written"),
        (
            lambda: check(
                _with(program, 4, sources=(ResultPlace(np.array([[0, 1]])), *program.steps[4].sources[1:]))
            ),
            "reads a result that was not written",
        ),
        (lambda: check(dataclasses.replace(program, shared=program.shared - 1)), "shared has no numbers"),
        (lambda: check(_with(program, 3, targets=(*legs.targets, Add(2, 2)))), "takes 3 inputs"),
    ):
        refused(call, ValueError, words)


def test_an_empty_block_of_own_numbers_takes_no_room() -> None:
    """It begins where another block begins, before and after this one is written."""
    program, empty = toy(4, 6), Own(0, 0)
    nothing = Kernel("nothing", ca.Function("nothing", [ca.SX.sym("x", 0)], [ca.SX(0, 1)]), "legs")
    writes, reads = Call(4, 6, (Constants(np.ones((6, 0))),), (empty,)), Call(4, 6, (empty,), (empty,))
    kernels = (*program.kernels, nothing)
    for first, second in ((3, 4), (4, 4)):
        steps = (*program.steps[:first], writes, *program.steps[first:second], reads, *program.steps[second:])
        check(dataclasses.replace(program, kernels=kernels, steps=steps))


def test_a_single_call_looks_at_what_it_is_handed() -> None:
    model = hybridyn.compile(hybridyn.load("five_bar"))
    at_once = model.library.programs["idm"].at_once
    if at_once is None:
        pytest.skip("arrays look otherwise in this Python")
    q = model.robot.home
    v, out = np.zeros(model.robot.nv), np.empty(len(model.robot.motors))
    before = [sys.getrefcount(x) for x in (q, v, out)]
    assert at_once(q, v, v, out) == 0
    refused = [(q, v, v), (q, v, v, out, out), (), (q, v, None, out), (q, v, 1.0, out), (q, v, "v", out)]
    refused += [
        (q, v, v[None], out),
        (q, v[:-1], v, out),
        (q, v.astype(np.float32), v, out),
        ([*q], v, v, out),
    ]
    for handed in refused:
        assert at_once(*handed) == REFUSED
    del refused, handed
    assert before == [sys.getrefcount(x) for x in (q, v, out)]
