"""The page of `hybridyn view` in a real browser: its content, a drag, a drag out of reach, playback."""

import io
import re
import signal
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.colours import CLOSURE, MOTOR, module_colour, rgb
from hybridyn.view.drawing import draw
from hybridyn.view.page import Page
from hybridyn.view.panel import closeness
from hybridyn.view.run import ShownMotion
from tests.support.command_line import program
from tests.support.waiting import PATIENCE, wait_until
from tests.view.browser import browser, chromium
from tests.view.test_view import colours_in, without_limits

CLOSED = 1e-9  # relative: `assemble` closes loops to rounding
HUE = 0.12  # between colours, 0 to 1: light and shade change brightness, not hue
SHOWN = 1e-3  # m: sliders round to steps
FEW = 40  # pixels that a part of the robot covers at the least
MANY = 1500  # pixels that change when a leg moves visibly


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(tmp_path_factory.mktemp("profile")) as context:
        yield context


@pytest.fixture(scope="module")
def robot() -> hybridyn.HybridRobot:
    """Load a platform on three slides, without the limits that keep its motors in reach."""
    return without_limits("rps3")


@pytest.fixture(scope="module")
def swing(robot: hybridyn.HybridRobot) -> ShownMotion:
    t = np.linspace(0.0, 2.0, 101)
    first, *rest = robot.motors
    motors = {name: (np.zeros_like(t),) for name in rest}
    motors[first] = (0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t))
    q, v, a = hybridyn.assemble(robot, motors=motors)
    return ShownMotion(t, q, hybridyn.idm(robot, q, v, a), "of the inverse model")


@pytest.fixture(scope="module")
def page(robot: hybridyn.HybridRobot, swing: ShownMotion) -> Iterator[Page]:
    page = Page(robot, draw(robot), swing, port=0)
    yield page
    page.close()


@pytest.fixture(scope="module")
def tab(context: Any, page: Page) -> Iterator[Any]:
    tab = context.new_page()
    tab.asked = []
    tab.on("request", lambda request: tab.asked.append(request.url))
    tab.goto(page.url)
    tab.wait_for_selector("#hybridyn-singularity", timeout=1000 * PATIENCE)
    until(tab, lambda: coverage(picture(tab), module_colour(0)) > FEW)
    yield tab
    tab.close()


@pytest.fixture(autouse=True)
def at_home(request: pytest.FixtureRequest) -> None:
    """Begin each test on the page with the robot at home."""
    if "tab" in request.fixturenames:
        tab, page = request.getfixturevalue("tab"), request.getfixturevalue("page")
        tab.get_by_role("button", name="Home").click()
        until(tab, lambda: bool((page.q == page.robot.home).all()))
        for joint in page.robot.motors:  # the browser shows it a little later
            home = at(page.robot, page.robot.home, joint)
            until(tab, lambda: shown(tab, joint) == pytest.approx(home, abs=SHOWN))  # noqa: B023 (called here)


def until(tab: Any, holds: Callable[[], bool]) -> None:
    """Wait until a condition holds, while the page keeps running."""
    wait_until(holds, "an answer of the page", lambda seconds: tab.wait_for_timeout(1000 * seconds))


def picture(tab: Any) -> np.ndarray:
    """Return the pixels left of the panel, shape (height, width, 3), 0 to 1."""
    from PIL import Image

    whole = np.asarray(Image.open(io.BytesIO(tab.screenshot())).convert("RGB")) / 255
    seen = whole[:, : whole.shape[1] - 350].copy()
    seen[:170, :340] = 1.0  # the client shows a note there if the browser renders in software
    return seen


def coverage(pixels: np.ndarray, colour: str) -> int:
    """Count the pixels of a colour's hue (of its darkness, where it has none)."""
    if np.ptp(rgb(colour)) < 255 * HUE:
        return int((pixels.max(axis=2) < 0.45).sum())
    return colours_in(255 * pixels, colour, HUE)


def slider(tab: Any, label: str) -> Any:
    """Return the row of a slider, scrolled into view."""
    text = tab.get_by_text(label, exact=True).first
    text.scroll_into_view_if_needed()
    return text.locator("xpath=ancestor::*[.//*[@role='slider']][1]")


def knob(row: Any) -> Any:
    """Return the knob in the row of a slider."""
    return row.get_by_role("slider").first


def shown(tab: Any, label: str) -> float:
    """Return the value that a slider shows in the browser."""
    return float(knob(slider(tab, label)).get_attribute("aria-valuenow"))


def track(row: Any) -> dict[str, float]:
    """Return the place of a slider's track [pixels]."""
    return row.locator("xpath=.//*[contains(@class,'Slider-track')]").first.bounding_box()


