"""The tool of a stack is dragged through the page's socket, by the messages that a browser sends."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.spatial import Array, quaternion_from_rotation, rotation_from_vector
from hybridyn.view.drawing import draw
from hybridyn.view.page import Page
from hybridyn.view.placing import place_bodies
from tests.robots.as_written import WRITTEN
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow
from tests.support.waiting import wait_until

viser = needs("view")
import msgspec  # noqa: E402
import zstandard  # noqa: E402
from websockets.sync.client import ClientConnection, connect  # noqa: E402

CLOSED = 1e-9  # relative: `assemble` closes loops to rounding
SINGLE = 1e-6  # m: the page has numbers in single precision
HANDLE = "/grip"


class Client:
    """What a browser has been told of the scene, and what it tells.

    Attributes:
        told: The last position of each node that the server, or the user, has moved.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self._connection, self.told = connection, dict[str, Array]()

    def tell(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        if "position" in fields:
            self.told[fields["name"]] = np.array(fields["position"])
        self._connection.send(msgspec.msgpack.encode({"type": kind, "owner": "", **fields}))

    def listen(self) -> None:
        """Read what comes until the connection is closed."""
        for packet in map(bytes, self._connection):
            size = int.from_bytes(packet[8:16], "little")
            inner = zstandard.ZstdDecompressor().decompress(packet[16 : 16 + size])
            for message in msgspec.msgpack.decode(inner)["messages"]:
                if message["type"] == "SetPositionMessage":
                    self.told[message["name"]] = np.array(message["position"])


@contextmanager
def client(page: Page) -> Iterator[Client]:
    """Connect to a page as its own browser does."""
    own = page.url.removeprefix("http://")
    version = f"viser-v{viser.__version__}"
    with connect(f"ws://{own}", origin=page.url, subprotocols=[version], max_size=None) as connection:
        out = Client(connection)
        listener = threading.Thread(target=out.listen)
        listener.start()
        yield out
    listener.join()


def robot_of(name: str, folder: Path) -> HybridRobot:
    """Load a robot as people write it, or a shipped one."""
    return hybridyn.load(save(folder, WRITTEN[name][0](), f"{name}.urdf") if name in WRITTEN else name)


#: Robots, their tools, how far these cannot go aside [m] (or None if they turn freely), joints that all move.
STACKS = [
    ("excavator", "teeth", 0.05, ("boom_rod", "stick_rod", "bucket_rod")),
    slow("stewart_ur5", "tool0", None, ("m1_leg1_slide", "shoulder_lift_joint")),
    slow("arm_on_hexapod", "tool", None, ("leg0_rod_joint", "upper_arm_joint")),
    slow("lx4", "m4_platform", None, ("m1_leg1_slide", "m4_leg6_slide")),
]


def moved(page: Page, q: Array) -> dict[str, Array]:
    """Return where the nodes are of bodies that are not where they are at home."""
    placed, before = (place_bodies(page.robot, x).p for x in (q, page.robot.home))
    nodes = {frame.name: body for (_, body), frame in page.stage._frames.items()}
    return {name: placed[k] for name, k in nodes.items() if np.abs(placed[k] - before[k]).max() > SINGLE}


@pytest.mark.parametrize(("name", "tool", "aside", "movers"), STACKS)
def test_all_of_a_stack_follows_the_handle_of_its_tool(
    name: str, tool: str, aside: float | None, movers: tuple[str, ...], tmp_path: Path
) -> None:
    """The tool is where it was dragged, its handle too, and every link is where the posture has it."""
    robot = robot_of(name, tmp_path)
    page = Page(robot, draw(robot), port=0)
    try:
        p, R = page.poser.pose(robot.home, tool)
        p = p + np.array([0.02, 0.0, 0.03])
        R = R @ rotation_from_vector(np.array([[0.0, 0.03, 0.02]]))[0] if aside is None else R
        there = {
            "position": (p + np.array([0.0, aside or 0.0, 0.0])).tolist(),
            "wxyz": quaternion_from_rotation(R[None])[0, [3, 0, 1, 2]].tolist(),
        }
        with client(page) as browser:
            wait_until(lambda: HANDLE in browser.told, "the scene")
            browser.tell("TransformControlsDragStartMessage", name=HANDLE)
            browser.tell("TransformControlsUpdateMessage", name=HANDLE, **there)
            wait_until(lambda: bool((page.q != robot.home).any()), "a drag")
            browser.tell("TransformControlsDragEndMessage", name=HANDLE)
            q = page.q
            assert page.poser.pose(q, tool)[0] == pytest.approx(p, abs=CLOSED)
            assert aside or page.poser.pose(q, tool)[1] == pytest.approx(R, abs=CLOSED)
            assert hybridyn.closure_residual(robot, q) < CLOSED
            at = [robot.q_slices[robot.joint_index[joint]] for joint in movers]
            assert all((q[one] != robot.home[one]).any() for one in at)
            wanted = {HANDLE: p} | moved(page, q)

            def followed() -> bool:
                told = {name: at for name, at in browser.told.copy().items() if name in wanted}
                near = (np.abs(at - wanted[name]).max() < SINGLE for name, at in told.items())
                return told.keys() == wanted.keys() and all(near)

            wait_until(followed, "the links and the handle on the page")
    finally:
        page.close()
