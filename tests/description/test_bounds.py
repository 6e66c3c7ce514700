"""Each bound on robot files refuses by number, against the bound; one budget sums over a robot's files."""

import re
from pathlib import Path

import pytest

from hybridyn.description.bounds import BOUNDS, COUNTED, Budget, RunawayError, refuse_above, said
from hybridyn.description.usd import opening
from tests import ROOT
from tests.description.reading import bound, save_all
from tests.description.reading import refused as refused_file
from tests.description.sdf_texts import link, sdf
from tests.robots.mjcf_texts import mjcf
from tests.robots.robot_texts import FOUR_BAR
from tests.support.comparing import refused

PAGE = ROOT / "docs" / "formats.md"
XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
PART = sdf("<include><uri>a.sdf</uri></include>")
#: What the process of OpenUSD may take: the system counts it.
UNCOUNTED = {"memory", "seconds"}


@pytest.mark.parametrize("what", sorted(set(BOUNDS) - UNCOUNTED))
def test_a_bound_says_what_was_found_and_what_is_read(what: str) -> None:
    most = BOUNDS[what].most
    refuse_above(what, most)
    error = refused(lambda: refuse_above(what, most + 1), RunawayError, "")
    assert f"{most + 1:,}" in str(error)
    assert said(what, 0).count("{") == 0
    assert f"{most:,}" in str(error) or BOUNDS[what].unit in str(error)
    refused(lambda: refuse_above(what, 10**10_000), RunawayError, f"{COUNTED:,} and more")
    refused(lambda: refuse_above(what, float("inf"), ValueError), ValueError, "and more")


def test_a_budget_counts_the_sum() -> None:
    budget = Budget()
    budget.spend("files", 600)
    budget.spend("elements", 600)
    refused(lambda: budget.spend("files", 500), RunawayError, "more than 1,000 files are included: 1,100")
    budget.restart("files")
    budget.spend("files", 1000)


#: Files of a robot, a bound that is made smaller, and what is told.
REFUSED: dict[str, tuple[dict[str, str], dict[str, int], str]] = {
    "URDF": ({"r.urdf": FOUR_BAR}, {"file": 100}, "r.urdf"),
    "elements of URDF": ({"r.urdf": FOUR_BAR}, {"elements": 4}, "elements, limit 4"),
    "xacro": (
        {"r.xacro": XACRO.format("<link name='${9 * 9}'/>")}, {"made": 1000}, "make more than",
    ),
    "what xacro asks": (
        {"r.xacro": XACRO.format("<xacro:include filename='a.xacro'/>"), "a.xacro": XACRO.format("")},
        {"asked": 1}, "reads more than 1 files: 2",
    ),
    "files of MJCF": (
        {"r.xml": mjcf('<include file="a.xml"/>'), "a.xml": "<mujocoinclude/>"}, {"files": 0},
        "r.xml:.*more than 0 files are included: 1",
    ),
    "replicas": ({"r.xml": mjcf()}, {"replicas": 3}, "more than 3 elements up to here: 4"),
    "XML of SDF": (
        {"r.sdf": PART, "a.sdf": sdf(link("c"), name="a")}, {"XML": 150},
        "bytes of XML",
    ),
    "models in SDF": (
        {"r.sdf": sdf(f'<model name="m">{link("c")}</model>')}, {"depth of models": 0},
        "nested more than 0 deep: 1",
    ),
    "side-cars": (
        {"r.urdf": FOUR_BAR, "r.model.toml": "# read by no other test\n"}, {"side-car": 3},
        "r.model.toml.*24 bytes",
    ),
    "values of YAML": (
        {"r.urdf": FOUR_BAR, "r.yaml": "closed_loop: [[a, b]]\n"}, {"values": 2}, "more than 2 values: 3",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_every_format_asks(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts, most, words = REFUSED[name]
    file = save_all(tmp_path, texts)
    bound(monkeypatch, **most)
    error = refused_file(file)
    refused(lambda: (_ for _ in ()).throw(error), type(error), words)
    assert str(tmp_path.name) in str(error), "the file is named"


def test_the_page_of_formats_lists_all_bounds() -> None:
    rows = dict(re.findall(r"^\| ([^|]*?) \| [^|]*\| ([0-9][^|]*?) \|$", PAGE.read_text(), re.M))
    units = {"": 1, "MB": 10**6, "MiB": 2**20, "GiB": 2**30}
    stated = {what: f"{b.most / units[b.unit]:,.0f} {b.unit}".strip() for what, b in BOUNDS.items()}
    assert {what: rows.get(what) for what in BOUNDS} == stated


def test_openusd_has_bounds_of_its_process() -> None:
    assert opening.BOUNDS is BOUNDS
    assert said("seconds") == "120 s"
    assert said("memory") == "2 GiB of memory"
