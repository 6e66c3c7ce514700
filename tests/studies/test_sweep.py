"""Sweeps: designs, their rows, shards and questions, compared with robots that are loaded one by one."""

import itertools
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.effects.joints import WIDTH
from hybridyn.errors import AssemblyError, SingularityError, install_advice
from hybridyn.structure.parameters.slots import differences, values_of
from hybridyn.studies.pools import Pool, ThisProcess
from hybridyn.studies.results_folder import writing
from hybridyn.studies.sweep import sweep as sweeping
from hybridyn.studies.sweep.best import find_best
from hybridyn.studies.sweep.compiled_chunks import evaluate_chunk
from hybridyn.studies.sweep.compiled_designs import DesignPlan
from hybridyn.studies.sweep.designs import designs_of
from hybridyn.studies.sweep.evaluation import Chunk, Designer, DesignRow, status_of
from hybridyn.studies.sweep.reading import identity, read_study
from hybridyn.studies.sweep.shards import About, read_shards, write_shard
from hybridyn.studies.sweep.slot_numbers import SlotNumbers
from hybridyn.studies.sweep.stated_numbers import _number
from hybridyn.studies.sweep.variants import Variants
from tests.support.clocks import Clock
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save

#: Largest relative difference to a formula: both round a few times.
ROUNDING = 1e-12

PENDULUM = """<robot name="pendulum" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="1"/><xacro:arg name="mass" default="2"/>
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="$(arg length) 0 0"/><mass value="$(arg mass)"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"/>
  <joint name="end" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="2 0 0"/></joint>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="10"/></joint>
</robot>
"""
STUDY = """[robot]
file = "pendulum.urdf.xacro"
[designs]
{designs}
[parameters]
{parameters}
[tasks.swing]
trajectory = "swing.csv"
measure = {measure}
"""
TIME = np.linspace(0.0, 1.0, 21)
ANGLE = 1.2 * np.sin(TIME)
RATE = 1.2 * np.cos(TIME)
LENGTHS, FACTORS = (0.5, 1.5), (1.0, 3.0, 4.0)
GRID = "length = { values = [0.5, 1.5] }\nrod = { scale_inertia = 'rod', values = [1.0, 3.0, 4.0] }"
#: Without a xacro argument, so that the file is expanded for no design; scaling the base changes nothing.
SCALES = GRID.replace("length = {", "length = { scale_inertia = 'base',")


