"""The list of stable names is that of the package: a change is made on purpose, with the list."""

import difflib

from docs.extensions import stable_names as names


def test_stable_names_are_those_of_the_list() -> None:
    before, now = names.FILE.read_text().splitlines(), names.stable_names().splitlines()
    changed = [line for line in difflib.ndiff(before, now) if line[0] in "+-"]
    assert not changed, (
        "names changed; if this is meant, read docs/stable-names.md, and run "
        "`python docs/extensions/stable_names.py`"
    )


def test_arguments_members_and_keys_are_seen() -> None:
    """A list that misses a kind of name would hold nothing."""

    def call(first: int, second: int = 0, *more: int, named: int, **others: int) -> None:
        """Take every kind of argument."""

    assert names._arguments(call) == "(first, second=, *more, named, **others)"
    text = names.FILE.read_text()
    for line in (
        "hybridyn.mass_matrix(robot, q, *, joints=, effects=)",
        "hybridyn.AssemblyError.iterations", "hybridyn.simulate().t", "hybridyn.effects.Damper(coefficient=)",
        "hybridyn sweep -j, --jobs", "<link>/pose/roll", "<closure>/wrench/fx", "effects.spring.stiffness",
        "events.singularity", "tasks.*.workspace.link",
    ):  # fmt: skip
        assert f"  {line}\n" in text
