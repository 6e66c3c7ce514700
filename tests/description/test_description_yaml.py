"""yaml_file.py: numbers are those of YAML 1.2, and every trap of YAML is an error that names its line."""

import pytest

from hybridyn.description.side_cars.yaml_file import read_yaml
from hybridyn.errors import ModelError
from tests.comparing import refused


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-10", 1e-10),
        ("-.5", -0.5),
        ("1.", 1.0),
        ("12", 12),
        ("012", 12),
        ("1:30", "1:30"),
        ("yes", "yes"),
        ("no", "no"),
        ("true", True),
        ("null", None),
        ("1_000", "1_000"),
        (".nan", ".nan"),
        ("'1e-10'", "1e-10"),
        ("[a, [1, 2.5]]", ["a", [1, 2.5]]),
        ("{a: 1, b: {c: d}}", {"a": 1, "b": {"c": "d"}}),
        ("a: &x [1]\nb: *x", {"a": [1], "b": [1]}),
        ("", None),
    ],
)
def test_values(text: str, value: object) -> None:
    read = read_yaml(text.encode(), "f.yaml").data
    assert read == value
    assert type(read) is type(value)


BOMB = "a: &a [x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join(['*' + chr(97 + i)] * 10)}]\n" for i in range(9)
)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\nb: 2\na: 3", 3, "the key is stated twice"),
        ("a: 1\nb: [1, 2", 2, "not readable as YAML"),
        ("a: !!python/object:os.system x", 1, "is not allowed"),
        ("a:\n  - !thing x", 2, "is not allowed"),
        ("[a, b]: 1", 1, "a key must be a plain word"),
        ("a: *nothing", 1, "undefined alias"),
        ("a: 1\n--- \nb: 2", 2, "not readable as YAML"),
        (BOMB, None, "are aliases nested"),
        ("a: &a [*a]", None, "nested too deeply"),
        ("[" * 5000, None, "nested too deeply"),
        ("a: \x07", None, "not readable as YAML"),
        ("\tb: 1", 1, "not readable as YAML"),
        (b"a: \xff", None, "UTF-8"),
        ("a: " + "x" * 2**20, None, "larger than 1 MiB"),
    ],
)
def test_traps(text: str | bytes, line: int | None, message: str) -> None:
    caught = refused(
        lambda: read_yaml(text if isinstance(text, bytes) else text.encode(), "f.yaml"), ModelError, ""
    )
    assert message in str(caught)
    assert line is None or caught.line == line