def pendulum_in(place: Path) -> Path:
    """Write a pendulum and its motion into a folder."""
    (place / "pendulum.urdf.xacro").write_text(PENDULUM)
    plain = re.sub(r"<xacro:arg.*/>", "", PENDULUM).replace("$(arg length)", "1").replace("$(arg mass)", "2")
    (place / "pendulum.urdf").write_text(plain)
    rows = np.column_stack([TIME, ANGLE, RATE, -ANGLE])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    header = "time,turn/position,turn/velocity,turn/acceleration"
    (place / "swing.csv").write_text("\n".join([header, *lines]))
    return place


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a pendulum and its motion, in which the test stands."""
    monkeypatch.chdir(tmp_path)
    return pendulum_in(tmp_path)


def written(designs: str, parameters: str = SCALES, measure: str = '["peak_effort"]') -> Path:
    text = STUDY.format(designs=designs, parameters=parameters, measure=measure)
    if "scale_inertia = 'base'" in text or "[numbers]" in text:
        text = text.replace("pendulum.urdf.xacro", "pendulum.urdf")
    return save(Path(), text, "study.toml")


def evaluated(study: Path, **options: bool) -> tuple[DesignRow, ...]:
    """Evaluate all designs of a study in one chunk."""
    source = read_study(study, **options)
    return evaluate_chunk(source, Chunk(0, designs_of(source)), None).rows


def effort(length: float, factor: float) -> np.ndarray:
    """The torque of the pendulum by its own equation; its weight acts about +y for a positive angle."""
    mass, inertia = 2.0 * factor, 0.1 * factor
    return (inertia + mass * length**2) * -ANGLE - mass * 9.81 * length * np.cos(ANGLE)


def rows_of(output: str) -> dict[str, list[Any]]:
    """All rows of a sweep, by column."""
    rows: dict[str, list[Any]] = read_shards(output).fill_null(np.nan).to_dict(as_series=False)
    return rows


class Here(ThisProcess):
    """An executor that works in this process; it loses the processes of some calls."""

    def __init__(self, deaths: Callable[..., bool]) -> None:
        self.deaths = deaths

    def submit(self, function: Callable[..., Any], /, *task: Any, **words: Any) -> Future[Any]:
        """Call a function, or lose its process."""
        if not self.deaths(*task):
            return super().submit(function, *task, **words)
        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor())
        return future


def pool_here(deaths: Callable[..., bool] = lambda *task: False) -> Pool:
    """A pool of two processes that are this one; results come out of order."""
    return Pool(2, lambda: Here(deaths))


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Callable[[Pool], None]:
    """Sweep in this process, design by design; the function takes another pool."""

    def use(pool: Pool) -> None:
        monkeypatch.setattr(sweeping, "open_pool", lambda *_: pool)

    monkeypatch.setattr(sweeping, "CHUNK_SECONDS", 1e9)  # the clock decides nothing
    monkeypatch.setattr(sweeping, "MOST_IN_CHUNK", 1)
    use(pool_here())
    return use


def test_what_a_sweep_needs_is_said_before_it_begins(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    refused(
        lambda: hybridyn.sweep(written("method = 'grid'", GRID), "out"),
        hybridyn.HybridynError,
        f"a sweep needs polars: {re.escape(install_advice('sweep'))}",
    )
    assert not (folder / "out").exists()


def test_a_grid_has_the_numbers_of_the_pendulums_equation(
    folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweeping, "MOST_IN_CHUNK", 6)  # one chunk: each expands the file again
    measure = (
        "{ top = 'peak_effort', rms = 'rms_effort', speed = 'peak_speed', left = 'stroke_margin', "
        "least = 'min turn/position', deep = 'min tip/pose/z', fast = 'peak tip/velocity/wy' }"
    )
    state = hybridyn.sweep(written("method = 'grid'", GRID, measure), "out")
    rows = rows_of("out")
    assert rows["design"] == list(range(6))
    assert state.statuses == {"ok": 6}
    for i, (length, factor) in enumerate(itertools.product(LENGTHS, FACTORS)):
        assert (rows["length"][i], rows["rod"][i]) == (length, factor)
        tau = effort(length, factor)
        rms = np.sqrt(np.trapezoid(tau**2, TIME))
        deep = -2 * np.sin(ANGLE[-1])  # the tip is 2 m from the hinge, and moves down
        wanted = [np.abs(tau).max(), rms, 1.2, (2 - ANGLE[-1]) / 4, 0.0, deep, 1.2]
        found = [rows[name][i] for name in ("top", "rms", "speed", "left", "least", "deep", "fast")]
        assert np.allclose(found, wanted, rtol=ROUNDING, atol=0)


def test_rows_are_those_of_load_and_idm(folder: Path) -> None:
    for row in evaluated(written("method = 'random'\ncount = 2\nseed = 4", "mass = { normal = [2.0, 0.1] }")):
        robot = hybridyn.load("pendulum.urdf.xacro", xacro_args={"mass": repr(row.values[0])})
        tau = hybridyn.idm(robot, ANGLE[:, None], RATE[:, None], -ANGLE[:, None])
        assert row.measures == (np.abs(tau).max(),)  # the same bits


def test_losses_that_grow_with_load_count_in_sweeps(folder: Path) -> None:
    """The hinge bears the rod's weight less the force of its motion; friction is in proportion to both."""
    radius = 0.01
    (folder / "pendulum.urdf.model.toml").write_text(
        f"[effects.load_friction]\nradial = {{ turn = {radius} }}"
    )
    rows = evaluated(written("method = 'grid'"))
    for row, (_, factor) in zip(rows, itertools.product(LENGTHS, FACTORS), strict=True):
        mass, weight = (
            2.0 * factor,
            2.0 * factor * 9.81,
        )  # at 1 m from the hinge; a positive angle is downwards
        along = mass * RATE**2 + weight * np.sin(ANGLE)
        across = -mass * ANGLE - weight * np.cos(ANGLE)
        friction = radius * np.hypot(along, across) * np.tanh(RATE / WIDTH)
        assert np.allclose(row.measures, np.abs(effort(1.0, factor) + friction).max(), rtol=ROUNDING, atol=0)


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random"])
def test_designs_are_drawn_from_their_distributions(folder: Path, method: str) -> None:
    """Fewer designs of a sequence are its first ones; a Latin hypercube has one design in each part."""
    parameters = "length = { range = [1.0, 2.0] }\nmass = { normal = [2.0, 0.1] }"

    def drawn(count: int, seed: int = 3) -> np.ndarray:
        designs = f"method = '{method}'\ncount = {count}\nseed = {seed}"
        return designs_of(read_study(written(designs, parameters)))

    whole = drawn(33)
    assert whole.shape == (33, 2)
    assert ((whole[:, 0] > 1) & (whole[:, 0] < 2)).all()
    assert np.array_equal(drawn(33), whole)
    assert not np.array_equal(drawn(33, 4), whole)
    if method == "latin_hypercube":
        assert sorted(((whole[:, 0] - 1) * 33).astype(int)) == list(range(33))
    else:
        assert np.array_equal(drawn(20), whole[:20])
    assert drawn(1).shape == (1, 2)


