"""The drawing in the windows that play back: the recorded arm, its objects and its water."""

from __future__ import annotations

import threading
from collections.abc import Callable
from weakref import WeakKeyDictionary

import numpy as np
import viser

from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.session.session import Session
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.programs.server.preview import SAME_PLACE, GhostScene
from katana450.extensions.recording.playback.rows import RecordedMoment, still_flying
from katana450.server.service.hub import Hub
from katana450.server.view.layer import FolderContext
from katana450.server.view.scene import Colour, GhostNodes, Window, node_name
from katana450.server.viser_bridge.gestures import Gestures

COLOURS: tuple[Colour, Colour] = ((255, 153, 0), (64, 156, 255))
"""Colours of the recorded arm, and of that of a second run."""

OPACITIES = (0.92, 0.45)
"""Their opacities (0 to 1)."""

ROOT = "/playback"
"""Node above everything that is played back."""


class RunDrawing:
    """The nodes of one run in one window."""

    def __init__(self, client: Window, robot: Robot, number: int) -> None:
        """Draw at ``client``. ``number``: 0, or 1 for the second run."""
        self._robot, self._colour = robot, COLOURS[number]
        root, opacity = f"{ROOT}/{number}", OPACITIES[number]
        self._arm = GhostNodes(client, robot, f"{root}/arm", self._colour, opacity)
        # Objects look as they did; those of a second run have its colour.
        self._scene = GhostScene(client, self._colour if number else None, opacity, root)

    def show(self, moment: RecordedMoment, session: Session, other: RecordedMoment | None) -> None:
        """Show ``moment``, without the objects that stand as in ``other``."""
        row = moment.row
        self._arm.move(self._robot.joint_values(np.array(row.joints), row.gripper))
        self._arm.show(True, self._colour)
        poses = {} if other is None else {body.name: body.T for body in other.objects}
        moved = [
            body
            for body in moment.objects
            if body.name not in poses or np.abs(body.T - poses[body.name]).max() > SAME_PLACE
        ]
        self._scene.place([(body, body.T) for body in moved])
        with_cup = any(body.name == CUP for body in moved)
        water = moment.water if with_cup else None
        if water is not None and session.pouring is not None:
            water = still_flying(water, session.pouring.water_environment(moment.objects))
        self._scene.pour(session, moment.objects, water)

    def hide(self) -> None:
        """Show nothing."""
        self._arm.show(False, self._colour)
        self._scene.hide()


class _Window:
    """One window: its end at viser, and its drawings."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self.client = client
        self.runs: dict[int, RunDrawing] = {}
        self.lock = threading.Lock()


class PlaybackWindows:
    """The windows that play back. For any thread."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        gestures: Gestures,
        session: Callable[[], Session],
    ) -> None:
        """Draw in windows of ``server``. ``session`` returns the rules of the arm."""
        self._server, self._robot = server, robot
        self._gestures, self._session = gestures, session
        self._windows: dict[int, _Window] = {}
        self._lock = threading.Lock()

    def check(self, moment: RecordedMoment) -> None:
        """Raise InputError if ``moment`` is one of a robot with other joints."""
        joints, recorded = len(self._session().ready), len(moment.row.joints)
        if recorded != joints:
            raise InputError(
                f"The recording is one of a robot with {recorded} joints, not {joints}."
            )

    @property
    def moving(self) -> list[str]:
        """The nodes of the present arm's links that move, which are drawn at another place."""
        paths: dict[str | None, str] = {None: "/arm"}
        nodes = []
        for link in self._robot.links:
            paths[link.name] = f"{paths[link.parent]}/{node_name(link.name)}"
            if link.name in self._robot.moving and link.parent not in self._robot.moving:
                nodes.append(paths[link.name])
        return nodes

    def show(self, key: str, moments: tuple[RecordedMoment | None, ...]) -> None:
        """Show ``moments`` in the window of the participant ``key``, one for each run.

        Raises InputError if the window has no scene, or for another robot.
        """
        window = self._window(key)
        if window is None:
            raise InputError("This window shows no scene yet. Wait until it is drawn.")
        for moment in moments:
            if moment is not None:
                self.check(moment)
        session = self._session()
        with window.lock, window.client.atomic():
            for number in range(len(COLOURS)):
                moment = moments[number] if number < len(moments) else None
                drawing = window.runs.get(number)
                if moment is not None:
                    if drawing is None:
                        drawing = RunDrawing(window.client, self._robot, number)
                        window.runs[number] = drawing
                    drawing.show(moment, session, moments[0] if number else None)
                elif drawing is not None:
                    drawing.hide()
        window.client.flush()

    def hide(self, key: str) -> None:
        """Show nothing recorded in the window of the participant ``key``."""
        window = self._window(key)
        if window is not None:
            with window.lock, window.client.atomic():
                for drawing in window.runs.values():
                    drawing.hide()
            window.client.flush()

    def _window(self, key: str) -> _Window | None:
        number = self._gestures.client_of(key)
        clients = self._server.get_clients()
        with self._lock:
            for client in self._windows.keys() - clients.keys():
                del self._windows[client]
            if number is None or number not in clients:
                return None
            return self._windows.setdefault(number, _Window(clients[number]))


CONTEXTS: WeakKeyDictionary[Hub, FolderContext] = WeakKeyDictionary()
"""The context of the view of each server, which has one once its scene is there."""


class PlaybackFolder:
    """A folder without controls: those of play back are in the page around viser."""

    def __init__(self, context: FolderContext) -> None:
        """Let the windows of ``context`` play back."""
        CONTEXTS[context.hub] = context

    def follow(self) -> None:
        """Do nothing: what is played back follows its window, not the arm."""
