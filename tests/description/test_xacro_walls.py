"""Restrictions on xacro files: expressions without access to Python, their bounds, and folders."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xacro
from simpleeval import InvalidExpression

from hybridyn.description.bounds import Budget, RunawayError
from hybridyn.description.urdf import xacro as xacro_files
from hybridyn.description.urdf.definitions import parameter_of
from hybridyn.description.urdf.expressions import Evaluator, RefusedError
from hybridyn.description.urdf.robot_folders import RobotFolders
from hybridyn.description.urdf.scopes import Fields, Scope, dotted, known
from hybridyn.errors import ModelError
from tests import ROOT
from tests.description.reading import bound, save_all
from tests.robots.robot_texts import save
from tests.support.comparing import refused

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
LIMITS = {"upper": 2, "items": [1, {"deep": 5}]}


def evaluate(expression: str, names: dict[str, Any] | None = None) -> Any:
    """Evaluate an expression with xacro's names and the given ones."""
    files = {"load_yaml": print, "abs_filename": print}
    symbols = {**known(files, str, lambda *_: ""), "n": 3, **(names or {})}
    return Evaluator(symbols, (Scope, Fields), Budget())(expression, symbols)


WITHIN_REACH = [
    "().__class__.__base__.__subclasses__()",
    "''.__class__",
    "[c for c in ().__class__.__mro__]",
    "math.sin.__self__",
    "xacro.load_yaml.__globals__",
    "(lambda: 0).__code__",
    "n.real",
    "math.parent.root",
    "str.format('{0.__class__}', 1)",
    "'{0.__class__}'.format(1)",
    "'{a.__class__}'.format_map(dict(a=1))",
    "f'{n.__class__}'",
    "map(str.format, ['{0.__class__}'], [1])",
    "getattr(1, '__cla' + 'ss__')",
    "python.getattr(1, '_' + '_class_' + '_')",
    "exec('import os')",
    "eval('1')",
    "open('/etc/passwd')",
    "__import__('os')",
    "__builtins__",
    "vars()",
    "python.vars(math)",
    "python.type('X', (), dict())",
    "(lambda: 1)()",
    "(n := 4)",
    "[x for x.y in [1]]",
    "dict(a=1).update(b=2)",
    "n(1)",
    "'exec'('1')",
    "[len][0].__call__('a')",
    "print(1)",
    "await_ + 1",
    "xacro.NameSpace",
    "f'{1:9999999999}'",
]
WOULD_GROW = [
    "max(range(10**10))",
    "max(python.range(10**10))",
    "list(range(0, -10**10, -1))",
    "10**10**9",
    "1 << 10**9",
    "(10**4000 * 10**4000) * (10**9000 * 10**9000)",
    "'a' * 10**11",
    "10**11 * [1]",
    "('a' * 10**6) + 'b'",
    "[*python.range(10**6), 1]",
    "'%1000000000d' % 1",
    "'%*d' % (10**9, 1)",
    "'a'.replace('', 'b' * 10**6)",
    "('a' * 9999).replace('a', 'b' * 9999, 5000)",
    "round(7, -10**9)",
    "math.factorial(10**8)",
    "math.comb(10**8, 10**7)",
    "math.prod([2] * 10**5)",
    "'9'.join(['0' * 10**6] * 10**5)",
    "b'9' * 10**11",
    "[[1] * 999] * 9999",
    "str([['a' * 9999] * 9999] * 999)",
    "'%(a)s' * 1900 % dict(a=['b' * 9999] * 90)",
    "('x' * 9999).join(['y'] * 9999)",
    "list(map(list, map(python.range, [9999] * 9999)))",
    "math.lcm(10**3000, 10**2999 + 1)",
    "1 + " * 8000 + "1",
]
NO_SUCH = (RefusedError, InvalidExpression, NameError, TypeError, AttributeError)
TOO_LARGE = (
    r"too large|too wide|too long|that long|want to evaluate|more than|longer than|not (allowed|defined)"
)


