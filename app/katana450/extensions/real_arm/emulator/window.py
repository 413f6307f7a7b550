"""A page of its own with the emulated arm where it really is, behind the wire."""

from __future__ import annotations

import contextlib
import io
import threading

import viser

from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError
from katana450.extensions.conduit.rings import Conduits
from katana450.extensions.real_arm.codec.axis_status import status_words
from katana450.extensions.real_arm.emulator.posture import joints_at
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.server.view.room import set_up_room
from katana450.server.view.scene import ArmNodes
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset

FRAME_TIME = 0.05
"""[s] Time from one frame to the next."""


class ArmWindow:
    """The arm behind the wire, in a browser. Nothing in it moves the arm.

    Attributes:
        url: address of the page.
    """

    def __init__(self, emulator: EmulatorServer, robot: Robot, host: str, port: int) -> None:
        """Serve the page. Raises ConfigurationError if the port cannot be opened."""
        self._emulator = emulator
        self._robot = robot
        try:
            # viser's own messages on the terminal would hide ours.
            with contextlib.redirect_stdout(io.StringIO()):
                self._server = viser.ViserServer(
                    host=host, port=port, label="The arm behind the wire", verbose=False
                )
        except OSError as error:
            raise ConfigurationError(f"No page can be served at {host}: {error}.") from error
        self.url = f"http://{host}:{self._server.get_port()}"
        self._server.scene.set_up_direction("+z")
        look, camera = CAMERA_POSES[Preset.FREE], self._server.initial_camera
        camera.position, camera.look_at, camera.fov = look.position, look.target, FOV
        set_up_room(self._server)
        self._nodes = ArmNodes(self._server, robot)
        self._conduit = Conduits(self._server, robot, self._nodes.path)
        self._text = self._server.gui.add_markdown("")
        self._shown = ""
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="window", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the page and free its port."""
        self._ending.set()
        self._thread.join()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _run(self) -> None:
        while not self._ending.wait(FRAME_TIME):
            self._show()

    def _show(self) -> None:
        with self._emulator.lock:
            arm = self._emulator.arm
            counts = arm.counts
            rows = [
                f"| {number} | {axis.position} | {status_words(axis.reported_status)} |"
                for number, axis in enumerate(arm.axes, 1)
            ]
            words = "calibrated" if arm.is_calibrated else "not calibrated"
        values = self._robot.joint_values(*joints_at(counts))
        text = "\n".join((f"This arm is {words}.\n", "| axis | encoder | |", "|--|--:|--|", *rows))
        with self._server.atomic():
            self._nodes.move(values)
            self._conduit.move(values)
            if text != self._shown:
                self._text.content = self._shown = text
        self._server.flush()
