"""Compiled robots: the general path's numbers, its errors, and its help where a model must not be trusted."""

import dataclasses
import logging
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
import hybridyn.effects
from hybridyn.compiled.compiling import is_built
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.failures import difference
from hybridyn.compiled.library.calls import BLOCK
from hybridyn.compiled.library.calls import in_blocks as run_in_blocks
from hybridyn.compiled.programs.sources import robot_key
from hybridyn.compiled.verifying import MODEL_AGREES, verify
from hybridyn.effects.choice import choose
from tests.robots.robot_texts import door, save
from tests.support.comparing import refused, same_bits, same_words
from tests.support.engines import General
from tests.support.samples import slow

Arrays = tuple[Any, Any, Any, Any]


@pytest.fixture(scope="module", params=["five_bar", slow("rps3"), slow("lx4")])
def model(request: pytest.FixtureRequest) -> hybridyn.CompiledRobot:
    return hybridyn.compile(hybridyn.load(request.param))


@pytest.fixture(scope="module")
def states(model: hybridyn.CompiledRobot) -> Arrays:
    return random_states(model.robot, 40, seed=5)


def test_one_sample_has_the_bits_of_the_batch(
    model: hybridyn.CompiledRobot, states: Arrays, monkeypatch: pytest.MonkeyPatch
) -> None:
    q, v, a, tau = states
    efforts, accelerations = model.idm(q, v, a), model.ddm(q, v, tau)
    times = 2 * model.library.programs["ddm"].block // len(q)  # more than one block
    used: list[int] = []

    def in_blocks(run: Any, samples: int, block: int, threads: int) -> None:
        used.append(threads)
        run_in_blocks(run, samples, block, threads)

    model.threads = 2
    monkeypatch.setattr("hybridyn.compiled.library.calls.in_blocks", in_blocks)
    many = model.ddm(*(np.tile(x, (times, 1)) for x in (q, v, tau)))
    assert used == [model.threads] == [2]
    model.threads = 1
    same_bits(many, np.tile(accelerations, (times, 1)))
    for t in range(10):
        same_bits(model.idm(q[t], v[t], a[t]), efforts[t])
        same_bits(model.ddm(q[t].tolist(), v[t], tau[t]), accelerations[t])


def test_small_models_wake_threads_for_many_samples_only() -> None:
    assert hybridyn.compile(hybridyn.load("five_bar")).library.programs["ddm"].block > 8 * BLOCK


@pytest.mark.parametrize("base", ["moving", slow("floating")])
def test_other_bases(base: Any, by: str) -> None:
    robot = hybridyn.load("five_bar", base=base)
    model = hybridyn.compile(robot, wait=by == "c")
    q, v, _, tau = random_states(robot, 10, seed=3)
    acceleration = np.random.default_rng(1).normal(size=(10, 6))
    for given in (None, acceleration, acceleration[3])[: 3 if base == "moving" else 1]:
        found, wanted = (on.ddm(q, v, tau, base_acceleration=given) for on in (model, General(robot)))
        assert (difference(found, wanted) <= MODEL_AGREES["float64"]).all()
        one = given if np.ndim(given) < 2 else given[3]
        same_bits(model.ddm(q[3], v[3], tau[3], base_acceleration=one), found[3])


