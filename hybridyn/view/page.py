"""The page in the browser: a 3-D scene, sliders of the motors, playback of a motion, and bars of efforts.

viser serves the page and reports the user's actions. A thread of the page handles the latest request of each
kind.
"""

from __future__ import annotations

import contextlib
import io
import logging
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..assembly.redundancy import LEAST
from ..assembly.task import closure_residual
from ..errors import HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .camera import camera_around
from .grip import Grip
from .own_origin import start_server
from .panel import closeness, closeness_html, efforts_html, holding, legend_html, status_html
from .picture import Picture, Role
from .placing import place_bodies
from .posing import Poser
from .run import ShownMotion
from .sliders import Sliders, on_slide, round_step
from .stage import PageStage

_log = logging.getLogger(__name__)

#: Shortest time between frames, and between updates of the bars during playback [s].
FRAME, BARS = 1 / 30, 1 / 8
SPEEDS = ("0.1x", "0.25x", "0.5x", "1x", "2x", "5x")
#: Intensity of the ambient light. A higher one makes the colours pale.
LIGHT = 0.25
#: Margin of the initial view around the robot, as a factor of its size.
ROOM = 1.25
#: What can be hidden.
SHOWN: tuple[Role, ...] = ("closure", "joint", "motor")
BRAND = (59, 125, 216)


