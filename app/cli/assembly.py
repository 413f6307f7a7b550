"""The parts of a running app, put together."""

from __future__ import annotations

import sys
from pathlib import Path

from app.control.session import Session
from app.drivers.simulated import SimulatedDriver
from app.exchange.reachability_file import load_map
from app.gateway.gateway import Gateway
from app.gateway.motion import Motion
from app.robot.collision import standing_around, world_of
from app.robot.model import load
from app.robot.props import load_props
from app.runtime.clock import MonotonicClock
from app.runtime.loop import ControlLoop
from app.runtime.mailbox import Mailbox
from app.settings import Settings
from app.view.texts import UNCHECKED
from app.view.view import View


class Assembly:
    """A simulated arm, its control loop, and the view of it behind a gateway that is open."""

    def __init__(
        self,
        gateway: Gateway,
        settings: Settings,
        urdf: Path,
        tool: str | None,
        workspace: Path | None,
    ) -> None:
        """``urdf``, ``tool``: the arm, and the link its targets are set for; see ``load``.

        ``workspace``: file of a reachability map that can be shown.
        """
        stored = None if workspace is None else load_map(workspace)
        model = load(urdf, tool)
        world, left_out = world_of(model)
        notes = [*model.notes, *left_out]
        if world is None:
            notes.append(UNCHECKED)
        else:
            world = world.with_obstacles(standing_around(load_props()))
        for note in notes:
            print(f"katana450: {note}", file=sys.stderr)
        session = Session(model.arm, model.ready(settings.ready), world)
        driver = SimulatedDriver(model.arm, session.ready, gripper=0.0)
        mailbox = Mailbox(session.check)
        self._loop = ControlLoop(session, driver, mailbox, MonotonicClock(), settings.rate)
        self._view = View(
            gateway.viser,
            model,
            self._loop,
            mailbox,
            session.choices,
            settings.frame_rate,
            stored,
        )
        gateway.attach(Motion(model, session, self._loop, mailbox, self._view.let_go))

    def start(self) -> None:
        """Run the control loop and the view in threads of their own."""
        self._loop.start()
        self._view.start()

    def stop(self) -> None:
        """End both; the server closes with the view."""
        self._view.stop()
        self._loop.stop()
