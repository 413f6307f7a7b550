"""A 3D scene of the arm in a browser or a notebook, served from this process."""

from __future__ import annotations

import atexit
import contextlib
import html
import io
import threading
import time
from collections.abc import Callable
from typing import Self

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError, InputError
from katana450.extensions.conduit import ConduitLayer
from katana450.extensions.water import WaterLayer
from katana450.library.motion_plan import MotionPlan
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.controls import NoGestures
from katana450.server.view.scenery import Scenery
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset

FRAME_TIME = 1.0 / 60.0
"""[s] Time from one frame to the next."""

PAUSE = 1.0
"""[s] Pause at the end of a plan, before it is shown again."""

PATH_POINTS = 400

PATH_COLOUR = (64, 156, 255)


class Viewer:
    """A viser server that shows the arm and its environment; made by `Arm.show`.

    In a notebook the last line of a cell shows the scene below it. The scene is only a picture:
    nothing in it moves a simulated or real arm.
    """

    def __init__(
        self,
        robot: Robot,
        session: Session,
        standing: Callable[[npt.ArrayLike], State],
        T_base_frame: FloatArray,
        port: int,
        host: str,
    ) -> None:
        """Serve a scene of ``robot`` at ``host``, on ``port`` or the next free one above it.

        Args:
            robot: the arm and its shapes.
            session: the rules of its motion.
            standing: returns the state in which it stands at joint angles (n,) [rad].
            T_base_frame: (4, 4) maps coordinates of the frame of poses into the base [m].
            port: TCP port.
            host: address.

        Raises ConfigurationError if no port can be opened.
        """
        self._standing, self._T_base_frame = standing, T_base_frame
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                self._server = viser.ViserServer(host=host, port=port, verbose=False)
        except OSError as error:
            raise ConfigurationError(f"No scene can be served at {host}: {error}.") from error
        self.url = f"http://{host}:{self._server.get_port()}"
        """Address of the scene, for a browser."""
        scene = self._server.scene
        scene.set_up_direction("+z")
        look = CAMERA_POSES[Preset.FREE]
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = look.position, look.target, FOV
        parts = (self._server, robot, session, load_props(), NoGestures(), Meshes())
        self._scenery = Scenery(*parts, layers=(ConduitLayer(), WaterLayer()))
        self._path = scene.add_line_segments(
            "/path", np.zeros((1, 2, 3), np.float32), PATH_COLOUR, thickness=0.003, visible=False
        )
        self._player: threading.Thread | None = None
        self._stopped = threading.Event()
        self._closed = threading.Event()
        self._show(session.ready)
        # Runs before viser's own exit handler, so that the player never uses a stopped server.
        atexit.register(self.close)

    def move(self, q: npt.ArrayLike) -> None:
        """Show the arm at the joint angles ``q`` (n,) [rad]; ends `play`.

        Raises InputError if ``q`` is not n finite angles.
        """
        state = self._standing(q)
        self.pause()
        self._scenery.show(state)

    def play(self, plan: MotionPlan, speed: float = 1.0) -> None:
        """Draw the tool's path and show the motion repeatedly, in a separate thread.

        ``speed``: factor on real time, above 0. Raises InputError for another ``speed``.
        """
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"The speed is {speed!r}; give a number above 0.")
        samples = plan.sample(max(FRAME_TIME * speed, plan.duration / 100_000))
        T_base_frame = self._T_base_frame
        points = plan.sample(plan.duration / PATH_POINTS).points
        points = points @ T_base_frame[:3, :3].T + T_base_frame[:3, 3]
        self.pause()
        self._path.points = np.stack((points[:-1], points[1:]), axis=1).astype(np.float32)
        self._path.visible = True
        self._stopped = threading.Event()
        self._player = threading.Thread(
            target=self._run,
            args=(samples.t / speed, samples.q, self._stopped),
            name="katana450 viewer",
            daemon=True,
        )
        self._player.start()

    def pause(self) -> None:
        """End `play`; the arm stays where it is."""
        self._stopped.set()
        if self._player is not None:
            self._player.join()
            self._player = None

    def wait(self) -> None:
        """Keep the scene until Ctrl-C is pressed or the viewer is closed: for scripts."""
        with self, contextlib.suppress(KeyboardInterrupt):
            self._closed.wait()

    def close(self) -> None:
        """End the scene and free its port."""
        self.pause()
        if self._closed.is_set():
            return
        self._closed.set()
        atexit.unregister(self.close)
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def __enter__(self) -> Self:
        """Return the viewer, which is closed at the end of the context."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the viewer."""
        self.close()

    def __repr__(self) -> str:
        """Return a short description."""
        return f"<katana450 viewer at {self.url}>"

    def _repr_html_(self) -> str:
        """Return the scene for a notebook."""
        source = html.escape(self.url)
        return f'<iframe src="{source}" width="100%" height="480" frameborder="0"></iframe>'

    def _run(self, t: FloatArray, q: FloatArray, stopped: threading.Event) -> None:
        """Show the postures ``q`` (N, n) [rad] at their times ``t`` (N,) [s] until ``stopped``."""
        while not stopped.is_set():
            started = time.monotonic()
            passed = 0.0
            while passed < t[-1] and not stopped.wait(FRAME_TIME):
                passed = time.monotonic() - started
                self._show(q[min(int(np.searchsorted(t, passed)), len(t) - 1)])
            stopped.wait(PAUSE)

    def _show(self, q: FloatArray) -> None:
        self._scenery.show(self._standing(q))