@pytest.mark.parametrize(
    ("expression", "errors", "message"),
    [
        *((expression, NO_SUCH, "") for expression in WITHIN_REACH),
        *(
            (expression, (RefusedError, RunawayError, NameError, InvalidExpression), TOO_LARGE)
            for expression in WOULD_GROW
        ),
    ],
)
def test_nothing_of_python_is_within_reach_nor_grows_without_end(
    expression: str, errors: Any, message: str
) -> None:
    refused(lambda: evaluate(expression), errors, message)


def test_expressions_end(monkeypatch: pytest.MonkeyPatch) -> None:
    bound(monkeypatch, made=200_000)
    assert evaluate("len([1 for a in python.range(20) for b in python.range(20)])") == 400
    refused(
        lambda: evaluate("[1 for a in python.range(100) for b in python.range(100)]"),
        RunawayError,
        "expressions make more than",
    )


@pytest.mark.parametrize(
    "expression",
    [
        "-n ** 2 // 2 % 5 + ~3 | 8 ^ 1 & 3 << 1 >> 1",
        "not n and 1 or [] or 'last'",
        "1 < n <= 3 != 4, n is None, n not in [1, 2], 'b' in 'abc'",
        "'yes' if n > 2 else undefined",
        "[*[1, 2], *(3,)], (1, 2), {1, 2}, {'a': 1, **{'b': 2}}",
        "'abcdef'[1:-1:2], [1, 2, 3][-1], {'a': 5}['a'], python.range(9)[2]",
        "[x * y for x in [1, 2, 3] if x > 1 for y in (x, n)], {x: -x for x in [1]}",
        "sorted([[2, 'b'], [1, 'a']]), [b for a, b in [[1, 2]]], sorted([3, -4], key=python.abs)",
        "' '.join(str(x) for x in python.range(3)), 'a b'.split(), 'Abc'.lower().replace('b', 'd')",
        "'a_b_c'.replace('_', '-', 1), 'a_b_c'.replace('_', '', -1), '-'.join({'a': 1}), '-'.join('abc')",
        "radians(180) == pi, math.sin(1), math.pi, sqrt(2), round(2.567, 1), round(2.5)",
        "limits.upper, limits['items'][1].deep, limits.get('upper'), xacro.dotify(dict(a=1)).a",
        "dict(a=1, b=2), list(map(float, ['1', '2.5'])), len('abc'), min(3, 2), python.sum([1, 2])",
        "[1, 2, 3].pop(0), '%s_%02d' % ('leg', 7), int('12'), bool(''), 0x10 + 1_000, 1e-3, 1j",
        "xacro.tokenize('a,b;c'), python.divmod(7, 2), python.isinstance(n, int), list(python.zip([1], [2]))",
    ],
)
def test_values_are_those_of_python(expression: str) -> None:
    """Compare with xacro's own evaluation, which is Python's."""
    limits = xacro.YamlListWrapper.wrap(LIMITS)
    own = xacro.safe_eval(expression, {**xacro.create_global_symbols(), "n": 3, "limits": limits})
    assert evaluate(expression, {"limits": dotted(LIMITS)}) == own


