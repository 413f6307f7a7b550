"""The arm and the pictures, as the hub asks of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from app.api.fields import Rates
from app.control import commands as cmd
from app.control.choices import Choice
from app.control.ledger import Entry
from app.control.margins import Margins
from app.control.pouring import Pouring
from app.control.state import State
from app.control.things import Surroundings
from app.exchange.machine import Machine
from app.gateway.nodes import Nodes
from app.geometry.arrays import FloatArray
from app.kinematics.velocity import JogFrame
from app.programs.bench import Rig
from app.robot.model import RobotModel
from app.runtime.board import Snapshot
from app.runtime.lateness import Lateness


class Arm(Protocol):
    """What the gateway asks of the arm; ``Motion`` is one."""

    @property
    def model(self) -> RobotModel | Machine: ...

    @property
    def robot(self) -> RobotModel: ...

    @property
    def nodes(self) -> Nodes: ...

    @property
    def snapshot(self) -> Snapshot: ...

    @property
    def state(self) -> State: ...

    @property
    def ready(self) -> FloatArray: ...

    @property
    def rig(self) -> Rig: ...

    @property
    def lateness(self) -> Lateness: ...

    @property
    def surroundings(self) -> Surroundings: ...

    @property
    def pouring(self) -> Pouring | None: ...

    @property
    def holding(self) -> FloatArray | None: ...

    @property
    def margins(self) -> Margins: ...

    @property
    def ledger(self) -> Sequence[Entry]: ...

    @property
    def caught_up(self) -> bool: ...

    @property
    def busy(self) -> bool: ...

    @property
    def age(self) -> float: ...

    def beat(self) -> None: ...

    def stop(self) -> int: ...

    def release(self) -> None: ...

    def hold(self) -> None: ...

    def jog(self, rates: Rates, frame: JogFrame) -> None: ...

    def limit(self, share: float) -> None: ...

    def put(self, command: cmd.Command) -> int: ...

    def choices(self) -> tuple[Choice, ...]: ...


class Behind(Protocol):
    """How far a window's picture is behind; ``Flow`` is one."""

    def age(self, t: float) -> float: ...
