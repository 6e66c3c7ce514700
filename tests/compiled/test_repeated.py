"""Calls for single samples in a loop: CasADi takes over, with the same results and the same refusals."""

import sys
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import repeated
from hybridyn.compiled.comparing import random_states
from hybridyn.compiled.library import current
from hybridyn.dynamics import direct, inverse
from tests.support.comparing import close_to, same_words

#: Calls from which CasADi computes here.
MANY = 3
#: Largest difference from the general path, over the largest number, as of `verifying.MODEL_AGREES`.
AGREES = 1e-10
#: The models of the general path.
GENERAL = {"idm": inverse.idm, "ddm": direct.ddm}


class Loop:
    """A robot whose models are called in a loop.

    Attributes:
        taken: Number of calls that the general path has taken.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.robot, self.taken = hybridyn.load("five_bar"), 0
        q, v, tau, a = random_states(self.robot)
        self.states = {"idm": (q, v, a), "ddm": (q, v, tau)}
        self.models = {name: repeated.repeated(self._counted(name)) for name in GENERAL}

    def _counted(self, name: str) -> Any:
        """Return a model of the general path that counts its calls."""
        general = GENERAL[name]

        @repeated.wraps(general)
        def call(*given: Any, **options: Any) -> Any:
            """Count a call."""
            self.taken += 1
            return general(*given, **options)

        return call

    def run(self, name: str, samples: int, **options: Any) -> list[Any]:
        """Call a model for some samples, one after the other."""
        states = zip(*(x[:samples] for x in self.states[name]), strict=True)
        return [self.models[name](self.robot, *state, **options) for state in states]

    def right(self, name: str, **options: Any) -> Any:
        """Return the results of the general path."""
        return GENERAL[name](self.robot, *self.states[name], **options)


@pytest.fixture
def loop(monkeypatch: pytest.MonkeyPatch) -> Loop:
    monkeypatch.delenv("HYBRIDYN_SINGLE_CALLS")
    monkeypatch.setattr(repeated, "MANY", MANY)
    monkeypatch.setattr(current, "build_beside", lambda *_: pytest.fail("nothing is built"))
    return Loop(monkeypatch)


@pytest.mark.parametrize("name", ["idm", "ddm"])
@pytest.mark.parametrize("effects", [None, "model", ["default", "viscous_friction"], ["default", "limits"]])
def test_casadi_takes_the_calls_after_the_first_ones(name: str, effects: Any, loop: Loop) -> None:
    found = loop.run(name, 8, effects=effects)
    assert loop.taken == MANY - 1
    close_to(np.array(found), loop.right(name, effects=effects)[:8], AGREES)


def test_words_of_arguments_do_not_matter(loop: Loop) -> None:
    q, v, a = (x[0] for x in loop.states["idm"])
    for _ in range(MANY):
        found = loop.models["idm"](loop.robot, q, a=a, v=v.tolist())
    assert loop.taken == MANY - 1
    close_to(found, loop.right("idm")[0], AGREES)


def test_each_choice_of_effects_and_each_model_has_its_own_count(loop: Loop) -> None:
    loop.run("idm", MANY - 1)
    loop.run("idm", MANY - 1, effects=hybridyn.effects.choose(loop.robot, "model"))
    loop.run("ddm", MANY - 1)
    assert loop.taken == 3 * (MANY - 1)


def test_the_general_path_takes_batches_and_other_options(loop: Loop) -> None:
    loop.run("idm", MANY)
    loop.taken = 0
    loop.run("idm", 2, passive="solved")
    loop.models["idm"](loop.robot, *loop.states["idm"])
    spring = ["default", hybridyn.effects.Spring({"m1_left_elbow": 40.0})]
    loop.run("idm", MANY + 1, effects=spring)
    assert loop.taken == 3 + MANY + 1


def test_refusals_are_the_same(loop: Loop) -> None:
    loop.run("idm", MANY)
    q, v, a = (x[0] for x in loop.states["idm"])
    run, right = loop.models["idm"], inverse.idm
    for given in ((q + 0.1, v, a), (q * np.nan, v, a), (q, v[:1], a), (q, v, None), (q, np.array([v, v]), a)):
        same_words(lambda x=given: run(loop.robot, *x), lambda x=given: right(loop.robot, *x))  # type: ignore[misc]
    with pytest.raises(TypeError, match="missing"):
        run(loop.robot, q, v)


def test_the_variable_turns_it_off(loop: Loop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_SINGLE_CALLS", "general")
    loop.run("idm", 2 * MANY)
    assert loop.taken == 2 * MANY


def test_without_casadi_the_general_path_goes_on(loop: Loop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    tried, written = [], repeated.RepeatedCalls._written
    monkeypatch.setattr(
        repeated.RepeatedCalls, "_written", lambda self, name: tried.append(name) or written(self, name)
    )
    loop.run("idm", 3 * MANY)
    assert loop.taken == 3 * MANY
    assert tried == ["idm"]  # once