def test_random_formulas_have_the_values_of_python() -> None:
    rng = np.random.default_rng(5)

    def formula(depth: int) -> str:
        if depth == 0:
            return str(rng.choice(["n", "2", "0.5", "pi", "x[1]", "'7'", "-3"]))
        first, second = formula(depth - 1), formula(depth - 1)
        shape = rng.choice(["({} {} {})", "max({0}, {2})", "({0} if {2} else {0})", "sin({0}) {1} {2}"])
        return str(shape).format(first, rng.choice(["+", "-", "*", "/", "//", "%", "<", "and", "or"]), second)

    names = {**xacro.create_global_symbols(), "n": 3, "x": [1, 4]}
    compared = 0
    for _ in range(400):
        text = formula(int(rng.integers(1, 4)))
        try:
            own = xacro.safe_eval(text, dict(names))
        except (TypeError, ZeroDivisionError, ValueError, OverflowError) as error:
            with pytest.raises(type(error)):
                evaluate(text, {"x": [1, 4]})
            continue
        assert repr(evaluate(text, {"x": [1, 4]})) == repr(own), text
        compared += 1
    assert compared > 150


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Return a robot file in a package, beside another package, a folder that is no package, and secrets."""
    return save_all(tmp_path, {
        "ws/arm/urdf/arm.xacro": "<robot/>", "ws/arm/package.xml": "<package/>",
        "ws/arm/config/arm.yaml": "a: 1\n", "ws/hand/urdf/hand.xacro": "<robot/>",
        "ws/letters/letter.yaml": "secret", "secret.yaml": "secret",
    })  # fmt: skip


def folders(file: Path, *named: Path) -> RobotFolders:
    return RobotFolders(str(file), [str(folder) for folder in named], [])


def test_packages_installed_inside_the_robots_folder_are_read(robot: Path) -> None:
    """Many projects keep their virtual environment in a hidden folder."""
    hidden = robot.parents[1] / ".venv"
    share = hidden / "share"
    part = share / "hand" / "urdf" / "hand.xacro"
    secrets = hidden / "secret.xacro", share / "hand" / ".git" / "config"
    for path in (part, *secrets):
        save(path.parent, "<robot/>", path.name)
    refused(lambda: RobotFolders(str(robot), [], [str(share)]).read(str(part)), ModelError, "is hidden")
    granted = RobotFolders(str(robot), [], [str(share)], [str(share)])
    assert granted.read(str(part)) == b"<robot/>"
    for path in secrets:
        refused(lambda path=path: granted.read(str(path)), ModelError, "is hidden")


def test_the_robots_own_folders_are_read(robot: Path) -> None:
    own = folders(robot)
    assert own.read(str(robot)) == b"<robot/>"
    assert own.read(str(robot.parent / ".." / "config" / "arm.yaml")) == b"a: 1\n"
    hand = robot.parents[2] / "hand"
    refused(lambda: own.read(str(hand / "urdf" / "hand.xacro")), ModelError, "outside the robot's folders")
    assert own.find("hand") == str(hand)
    assert own.read(str(hand / "urdf" / "hand.xacro")) == b"<robot/>"
    letters = robot.parents[2] / "letters"
    refused(lambda: own.find("letters"), ModelError, r"package 'letters' is not found.*package_dirs")
    assert folders(robot, letters).find("letters") == str(letters)
    assert folders(robot, letters.parent).find("letters") == str(letters)
    refused(lambda: own.read(str(robot.with_name("absent.xacro"))), OSError, "No such file")


OUTSIDE = "outside the robot's folders"
#: What is asked of a robot's folders, of which file, pattern or package, and what is told.
WALLS = [
    *(
        ("read", path, "")
        for path in (
            "/etc/passwd", "/proc/self/environ", "/proc/{parent}/environ", "/proc/self/root/etc/passwd",
            "../../../secret.yaml", "link.yaml", "far/secret.yaml", "../.git/config", "../.env", "pipe.yaml",
            "device.yaml", "large.yaml", "..",
        )
    ),
    *(("find", package, "") for package in ("..", ".ssh", "/etc", "a/b", "", "etc", "tmp")),
]  # fmt: skip


@pytest.mark.parametrize(("asked", "what", "message"), WALLS)
def test_nothing_else_is_read(
    robot: Path, asked: str, what: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bound(monkeypatch, file=1000)
    here = robot.parent
    links = {
        "link.yaml": robot.parents[3] / "secret.yaml",
        "far": robot.parents[3],
        "device.yaml": "/dev/zero",
    }
    if message != OUTSIDE:
        links |= {f"again{number}": here for number in range(4)}
    for name, target in links.items():
        (here / name).symlink_to(target)
    os.mkfifo(here / "pipe.yaml")
    save_all(here.parent, {".git/config": "secret", ".env": "secret", "urdf/large.yaml": "a" * 1001})
    what = what.format(parent=os.getpid())
    ask = getattr(folders(robot), asked)
    refused(
        lambda: ask(what if asked == "find" else str(here / what)), (ModelError, IsADirectoryError), message
    )


def test_a_home_folder_is_nobodys_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(tmp_path, "secret", "secret.yaml")
    file = save(tmp_path / "urdf", "<robot/>", "arm.xacro")
    for home in (tmp_path, f"{tmp_path.parent}//{tmp_path.name}", f"{tmp_path.parent}/./{tmp_path.name}/"):
        monkeypatch.setenv("HOME", str(home))
        refused(lambda: folders(file).read(str(tmp_path / "secret.yaml")), ModelError, "outside")


INCLUDE = '<xacro:include filename="{}"/>'
TENFOLD = "".join(f'<xacro:macro name="m{i}">{f"<xacro:m{i + 1}/>" * 10}</xacro:macro>' for i in range(12))
TWICE = '<xacro:insert_block name="b"/>' * 2
CALLS = f'{"<xacro:w><c>" * 30}<link name="q"/>{"</c></xacro:w>" * 30}'
#: Files that make too much.
RUNAWAYS = {
    "blocks": f'<xacro:macro name="w" params="**b">{TWICE}</xacro:macro>{CALLS}',
    **{
        f"macros{last}": f'{TENFOLD}<xacro:macro name="m12">{last}</xacro:macro><xacro:m0/>'
        for last in ("", "<a/>", "<!-- a -->")
    },
    "what is left out": f"""<xacro:macro name="m" params="n"><xacro:if value="0">{"<a/>" * 1000}</xacro:if>
        <xacro:if value="${{n}}"><xacro:m n="${{n - 1}}"/><xacro:m n="${{n - 1}}"/></xacro:if></xacro:macro>
        <xacro:m n="40"/>""",
    "attributes": f"""<xacro:macro name="m" params="p"><a name="{"${p}" * 2000}"/></xacro:macro>
        {"<xacro:m p='" + "a" * 9999 + "'/>"}"""
    * 200,
    "plain attributes": f'<xacro:macro name="m"><a b="{"a" * 10**6}"/></xacro:macro>{"<xacro:m/>" * 2000}',
    "syntax": "".join(f'<a b="${{[{i},{"1," * 4900}]}}"/>' for i in range(300)),
    "YAML": """<a b="${xacro.load_yaml('large.yaml')}"/>""",
    "elements": "<a/>" * 700_000,
    "instructions": "<?a?>" * 1_500_000,
    "comments": "<!---->" * 1_500_000,
    "sections": "<![CDATA[a]]> " * 1_500_000,
    **{
        read: """<xacro:property name="big" value="${list(python.range(9999))}"/>"""
        + f"""<a b="${{len([{read} for i in python.range(9000)])}}"/>""" * 2
        for read in ("max(big, key=str)", "-1 in big")
    },
    "notes": """<a b="${len([xacro.message('') for i in python.range(9000)])}"/>""" * 10,
}
#: Those that take no seconds.
SHORT = {"attributes", "plain attributes", "YAML", "instructions"}
#: Those of a whole file, which has no line.
WHOLE = {"elements", "instructions", "comments", "sections"}
#: What stands in a file, and what is told.
ATTACKS = [
    *(
        (f"<link>{said}</link>", message)
        for said, message in (
            ("$(eval exec)", "'exec' is not defined"),
            (r"${xacro.load_yaml('python.yaml')}", "could not determine a constructor"),
            (r"${xacro.load_yaml('code.yaml')}", "not defined"),
            (r"${xacro.load_yaml('/proc/self/environ')}", OUTSIDE),
            (r"$(optenv HOME none)$(env HOME)", "'HOME' is not set"),
        )
    ),
    *(
        (INCLUDE.format(path), rf"{OUTSIDE}; name .* with package_dirs")
        for path in ("/etc/passwd", "../secret.xacro", "link.xacro")
    ),
    *((INCLUDE.format(pattern), OUTSIDE) for pattern in ("/etc/*.xacro", "../*.xacro", "l*.xacro")),
]  # fmt: skip


@pytest.mark.parametrize(("said", "message"), ATTACKS)
def test_attacks_from_a_file(tmp_path: Path, said: str, message: str) -> None:
    file = save_all(tmp_path, {
        "robot/r.xacro": f"{HEAD}{said}</robot>", "secret.xacro": "<robot/>",
        "robot/python.yaml": "!!python/object/apply:os.system ['id']\n",
        "robot/code.yaml": "!degrees open('/etc/passwd')\n",
    })  # fmt: skip
    (tmp_path / "robot" / "link.xacro").symlink_to(tmp_path / "secret.xacro")
    refused(lambda: xacro_files.expand(str(file), {}, ()), ModelError, message)


@pytest.mark.parametrize("name", RUNAWAYS)
def test_what_runs_away_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A smaller bound is met sooner, also by arguments, and before what is traced is expanded once more."""
    bound(monkeypatch, made=4_000_000)
    argument = '<xacro:arg name="k" default="1"/>'
    file = save_all(
        tmp_path,
        {"r.xacro": f"{HEAD}{argument}{RUNAWAYS[name]}</robot>", "large.yaml": "a: 1\n" * 10_000},
    )
    for given in ({}, {"k": "2"}):
        error = refused(
            lambda given=given: xacro_files.expand(str(file), given, ()),
            RunawayError,
            "the YAML file .*large.yaml of 0.05 MB counts 500 times its size.*by the program xacro"
            if name == "YAML"
            else "macro that calls itself or repeats its blocks too often.*by the program xacro",
        )
        assert name in WHOLE or error.line, "macros have lines"