def test_a_table_gives_the_designs(folder: Path) -> None:
    Path("designs.csv").write_text("other,mass\n1,2.5\n2,3.5\n")
    study = read_study(written("method = 'table'\ntable = 'designs.csv'", "mass = {}"))
    assert designs_of(study).tolist() == [[2.5], [3.5]]
    Path("designs.csv").write_text("other,masss\n1,2.5\n")
    refused(
        lambda: designs_of(study),
        hybridyn.HybridynError,
        r"column 'mass': is missing \(did you mean 'masss'\?\)",
    )


def test_deaths_lose_nothing_and_count_nothing_twice(folder: Path, here: Any) -> None:
    left = {2: 1, 4: 10}  # one process dies once at design 2; design 4 ends every process

    def deaths(_: object, designs: Any, *more: object) -> bool:
        left[designs.start] = left.get(designs.start, 0) - 1
        return left[designs.start] >= 0

    here(pool_here(deaths))
    state = hybridyn.sweep(written("method = 'grid'"), "out")
    rows = rows_of("out")
    assert rows["design"] == list(range(6))
    assert [rows["status"][i] for i in (2, 4)] == ["ok", "failed"]
    assert "ended without a result" in rows["message"][4]
    assert state.statuses == {"ok": 5, "failed": 1}
    assert state.restarts > 0


def test_a_scheduler_that_goes_away_is_one_line_and_loses_nothing(folder: Path, here: Any) -> None:
    """Dask's executor cancels what it was given then."""

    class Gone(Here):
        def submit(self, function: Callable[..., Any], /, *task: Any, **words: Any) -> Future[Any]:
            future = super().submit(function, *task, **words)
            if task[1].start < 3:
                return future
            gone: Future[Any] = Future()
            gone.cancel()
            gone.set_running_or_notify_cancel()
            return gone

    here(Pool(2, lambda: Gone(lambda *_: False)))
    study = written("method = 'grid'")
    said = "the executor cancelled its tasks, as Dask does when its scheduler has gone"
    refused(lambda: hybridyn.sweep(study, "out"), hybridyn.HybridynError, said)
    done = len(rows_of("out")["design"])
    here(pool_here())
    assert hybridyn.sweep(study, "out", resume=True).now == 6 - done


def test_a_sweep_continues_from_its_shards(folder: Path, here: Any) -> None:
    study = written("method = 'grid'")
    hybridyn.sweep(study, "out")
    whole = rows_of("out")
    gone = sorted(Path("out").glob("designs-*"))[1::2]
    for path in gone:
        path.unlink()
    refused(lambda: hybridyn.sweep(study, "out"), hybridyn.HybridynError, "resume=True")
    state = hybridyn.sweep(study, "out", resume=True)
    assert rows_of("out") == whole
    assert (state.now, state.done) == (len(gone), 6)
    assert hybridyn.sweep(study, "out", resume=True).now == 0
    refused(
        lambda: hybridyn.sweep(written("method = 'grid'", measure='["rms_effort"]'), "out", resume=True),
        hybridyn.HybridynError,
        "out: its results were computed with another 'study': undo the change, or choose another folder",
    )