class Page:
    """A robot on a page.

    Attributes:
        robot: The robot.
        q: The displayed posture, shape (nq,).
        playing: Whether the motion is played.
        url: Address of the page.
    """

    def __init__(
        self,
        robot: HybridRobot,
        picture: Picture,
        run: ShownMotion | None = None,
        *,
        redundancy: str = LEAST,
        host: str = "127.0.0.1",
        port: int = 8080,
    ) -> None:
        """Start to serve the page.

        Args:
            robot: The robot.
            picture: The robot's shapes.
            run: A motion to play, or None.
            redundancy: The rule for freedoms that a dragged link leaves, as in `hybridyn.assemble`.
            host: Address to listen on. The default is reachable only from this machine.
            port: Port to listen on; the next free one is used if it is taken.
        """
        self.robot, self.run = robot, run
        self.q: Array = robot.home if run is None else run.q[0]
        self.playing = False
        self.poser = Poser(robot, redundancy)
        self.server = start_server(host, port, f"hybridyn: {robot.name}")
        self.url = f"http://{host}:{self.server.get_port()}"
        self._requests: dict[str, Any] = {}
        self._lock, self._wake = threading.Lock(), threading.Event()
        self._closed = False
        self._clock = self._bars_at = 0.0
        self._span = None if run is None else run.tau
        self._set_view(picture)
        self.stage = PageStage(self.server, robot, picture)
        self._add_panel(picture)
        self._show(self.q, "")
        self._thread = threading.Thread(target=self._handle_requests, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving the page."""
        self._closed = True
        self._wake.set()
        self._thread.join()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def _set_view(self, picture: Picture) -> None:
        """Set camera, light and floor."""
        camera = camera_around(picture.corners, 800, 800, room=ROOM)
        first = self.server.initial_camera
        first.position, first.look_at, first.up = camera.eye, camera.target, (0.0, 0.0, 1.0)
        first.near, first.far = picture.size / 200, picture.size * 50
        first.fov = 2 * camera.angle
        self.server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
        self.server.scene.configure_environment_map("studio", environment_intensity=LIGHT)
        size = 1.5 * picture.size
        self.server.scene.add_grid(
            "/floor",
            width=size,
            height=size,
            cell_size=size / 24,
            section_size=size / 6,
            position=(*picture.centre[:2], picture.floor),
        )

    def _add_panel(self, picture: Picture) -> None:
        gui = self.server.gui
        robot = self.robot
        sizes = f"modules {len(robot.modules)}, motors {len(robot.motors)}, freedoms {robot.mobility}"
        gui.add_markdown(f"**{robot.name}** {sizes}")
        self._status, self._closeness = gui.add_html(status_html("", 0.0)), gui.add_html("")
        if self.run is not None:
            self._add_motion(self.run)
        if self.poser.levers:
            gui.add_button("Home").on_click(lambda event: self._request("home", True))
        self._sliders = Sliders(gui, self.poser, self.q, lambda joint, to: self._request(f"move {joint}", to))
        links, size = self.poser.links, picture.size
        self._grip = Grip(self.server, self.poser, size, self._request) if links else None
        with gui.add_folder("Efforts"):
            self._efforts = gui.add_html("")
        with gui.add_folder("Show", expand_by_default=False):
            for role in SHOWN:
                self._add_checkbox(f"{role}s", True, partial(self.stage.show, role))
            self._add_checkbox("colours of the files", False, self.stage.paint)
            gui.add_html(legend_html(self.robot))
            for note in picture.notes:
                gui.add_markdown(note)

    def _add_motion(self, run: ShownMotion) -> None:
        """Add the controls of the motion: play, time and speed."""
        gui = self.server.gui
        with gui.add_folder("Motion"):
            self._button = gui.add_button("Play")
            label = "time [s]" if run.timed else "row"
            step = round_step(run.end - run.begin)
            self._time: Any = gui.add_slider(
                label, run.begin, max(run.end, run.begin + step), step, run.begin
            )
            self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1x")
            self._repeat = gui.add_checkbox("repeat", True)
        self._button.on_click(lambda event: self._request("play", not self.playing))
        on_slide(self._time, lambda value: self._request("time", value))

    def _place_grip(self) -> None:
        """Put the handle, where there is one, to the tool."""
        if self._grip is not None:
            self._grip.place(self.q)

    def _add_checkbox(self, label: str, value: bool, act: Callable[[bool], None]) -> None:
        """Add a checkbox that calls `act` when it changes."""
        box = self.server.gui.add_checkbox(label, value)
        box.on_update(lambda event: act(box.value))

    def _request(self, name: str, value: Any) -> None:
        """Store a request of the user; it replaces an earlier one of the same kind."""
        with self._lock:
            self._requests[name] = value
        self._wake.set()

    def _handle_requests(self) -> None:
        """Handle requests and play the motion until the page is closed."""
        while not self._closed:
            self._wake.wait(FRAME if self.playing else None)
            self._wake.clear()
            with self._lock:
                requests, self._requests = self._requests, {}
            try:
                for name, value in requests.items():
                    self._handle(name, value)
                if self.playing:
                    self._next_frame()
            except Exception as error:  # the page must keep running and show the error
                self.playing = False
                _log.exception("a request from the page failed")
                self._status.content = status_html(f"{type(error).__name__}: {error}", 0.0)

    def _handle(self, name: str, value: Any) -> None:
        if name == "play":
            self._set_playing(value)
        elif name == "time" and self.run is not None:
            self._set_playing(False)
            self._frame(value)
        elif name == "home":
            self._set_playing(False)
            self._show(self.robot.home, "")
        elif name.startswith("move "):
            self._set_playing(False)
            moved = self.poser.move(self.q, name.removeprefix("move "), value)
            self._show(moved.q, moved.message)
        elif name == "drag":
            self._set_playing(False)
            assert self._grip is not None
            moved = self._grip.drag(self.q, value)
            self._show(moved.q, moved.message, held=True)
        elif name == "grip":
            self._place_grip()

    def _set_playing(self, playing: bool) -> None:
        if self.run is None or playing == self.playing:
            return
        self.playing = playing
        self._button.label = "Pause" if playing else "Play"
        self._clock = time.monotonic()
        if playing and self._time.value >= self.run.end:
            self._time.value = self.run.begin
        if not playing:
            self._bars(self.q, self.run.index(self._time.value))

    def _next_frame(self) -> None:
        """Show the posture of the motion at the current time."""
        assert self.run is not None
        now = time.monotonic()
        speed = float(self._speed.value.removesuffix("x")) * (1.0 if self.run.timed else 10.0)
        at = self._time.value + (now - self._clock) * speed
        self._clock = now
        if at >= self.run.end and not self._repeat.value:
            self._frame(self.run.end)
            self._set_playing(False)
            return
        span = self.run.end - self.run.begin
        self._frame(self.run.begin + (at - self.run.begin) % span if span else self.run.end)

    def _frame(self, at: float) -> None:
        assert self.run is not None
        self._time.value = float(np.clip(at, self.run.begin, self.run.end))
        number = self.run.index(at)
        self._show(self.run.q[number], "", number)

    def _show(self, q: Array, message: str, sample: int | None = None, *, held: bool = False) -> None:
        """Show a posture.

        Args:
            q: The posture, shape (nq,).
            message: Why a drag stopped, or an empty text.
            sample: Number of the motion's sample, or None.
            held: Whether a user holds the handle of the tool.
        """
        self.q = q
        with self.server.atomic():
            self.stage.place(place_bodies(self.robot, q))
            if not held:
                self._place_grip()
        now = time.monotonic()
        if self.playing and now - self._bars_at < BARS:
            return
        self._bars_at = now
        self._bars(q, sample)
        looped = any(module.closures for module in self.robot.modules)
        self._status.content = status_html(
            message, float(closure_residual(self.robot, q)) if looped else None
        )

    def _bars(self, q: Array, sample: int | None) -> None:
        self._sliders.show(q)
        try:
            self._closeness.content = closeness_html(closeness(self.robot, q))
        except HybridynError:  # the posture has no measures
            self._closeness.content = ""
        if sample is not None and self.run is not None:
            tau, origin = None if self.run.tau is None else self.run.tau[sample], self.run.origin
        else:
            tau, origin = holding(self.robot, q)
            origin = origin or "that hold it at rest"
        self._efforts.content = efforts_html(
            self.robot, tau, self._span if sample is not None else tau, origin
        )
