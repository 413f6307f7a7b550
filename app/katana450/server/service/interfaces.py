"""The arm and the pictures, as the hub asks of them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Protocol

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.arm.control.branch_options import BranchOption
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.margins import Margins
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.scene_objects import Environment
from katana450.arm.control.session import Session
from katana450.arm.control.state import Outcome, State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.state_publisher import Snapshot
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.service.nodes import Nodes


class ArmInterface(Protocol):
    """What the gateway asks of the arm; ``ArmHandle`` is one."""

    @property
    def robot(self) -> Robot: ...

    @property
    def arm(self) -> MountedArm: ...

    @property
    def nodes(self) -> Nodes: ...

    @property
    def snapshot(self) -> Snapshot: ...

    @property
    def state(self) -> State: ...

    @property
    def ready(self) -> FloatArray: ...

    @property
    def session(self) -> Session: ...

    @property
    def loop_timing(self) -> LoopTiming: ...

    @property
    def environment(self) -> Environment: ...

    @property
    def pouring(self) -> Pouring | None: ...

    @property
    def holding(self) -> FloatArray | None: ...

    @property
    def margins(self) -> Margins: ...

    @property
    def event_log(self) -> Sequence[LogEntry]: ...

    @property
    def caught_up(self) -> bool: ...

    @property
    def busy(self) -> bool: ...

    @property
    def age(self) -> float: ...

    def heartbeat(self) -> None: ...

    def deliver(self, command: cmd.Command, actor: Actor) -> int: ...

    def outcome(self, ticket: int) -> Future[Outcome]: ...

    def choices(self) -> tuple[BranchOption, ...]: ...


class MeasuresAge(Protocol):
    """How far a window's picture is behind; ``Flow`` is one."""

    def age(self, t: float) -> float: ...