def test_a_record_of_another_version_is_told(folder: Path, here: Any) -> None:
    study = written("method = 'grid'")
    hybridyn.sweep(study, "out")
    record = Path("out", "record.txt")
    record.write_text(record.read_text().replace('"designs":', '"newer":', 1))
    refused(
        lambda: hybridyn.sweep(study, "out", resume=True),
        hybridyn.HybridynError,
        "^out: holds no results of a sweep",
    )


def test_no_sweep_is_mixed_with_shards_without_a_record(folder: Path, here: Any) -> None:
    """All Parquet files of the folder are read as one table."""
    study = written("method = 'grid'")
    hybridyn.sweep(study, "out")
    Path("out", "record.txt").unlink()
    first = min(Path("out").glob("designs-*"))
    for path in Path("out").glob("designs-*"):
        path.rename(path.with_stem(path.stem + "-d8e0"))
    for resume in (False, True):
        refused(
            lambda resume=resume: hybridyn.sweep(study, "out", resume=resume),
            hybridyn.HybridynError,
            f"out: has '{first.stem}-d8e0.parquet'.*, of which it has no record",
        )
    assert not [*Path("out").glob(first.name)]


def test_two_sweeps_at_once_count_nothing_twice(folder: Path, here: Any) -> None:
    """While a sweep evaluates, another one continues the same folder."""
    study = written("method = 'grid'")
    told: list[str] = []

    def meanwhile(*_: object) -> bool:
        again = partial(hybridyn.sweep, study, "out", resume=True)
        told.append(str(refused(again, hybridyn.HybridynError, "another process writes its results here")))
        return False

    here(pool_here(meanwhile))
    state = hybridyn.sweep(study, "out")
    assert (state.done, rows_of("out")["design"]) == (6, list(range(6)))
    assert told[0].startswith("out: ")


def test_a_process_that_is_killed_holds_no_folder(tmp_path: Path) -> None:
    text = (
        "import time; from hybridyn.studies.results_folder import writing\n"
        f"with writing({str(tmp_path)!r}, {{}}, {{}}, [], resume=False): print(flush=True); time.sleep(100)"
    )
    held = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE)
    held.stdout.readline()
    with (
        pytest.raises(hybridyn.HybridynError, match="another process"),
        writing(tmp_path, {}, {}, [], resume=False),
    ):
        pass
    held.kill()
    held.communicate()
    with writing(tmp_path, {}, {}, [], resume=False):
        pass


@pytest.mark.parametrize("what", ["broken", "added"])
def test_shards_of_another_study_are_refused(folder: Path, here: Any, what: str) -> None:
    """A file with the name of a shard, and a shard of another study."""
    hybridyn.sweep(written("method = 'grid'"), "other")
    study = written("method = 'grid'", SCALES.replace("1.5", "1.25"))
    hybridyn.sweep(study, "out")
    files, others = (sorted(Path(name).glob("designs-*")) for name in ("out", "other"))
    files[-1].write_bytes(others[-1].read_bytes() if what == "added" else b"PAR1")
    said = re.escape(f"{files[-1]}: is no result of this sweep, has changed")
    for question in (
        lambda: hybridyn.sweep(study, "out", resume=True),
        lambda: find_best("out", "peak_effort"),
    ):
        refused(question, hybridyn.HybridynError, said)
    files[-1].unlink()
    assert hybridyn.sweep(study, "out", resume=True).now == 1


def test_a_design_in_two_shards_is_refused(tmp_path: Path) -> None:
    about, rows = made(tmp_path, np.zeros((3, 1)), np.ones(3), ["x"])
    write_shard(tmp_path, about, rows[:2])
    write_shard(tmp_path, about, rows[1:])
    refused(lambda: read_shards(tmp_path), hybridyn.HybridynError, "designs-000000001-000000002.*: remove it")


def made(folder: Path, x: np.ndarray, y: np.ndarray, names: list[str]) -> tuple[About, list[DesignRow]]:
    """Begin the results of a sweep with a number y of each design x; return what it is and its rows."""
    about = About("study.toml", len(x), names, ["y"])
    pairs = zip(x.tolist(), y.tolist(), strict=True)
    rows = [DesignRow(i, tuple(design), "ok", (number,), "") for i, (design, number) in enumerate(pairs)]
    with writing(folder, {}, asdict(about), [], resume=False):
        return about, rows


def digest(study: Path) -> dict[str, str]:
    """The identity of a study."""
    source = read_study(study, allow_python=True)
    return identity(source, designs_of(source)[0])


