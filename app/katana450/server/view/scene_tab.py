"""The tab "Scene" of the panel: objects, display options, and a problem of the event log."""

from __future__ import annotations

from collections.abc import Callable

import viser

from katana450.arm.control.scene_objects import Environment
from katana450.arm.control.state import State
from katana450.server.view.controls import GestureGate
from katana450.server.view.display_options import DisplayOptions, add_shows, add_themes, add_views
from katana450.server.view.event_list import problem_page
from katana450.server.view.objects_panel import ObjectsPanel


class SceneTab:
    """The controls of everything around the arm."""

    def __init__(
        self,
        server: viser.ViserServer,
        gestures: GestureGate,
        shows: DisplayOptions,
        state: Callable[[], State],
        environment: Environment,
    ) -> None:
        """Add the controls to the open tab of ``server``.

        Args:
            server: viser's server.
            gestures: The path of gestures to the arm.
            shows: The functions of the display controls.
            state: Returns the newest state.
            environment: The supports and links to which objects can be fixed.
        """
        gui = server.gui
        add_views(gui, shows)
        add_themes(gui)
        with gui.add_folder("Objects"):
            self._objects = ObjectsPanel(server, gestures, state, environment)
        with gui.add_folder("Show"):
            add_shows(gui, shows)
        self._gestures, self._problem = gestures, gui.add_html("", visible=False)

    def follow(self, state: State, *, caught_up: bool) -> None:
        """Show the objects of ``state``. ``caught_up``: see ``Panel.follow``."""
        self._objects.follow(state, caught_up=caught_up)
        content = problem_page(self._gestures.log_problem)
        if content != self._problem.content:
            self._problem.content, self._problem.visible = content, bool(content)