def test_only_doubtful_samples_are_computed_again(
    model: hybridyn.CompiledRobot,
    states: Arrays,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    q, v, _, tau = states
    before = model.recomputed
    _, guard = model.library.batch("ddm", q, v, tau)
    doubtful = np.flatnonzero(guard > np.median(guard))
    monkeypatch.setattr(model.library.programs["ddm"], "trusted", float(np.median(guard)))
    with caplog.at_level(logging.INFO, logger="hybridyn.compiled"):
        mixed = model.ddm(q, v, tau)
    assert 0 < len(doubtful) < len(q)
    assert model.recomputed == before + len(doubtful)
    assert f"{len(doubtful)} of {len(q)} samples computed by the general path" in caplog.text
    assert (mixed[doubtful] == hybridyn.ddm(model.robot, q[doubtful], v[doubtful], tau[doubtful])).all()


def test_a_sample_past_the_guard_is_the_general_paths_alone_too(
    model: hybridyn.CompiledRobot, states: Arrays
) -> None:
    """Closures open by more than rounding, and less than the general path refuses."""
    q, v, _, tau = (x[:3].copy() for x in states)
    q[1, -1] += 1e-9
    before = model.recomputed
    one, many = model.ddm(q[1], v[1], tau[1]), model.ddm(q, v, tau)
    assert model.recomputed == before + 2
    assert (one == many[1]).all()
    assert (one == hybridyn.ddm(model.robot, q[1], v[1], tau[1])).all()


def test_a_model_that_differs_is_refused(
    model: hybridyn.CompiledRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One part in 1e9 too much in one entry, and nobody gets the model."""
    verify(model.library, model.robot, model.effects)
    right = model.library.batch

    def wrong(name: str, *given: Any) -> Any:
        (out, *more), guard = right(name, *given)
        if name == "ddm":
            worst = np.unravel_index(np.abs(out).argmax(), out.shape)
            out[worst] *= factor
        return (out, *more), guard

    monkeypatch.setattr(model.library, "batch", wrong)
    for factor, by in ((1 + 1e-9, "1e-09"), (np.nan, "nan")):  # noqa: B007
        words = f"'ddm' of the robot .* differs from the general path by {by}"
        refused(lambda: verify(model.library, model.robot, model.effects), hybridyn.CompileError, words)


def test_a_wrong_program_never_reaches_the_user(
    tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import hybridyn.compiled.programs.whole_robot as file

    robot, right = hybridyn.load(save(tmp_path, door(1), "door.urdf")), file.programs

    def wrong(robot: hybridyn.HybridRobot, effects: Any, **more: Any) -> Any:
        lighter = dataclasses.replace(robot, gravity=robot.gravity * (1 + 1e-8))
        return right(lighter, effects, **more | {"models": ("idm", "ddm")})  # the others need not be built

    monkeypatch.setattr(file, "programs", wrong)
    refused(lambda: hybridyn.compile(robot), hybridyn.CompileError, "it is not used")
    assert not is_built(robot, choose(robot, None))  # for the next program


def test_floats_agree_to_their_digits() -> None:
    robot = hybridyn.load("five_bar")
    model = hybridyn.compile(robot, dtype="float32")
    q, v, a, tau = random_states(robot, 30, seed=3)
    result = model.ddm(q, v, tau)
    assert result.dtype == np.float32
    assert (difference(result, a) <= MODEL_AGREES["float32"]).all()
    assert model.recomputed < 30
    assert (model.ddm(q[2], v[2], tau[2]) == result[2]).all()


def test_the_casadi_functions_are_the_models() -> None:
    robot = hybridyn.load("five_bar")
    functions = hybridyn.compile(robot).casadi
    q, v, a, tau = random_states(robot, 3, seed=3)
    assert functions["ddm"].name_in() == ["q", "v", "tau"]
    result = np.array(functions["ddm"](q[0], v[0], tau[0])[0])[:, 0]
    assert (difference(result[None], a[:1]) <= MODEL_AGREES["float64"]).all()


def test_what_cannot_be_written_out_says_so() -> None:
    robot = hybridyn.load("five_bar")
    for call, words in (
        (lambda: hybridyn.compile(robot, dtype="float16"), "dtype"),
        (lambda: hybridyn.compile(robot, threads=0), "threads"),
    ):
        refused(call, hybridyn.ModelError, words)
    refused(lambda: hybridyn.compile(robot, effects="none"), hybridyn.HybridynError, "")


def test_keys_tell_robots_apart(tmp_path: Path) -> None:
    """What changes a number changes the key; reading the files again, or from elsewhere, does not."""
    on = hybridyn.load("five_bar")
    default = choose(on, None)
    assert robot_key(on, default) == robot_key(hybridyn.load("five_bar"), default)
    texts = [folder.joinpath("r.urdf") for folder in (tmp_path, tmp_path / "elsewhere")]
    texts[1].parent.mkdir()
    for path in texts:
        path.write_text(door(1))
    here, there = map(hybridyn.load, texts)
    assert robot_key(here, None) == robot_key(there, None)
    keys = {
        robot_key(robot, default)
        for robot in (
            on,
            hybridyn.load("five_bar", gravity=(0, 0, -9.8)),
            hybridyn.load("five_bar", base="floating"),
            hybridyn.load("delta"),
        )
    }
    assert len(keys) == 4


def test_effort_limits_hold() -> None:
    """They are no part of the C: efforts are clipped before it, and checked after it."""
    robot = hybridyn.load("five_bar")
    q, v, a, tau = random_states(robot, 20, seed=3)
    bound = float(np.median(np.abs(tau)))
    effects = ["default", hybridyn.effects.Limits(dict.fromkeys(robot.motors, bound))]
    model = hybridyn.compile(robot, effects)
    wanted = hybridyn.ddm(robot, q, v, tau, effects=effects)
    assert (difference(model.ddm(q, v, tau), wanted) <= MODEL_AGREES["float64"]).all()
    assert (model.ddm(q[4], v[4], tau[4]) == model.ddm(q, v, tau)[4]).all()
    same_words(lambda: model.idm(q, v, a), lambda: hybridyn.idm(robot, q, v, a, effects=effects))


def test_a_model_travels_to_another_process(model: hybridyn.CompiledRobot, states: Arrays) -> None:
    import pickle

    q, v, _, tau = states
    again = pickle.loads(pickle.dumps(model))
    assert (again.ddm(q, v, tau) == model.ddm(q, v, tau)).all()


def test_simulations_refuse_models_of_something_else(model: hybridyn.CompiledRobot, states: Arrays) -> None:
    q, v, _, tau = states
    options = {"effort": tau[0] * 0.1, "method": "rk4", "step": 1e-3}
    for other, words in (
        ({"effects": "model"}, "other effects"),
        ({"wrenches": {"m4_platform": np.zeros(6)}}, "take no wrenches"),
    ):
        refused(
            partial(
                hybridyn.simulate, model.robot, q[0], v[0], [0, 1e-3], compiled=model, **options, **other
            ),
            hybridyn.ModelError,
            words,
        )
    refused(
        lambda: hybridyn.simulate(hybridyn.load("delta"), q[0], v[0], [0, 1e-3], compiled=model, **options),
        hybridyn.ModelError,
        "another robot",
    )