def test_a_changed_include_side_car_or_function_is_another_study(folder: Path) -> None:
    """An expansion that is kept is recorded, too."""
    Path("cost.py").write_text("def cost(robot, motion):\n    return 1.0\n")
    part = "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><link name='more'/></robot>"
    Path("part.xacro").write_text(part)
    joint = '<joint name="fix" type="fixed"><parent link="tip"/><child link="more"/></joint></robot>'
    text = PENDULUM.replace("</robot>", f'<xacro:include filename="part.xacro"/>{joint}')
    Path("pendulum.urdf.xacro").write_text(text)
    study = written("method = 'grid'", "length = { values = [0.5, 1.5] }", '{ c = "cost.py:cost" }')
    seen = [digest(study)]
    assert digest(study) == seen[0]
    for file, text in (
        ("part.xacro", part.replace("/></robot>", " /></robot>")),
        ("cost.py", "def cost(robot, motion):\n    return 2.0\n"),
        ("pendulum.model.toml", "[joints.turn]\ndamping = 0.1\n"),
        ("pendulum.model.toml", "[joints.turn]\ndamping = 0.2\n"),
    ):
        Path(file).write_text(text)
        seen.append(digest(study))
        assert [name for name in seen[-1] if seen[-1][name] != seen[-2].get(name)] == [file]
    study.write_text(study.read_text().replace("method = 'grid'", "method = 'grid'\ncheck = 3"))
    assert digest(study) == seen[-1]  # no row depends on how many designs are compared


NUMBERS = "length = { values = [0.5, 1.5] }\nheavier = { values = [1.0, 3.0] }\n[numbers]\n"
STATED = '"centre:rod.x" = "length"\n"mass:rod" = "2 * heavier"\n"inertia:rod.yy" = "0.1 * heavier"\n'


def test_numbers_of_the_description_are_set_by_expressions(folder: Path) -> None:
    for row in evaluated(written("method = 'grid'", NUMBERS + STATED)):
        wanted = np.abs(effort(*row.values)).max()
        assert row.status == "ok"
        assert abs(row.measures[0] - wanted) <= ROUNDING * wanted


STATED_TO_BE = "length = { scale_inertia = 'base', values = [0.5, 0.6] }\n[numbers]\n"


@pytest.mark.parametrize(
    ("parameters", "measure", "said"),
    [
        (
            SCALES.replace("'base'", "'bas'"),
            "",
            "tried 6 of 6.; design 0 .length = 0.5, rod = 1.: .*mean 'base'",
        ),
        (
            SCALES.replace("'rod'", "'rodd'"),
            "",
            r"no design loads .*there is no link 'rodd' \(did you mean 'rod'\?\)",
        ),
        (SCALES, "{ a = 'max trn/effort' }", "no design can be evaluated .*did you mean 'turn'"),
        (STATED_TO_BE + '"mass:bar" = "length"', "", r"study.toml:\d+: .*no link 'bar'"),
        (
            STATED_TO_BE + '"centre:rod" = "length"',
            "",
            "'centre:rod' has 3 numbers: name one, such as 'centre:rod.x'",
        ),
        (STATED_TO_BE + '"mass:rod" = "-length"', "", r"mass of 'rod' cannot be -0.5"),
        (STATED_TO_BE + '"viscous_friction:turn" = "-length"', "", r"damping of 'turn' cannot be -0.5"),
        (STATED_TO_BE + '"mass:rod" = "lenght"', "", "no column 'lenght'.*did you mean 'length'"),
        (STATED_TO_BE + '"mass:rod" = "length;"', "", "is no expression"),
        (STATED_TO_BE + '"mass:rod" = "length, 2"', "", r"study.toml:\d+: .*is not understood"),
        (STATED_TO_BE + '"mass:rod" = "(length, 2) * 2"', "", "is not understood"),
    ],
)
def test_a_study_that_no_design_fulfils_is_one_line(
    folder: Path, here: Any, parameters: str, measure: str, said: str
) -> None:
    study = written("method = 'grid'", parameters, measure or '["peak_effort"]')
    refused(lambda: hybridyn.sweep(study, "out"), hybridyn.HybridynError, said)
    assert not Path("out").exists()