def pull(tab: Any, row: Any, to: float) -> None:
    """Drag the knob of a slider to an x of the page [pixels]."""
    box = knob(row).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    for step in range(1, 9):
        tab.mouse.move(x + (to - x) * step / 8, y)
    tab.mouse.up()


def drag(tab: Any, label: str, part: float) -> None:
    """Drag a slider by a part of its width."""
    row = slider(tab, label)
    box = knob(row).bounding_box()
    pull(tab, row, box["x"] + box["width"] / 2 + part * track(row)["width"])


def drag_to_end(tab: Any, label: str) -> None:
    """Drag a slider to its right end, wherever its knob is."""
    row = slider(tab, label)
    end = track(row)
    pull(tab, row, end["x"] + end["width"] + 2)


def at(robot: hybridyn.HybridRobot, q: np.ndarray, joint: str) -> float:
    return float(q[robot.q_slices[robot.joint_index[joint]].start])


@pytest.mark.slow
def test_the_page_shows_robot_motors_efforts_and_distances(
    tab: Any, page: Page, robot: hybridyn.HybridRobot
) -> None:
    text = tab.inner_text("body")
    for expected in (robot.name, *robot.motors, "Play", "closures", " N"):
        assert expected in text, expected
    assert re.search(r"loops closed to \d", tab.inner_text("#hybridyn-status"))
    assert float(tab.get_attribute("#hybridyn-singularity", "data-least")) == pytest.approx(
        min(closeness(page.robot, page.q).values()), rel=1e-5
    )
    seen = picture(tab)
    for colour in (module_colour(0), CLOSURE, MOTOR):
        assert coverage(seen, colour) > FEW, colour
    foreign = [url for url in tab.asked if not url.startswith((page.url, f"blob:{page.url}", "data:"))]
    assert foreign == []  # it works without a network


@pytest.mark.slow
def test_a_drag_moves_its_motor_and_keeps_the_loops_closed(
    tab: Any, page: Page, robot: hybridyn.HybridRobot
) -> None:
    first, second, third = robot.motors
    before, seen = page.q, picture(tab)
    drag(tab, first, 0.1)
    until(tab, lambda: at(robot, page.q, first) - at(robot, before, first) > 0.05)
    until(tab, lambda: int((np.abs(picture(tab) - seen).max(axis=2) > 0.1).sum()) > MANY)
    for held in (second, third):
        assert at(robot, page.q, held) == pytest.approx(at(robot, before, held), abs=CLOSED)
    assert hybridyn.closure_residual(robot, page.q) < CLOSED
    assert tab.get_attribute("#hybridyn-status", "data-stopped") == "0"


@pytest.mark.slow
def test_a_drag_out_of_reach_stops_at_the_last_closed_posture_with_a_message(
    tab: Any, page: Page, robot: hybridyn.HybridRobot
) -> None:
    drag(tab, robot.motors[0], -0.4)
    tab.wait_for_selector("#hybridyn-status[data-stopped='1']", timeout=1000 * PATIENCE)
    said = tab.inner_text("#hybridyn-status")
    assert re.search(rf"{robot.motors[0]} stops at \S+ m: beyond this, the loops of \S+ do not close", said)
    assert hybridyn.closure_residual(robot, page.q) < CLOSED


@pytest.mark.slow
def test_play_runs_the_motion_and_scrub_stops_it_somewhere(tab: Any, page: Page, swing: ShownMotion) -> None:
    tab.get_by_role("button", name="Play").click()
    until(tab, lambda: page.playing and float(np.abs(page.q - swing.q[0]).max()) > 0.02)
    assert min(float(np.abs(page.q - q).max()) for q in swing.q) == 0.0  # postures of the motion, no others
    tab.get_by_role("button", name="Pause").click()
    until(tab, lambda: not page.playing)
    drag_to_end(tab, "time [s]")
    until(tab, lambda: bool((page.q == swing.q[-1]).all()))
    assert not page.playing
    expected = f"{swing.tau[-1, 0]:.4g} N"
    until(tab, lambda: expected in tab.inner_text("#hybridyn-efforts"))


@pytest.mark.slow
def test_the_command_serves_until_it_is_interrupted() -> None:
    chromium()  # the same conditions as its neighbours
    process = program("view", "five_bar", "--no-browser", "--port", 0)
    try:
        line = process.stdout.readline() if process.stdout else ""
        found = re.search(r"five_bar: (http://127\.0\.0\.1:\d+) ", line)
        assert found, line
        with urllib.request.urlopen(found[1], timeout=PATIENCE) as answer:
            assert b"<html" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.communicate()
