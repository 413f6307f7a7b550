"""The view of a robot that can only be driven joint by joint."""

from __future__ import annotations

import time

import viser

from katana450.arm.robot.camera import camera
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.mailbox import CommandSink
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.server.view.follower import Follower
from katana450.server.view.machine_nodes import MachineNodes
from katana450.server.view.machine_panel import MachinePanel
from katana450.server.view.paint import PaintNodes
from katana450.server.view.room import furnish
from katana450.server.view.texts import title


class MachineView(Follower):
    """Its links, and a panel of its joints. There is nothing to be dragged."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        board: StatePublisher,
        sink: CommandSink,
        frame_rate: float,
    ) -> None:
        """``sink`` takes what people do. ``frame_rate``: most updates a second [Hz]."""
        super().__init__(server, board, frame_rate)
        self._robot = robot
        self._sink = sink
        furnish(server)
        server.gui.set_panel_label(title(robot.name))
        look = camera(robot)
        server.initial_camera.position = look.eye
        server.initial_camera.look_at = look.target
        self._nodes = MachineNodes(server, robot)
        self._paint = PaintNodes(server, self._nodes)
        self._panel = MachinePanel(server.gui, robot.joint_group, sink.put, board.snapshot.state)
        self.show(board.snapshot)

    def let_go(self) -> None:
        return

    def show(self, snapshot: Snapshot) -> None:
        state = snapshot.state
        with self._server.atomic():
            self._nodes.move(self._robot.joint_values(state.q, state.gripper))
            self._paint.follow(state)
            self._panel.follow(
                state,
                time.perf_counter(),
                self._board.ledger,
                caught_up=snapshot.ticket == self._sink.last_ticket,
            )
        self._server.flush()