def test_numbers_beside_a_stated_one_are_scaled_with_its_link(folder: Path) -> None:
    """Numbers in slots, without a description of each design, are those of its description."""
    parameters = 'heavier = { scale_inertia = "rod", values = [2.0, 3.0] }\n[numbers]\n'
    study = read_study(written("method = 'grid'", parameters + '"inertia:rod.yy" = "0.1 * heavier"'))
    variants, values = Variants(study), np.array([[2.0], [3.0]])
    each = [variants.description(variants.named(own)) for own in values]
    slots = differences(*each)
    assert len(slots) == 4
    assert np.array_equal(
        SlotNumbers(variants, variants.robot(each[0]), slots, ())(values).p,
        [values_of(x, slots) for x in each],
    )


def test_designs_whose_stops_begin_elsewhere_are_left_to_the_general_path(folder: Path) -> None:
    Path("pendulum.urdf.xacro").write_text(PENDULUM.replace('upper="2"', 'upper="${2 * $(arg length)}"'))
    variants = Variants(read_study(written("method = 'grid'", "length = { values = [1.0, 1.5] }")))
    values = np.array([[1.0], [1.5]])
    each = [variants.description(variants.named(own)) for own in values]
    robot, slots = variants.robot(each[0]), differences(*each)
    for ends, possible in (((), [True, True]), ((("turn", "upper"),), [True, False])):
        assert SlotNumbers(variants, robot, slots, ends)(values).possible.tolist() == possible


def test_names_of_links_may_end_like_labels_of_numbers(folder: Path) -> None:
    study = read_study(written("method = 'grid'", NUMBERS + STATED))
    read = Variants(study).unscaled
    dotted = replace(read, links=tuple(replace(link, name=f"{link.name}.x") for link in read.links))
    for name in ("mass:rod.x", "centre:rod.x.y"):
        assert _number(dotted, name)[1] == name
    refused(lambda: _number(dotted, "centre:rodd.x"), hybridyn.ModelError, "no link 'rodd'")


def test_designs_to_compare_are_spread_evenly_however_the_work_is_divided() -> None:
    plan = DesignPlan("", (), 1003, 100)
    whole = plan.checks(0, 1003)
    assert len(whole) == len(set(whole)) == 100
    assert set(np.diff(whole)) <= {10, 11}
    edges = [0, 1, 2, 11, 500, 501, 1003]
    assert [k for a, b in itertools.pairwise(edges) for k in plan.checks(a, b)] == whole
    assert replace(plan, check=0).checks(0, 1003) == []