LIMITED = """
import resource, sys
from hybridyn.description import read
from hybridyn.description.urdf import expansion  # noqa: F401  # before the limit
pages = int(open("/proc/self/statm").read().split()[0])
most = pages * resource.getpagesize() + 600 * 10**6
resource.setrlimit(resource.RLIMIT_AS, (most, most))
read(sys.argv[1])
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system tells no sizes")
@pytest.mark.parametrize(
    "name", [name if name in SHORT else pytest.param(name, marks=pytest.mark.slow) for name in RUNAWAYS]
)
def test_what_runs_away_takes_bounded_memory(name: str, tmp_path: Path) -> None:
    texts = {"r.xacro": f"{HEAD}{RUNAWAYS[name]}</robot>", "large.yaml": "a: 1\n" * 250_000}
    path = save_all(tmp_path, texts)
    done = subprocess.run([sys.executable, "-c", LIMITED, str(path)], capture_output=True, text=True)
    assert "RunawayError" in done.stderr
    assert "make more than 500 MB" in done.stderr


def test_defaults_of_macros_take_linear_time(tmp_path: Path) -> None:
    """An open quote after 60 letters or texts: xacro's own expression tries 2^60 ways to divide them."""
    for run in ("x" * 60, "'x'" * 60, "&quot;x&quot;" * 60):
        macro = f'<xacro:macro name="m" params="p q:={run}&quot;"><a/></xacro:macro><xacro:m p="1"/>'
        file = save(tmp_path, f"{HEAD}{macro}</robot>", "r.xacro")
        refused(
            lambda file=file: xacro_files.expand(str(file), {}, ()), ModelError, r"Undefined parameters \[q:="
        )