def test_a_full_disk_keeps_what_was_done(folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    study, written_so_far, write = written("method = 'grid'"), [], Path.write_bytes

    def fail(file: Path, content: bytes) -> Any:
        if len(written_so_far) == 2:
            write(file, content[:5])
            raise OSError(28, "No space left on device")
        written_so_far.append(file)
        return write(file, content)

    monkeypatch.setattr(Path, "write_bytes", fail)
    full = r"No space left on device: 'out/designs-(\d{9})-\1.parquet'"
    refused(lambda: hybridyn.sweep(study, "out"), OSError, full)
    assert len(rows_of("out")["design"]) == 2
    monkeypatch.setattr(Path, "write_bytes", write)
    hybridyn.sweep(study, "out", resume=True)
    assert rows_of("out")["design"] == list(range(6))


def test_designs_that_do_not_load_are_named(folder: Path) -> None:
    good, bad = evaluated(written("method = 'grid'", "mass = { values = [1.0, -1.0] }"))
    assert (good.status, bad.status) == ("ok", "not loaded")
    assert "mass" in bad.message
    assert np.isnan(bad.measures).all()


@pytest.mark.slow
def test_postures_out_of_reach_are_told(folder: Path) -> None:
    """The tool of a five-bar moves down and back; with short arms it cannot reach the lowest points."""
    t = np.linspace(0, np.pi, 17)
    z, w, a = -0.45 - 0.15 * np.sin(t), -0.15 * np.cos(t), 0.15 * np.sin(t)
    header = "time," + ",".join(
        f"m1_tool/{rate}/{x}" for rate in ("pose", "velocity", "acceleration") for x in "xz"
    )
    lines = [",".join(map(repr, row)) for row in np.column_stack([t, 0 * t, z, 0 * t, w, 0 * t, a]).tolist()]
    Path("down.csv").write_text("\n".join([header, *lines]))
    Path("arms.csv").write_text("upper_length,lower_length\n0.2,0.35\n0.25,0.4\n")
    path = written("method = 'table'\ntable = 'arms.csv'", "upper_length = {}\nlower_length = {}")
    path.write_text(
        path.read_text().replace("swing.csv", "down.csv").replace("pendulum.urdf.xacro", "five_bar")
    )
    short, long = evaluated(path)
    away = np.flatnonzero(np.hypot(0.12, z) > 0.2 + 0.35)
    assert (short.status, long.status) == ("unreachable", "ok")
    assert f"down.csv, row {away[0] + 1} " in short.message


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "method = 'grid'",
            "methd = 'grid'",
            r"study.toml:4: 'designs.methd': unknown key 'methd' \(did you mean 'method'",
        ),
        ("values = [0.5, 1.5]", "range = [2.0, 1.0], steps = 3", "the range from 2 to 1 is empty"),
        ("values = [0.5, 1.5]", "normal = [1.0, 0.1]", "parameter 'length': a grid needs"),
        ("values = [0.5, 1.5]", "range = [1.0, 2.0], valus = [1.0]", "did you mean 'values'"),
        ("peak_effort", "peak_efort", r"no measure 'peak_efort' \(did you mean 'peak_effort'\?\)"),
        ('["peak_effort"]', '["max turn/position"]', "needs a name"),
        ('["peak_effort"]', "{ cost = 'cost.py:cost' }", "allow it with allow_python=True"),
        ("swing.csv", "swim.csv", "'tasks.swing.trajectory': there is no file 'swim.csv'"),
        ("pendulum.urdf", "no.urdf", "there is no file 'no.urdf'"),
        ("method = 'grid'", "method = 'sobol'", "the method 'sobol' needs 'count'"),
        ('["peak_effort"]', "{ length = 'peak_effort' }", "'length' would be two columns"),
    ],
)
def test_wrong_studies_are_one_line(folder: Path, old: str, new: str, said: str) -> None:
    path = written("method = 'grid'")
    path.write_text(path.read_text().replace(old, new))
    refused(lambda: read_study(path), hybridyn.ModelError, said)


def test_the_best_and_the_pareto_front(folder: Path, here: Any) -> None:
    hybridyn.sweep(written("method = 'grid'"), "out")
    designs = list(itertools.product(LENGTHS, FACTORS))
    peaks = [np.abs(effort(1.0, factor)).max() for _, factor in designs]
    found = find_best("out", "peak_effort, -length", "rod < 2 or length > 1.2", top=2)
    kept = [i for i, (length, factor) in enumerate(designs) if factor < 2 or length > 1.2]
    assert [row[0] for row in found.rows] == sorted(kept, key=lambda i: (peaks[i], -designs[i][0]))[:2]
    better = {
        i for i in kept
        for j in kept
        if i != j and peaks[j] <= peaks[i] and designs[j][0] >= designs[i][0]
        and (peaks[j], -designs[j][0]) != (peaks[i], -designs[i][0])
    }  # fmt: skip
    assert {row[0] for row in found.front} == set(kept) - better
    assert (found.designs, found.considered) == (6, len(kept))
    for where, said in (
        ("lenght > 1", r"no column 'lenght' \(did you mean 'length'\?\)"),
        ("__import__('os')", "is not understood"),
        ("length > 0, length < 1", "is not understood"),
        (f"length < 1{'0' * 400}", "is not understood"),
        ("length >", "is no expression"),
        ("9 < 10 < length", "no design is left to compare .6 do not meet"),
        ("length > 9", "no design is left to compare .6 do not meet"),
    ):
        refused(partial(find_best, "out", "peak_effort", where), hybridyn.HybridynError, said)


def test_functions_of_a_python_file_measure(folder: Path) -> None:
    Path("cost.py").write_text(
        "def cost(robot, motion):\n    return motion.effort[3, 0] + motion.measures['p']\n"
    )
    study = written("method = 'grid'", measure="{ c = 'cost.py:cost', p = 'peak_effort' }")
    row = evaluated(study, allow_python=True)[0]
    tau = effort(1.0, 1.0)
    assert np.allclose(row.measures, [tau[3] + np.abs(tau).max(), np.abs(tau).max()], rtol=ROUNDING)


def test_the_command_evaluates_and_asks(
    folder: Path, here: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweeping, "time", Clock())  # it stands still, as coarse ones do
    written("method = 'grid'")
    words = ["sweep", "study.toml", "--best", "peak_effort", "--top", "1"]
    said = call(capsys, *words, "--plot", "sweep.html")
    assert "6 designs in 'results', 6 evaluated now" in said.err
    assert "general path, without compiled models: task 'swing': its table" in said.err
    assert said.out.splitlines()[-1].split()[:3] == ["0", "0.5", "1"]
    assert "peak_effort" in Path("sweep.html").read_text()
    said = call(capsys, "sweep", "--best", "-length", "--where", "rod > 2", "--top", "1")
    assert said.out.splitlines()[-1].split()[:3] == ["4", "1.5", "3"]
    assert "continue it with --resume" in call(capsys, "sweep", "study.toml", status=1).err


def test_shards_are_read_by_polars(folder: Path, here: Any) -> None:
    polars = needs("io")
    hybridyn.sweep(written("method = 'grid'"), "out")
    frame = polars.read_parquet("out/*.parquet").sort("design")
    assert frame["peak_effort"].to_list() == rows_of("out")["peak_effort"]


def test_figures_of_a_sweep_are_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from scipy.stats import qmc

    from hybridyn.figures.sweep import chart_of_sweep

    x = qmc.Sobol(2, seed=8).random(64)
    about, rows = made(tmp_path, x, x @ [3, 1], ["x", "z"])
    write_shard(tmp_path, about, [DesignRow(0, (0.0, 0.0), "unreachable", (np.nan,), ""), *rows[1:]])
    panel = chart_of_sweep(tmp_path, "y > 2").panels[0]
    counts = {mark.name: len(mark.y) for mark in panel.marks}
    low = int((x[1:] @ [3, 1] <= 2).sum())
    assert counts == {"does not meet the condition": low, "designs": 63 - low, "not evaluated": 1}
    call(capsys, "plot", tmp_path, "-o", tmp_path / "sweep.html")


@pytest.mark.parametrize("parameters", [1, 24, 30])
@pytest.mark.parametrize("measures", [1, 8, 11, 24, 25])
def test_what_a_figure_leaves_out_is_said(
    parameters: int, measures: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from hybridyn.figures import sweep

    across, down = ([f"{what}{i}" for i in range(n)] for what, n in (("p", parameters), ("m", measures)))
    columns = {name: np.zeros(2) for name in ("design", *across, *down)}
    found = About("study.toml", 2, across, down), columns, np.array(["ok", "ok"]), np.array([True, True])
    monkeypatch.setattr(sweep, "rows_of", lambda *_: found)
    chart = sweep.chart_of_sweep("out")
    assert {(panel.label, panel.x_label) for panel in chart.panels} == {
        (y, x) for y in down[:24] for x in across[:24]
    }
    for what, count in (("measures", measures), ("parameters", parameters)):
        assert (f"the first 24 of {count} {what}" in chart.title) == (count > 24)


@pytest.mark.parametrize("error", [AssemblyError("far"), SingularityError("flat"), ValueError("why")])
@pytest.mark.parametrize("wrong", [("first",), ("second",), ("first", "second")])
def test_an_error_in_one_task_leaves_the_measures_of_the_others(
    folder: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, wrong: tuple[str, ...]
) -> None:
    text = written("method = 'grid'").read_text()
    study = save(folder, text.replace("swing]", "first]") + text.partition("[tasks.swing]")[2].join(
        ["[tasks.second]", ""]
    ), "study.toml")  # fmt: skip
    whole, measure = evaluated(study)[0], Designer._task

    def failing(own: Designer, robot: hybridyn.HybridRobot, name: str, *given: Any) -> dict[str, float]:
        """Fail in some tasks, and measure the others."""
        if name in wrong:
            raise error
        return measure(own, robot, name, *given)

    monkeypatch.setattr(Designer, "_task", failing)
    row = evaluated(study)[0]
    columns = read_study(study).columns
    assert row.status == status_of(error)
    assert "why" in row.message or row.message == str(error)
    assert [np.isnan(x) for x in row.measures] == [c.partition(".")[0] in wrong for c in columns]
    kept = [(x, y) for x, y in zip(row.measures, whole.measures, strict=True) if not np.isnan(x)]
    assert all(x == y for x, y in kept)