def test_defaults_of_macros_are_those_of_xacro() -> None:
    for text in (
        "p q", "p:=0 q", "p:='a b' q", "p:=a'b c'd q:=1", 'p:="" q', "p:=^ q", "p:=^|0 q", "p:=^|${2 + 1} q",
        "p:=${[1, 'a'][1]} q", "p=$(arg a) q", "p:=${a} ${b} q", " *block **many", "p := 'it' q",
        "p:=say'\"'",
    ):  # fmt: skip
        name, default, rest = parameter_of(text)
        stated = default and (name if default.forwards else None, default.text)
        assert (name, stated, rest) == xacro.parse_macro_arg(text), text


def test_any_robot_may_include_the_shipped_modules(tmp_path: Path) -> None:
    text = f'{HEAD}<xacro:include filename="{ROOT}/urdf/modules/bodies.xacro"/><link name="a"/></robot>'
    file = save(tmp_path, text, "r.xacro")
    assert b' name="a"/>' in xacro_files.expand(str(file), {}, ())[0]


def test_an_expansion_that_does_not_end_can_be_interrupted(tmp_path: Path) -> None:
    """Interrupt a regular expression that cannot end, and expand another file afterwards."""
    text = f"""{HEAD}<link name="${{xacro.tokenize('a' * 60 + '!', 'x]|(a+)+$|[y')}}"/></robot>"""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        refused(lambda: xacro_files.expand(save(tmp_path, text, "r.xacro"), {}, ()), KeyboardInterrupt, "")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert b"<robot" in xacro_files.expand(save(tmp_path, f"{HEAD}</robot>", "s.xacro"), {}, ())[0]
