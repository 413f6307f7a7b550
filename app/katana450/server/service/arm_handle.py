"""Access of the gateway to one arm: its state, its properties, and commands to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from concurrent.futures import Future

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import SilenceProfile, clear_refusal
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.findings import Margins, margins
from katana450.arm.control.state.state import Outcome, State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot, loads_of
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.pipes.front_end import FrontEnd
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.errors import InputError
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.statics import holding_torques
from katana450.server.api import answers, requests


class ArmHandle:
    """Handle of one arm. Everything may read it; only ``CommandGate`` may call ``deliver``."""

    def __init__(
        self,
        robot: Robot,
        session: Session,
        front_end: FrontEnd,
        planning_worker: PlanningWorker | None,
        nodes: Nodes,
    ) -> None:
        """Connect the arm to ``front_end``.

        ``planning_worker``: None for a mechanism that has only joints. ``nodes``: everything that
        has a name in the VRML world of the arm.
        """
        self.robot = robot
        self.nodes = nodes
        self.session = session
        self._front_end = front_end
        self._state_publisher = front_end.state_publisher
        self._planning_worker = planning_worker
        self._sink = front_end if planning_worker is None else planning_worker
        self._loads = loads_of(robot)
        self._measured: (
            tuple[tuple[str, CollisionWorld | None, bytes], tuple[Margins, FloatArray | None]]
            | None
        ) = None

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot."""
        return self._state_publisher.snapshot

    @property
    def profile(self) -> SilenceProfile:
        """The reaction of the moving arm to silence."""
        return self._front_end.profile

    @property
    def environment(self) -> Environment:
        """The environment, which computes the poses of objects."""
        return self.session.environment

    @property
    def arm(self) -> MountedArm:
        """The arm. Raises InputError with the reason for a mechanism that has only joints."""
        if self.robot.arm is None:
            raise InputError(self.robot.joint_group.refusal)
        return self.robot.arm

    @property
    def loop_timing(self) -> LoopTiming:
        """The recent timing of the control loop."""
        return self._state_publisher.loop_timing

    @property
    def holding(self) -> FloatArray | None:
        """(n,) Torques that hold the arm at rest [N m]; None where its masses are unknown."""
        return self._posture()[1] if self._loads else None

    @property
    def margins(self) -> Margins:
        """Distances to limits, singularity and contact.

        Raises InputError for a mechanism that has only joints.
        """
        return self._posture()[0]

    @property
    def nearest(self) -> Contact | None:
        """The two nearest parts; None for a mechanism without a tool, or if none can meet."""
        return None if self.robot.arm is None else self.margins.nearest

    def _posture(self) -> tuple[Margins, FloatArray | None]:
        """Return margins and torques, computed again only when tool, world or posture change."""
        state = self.state
        world, x = self.session.world_at(state), state.x
        key = (state.tool, world, x.tobytes())
        if self._measured is None or self._measured[0] != key:
            chain = self.arm.chain_to(state.tool)
            holding = holding_torques(chain, state.q, self._loads) if self._loads else None
            self._measured = (key, (margins(chain, world, x), holding))
        return self._measured[1]

    def choices(self) -> tuple[BranchOption, ...]:
        """Return the branches that can be chosen. Raises InputError where there are none."""
        return self.session.choices(self.state)

    def deliver(self, command: cmd.Command, actor: Actor) -> int:
        """Send ``command`` of ``actor``, whose right was checked; return its ticket.

        Raises InputError for a command that the arm cannot accept.
        """
        return self._sink.deliver(command, actor)

    def outcome(self, ticket: int) -> Future[Outcome]:
        """Return the outcome of the command of ``ticket``, once the arm's process reports it."""
        return self._state_publisher.outcomes.of(ticket)

    @property
    def state(self) -> State:
        """The newest state."""
        return self._state_publisher.snapshot.state

    @property
    def caught_up(self) -> bool:
        """True if the newest state includes every command."""
        return self.snapshot.ticket == self._front_end.last_ticket

    @property
    def clear_refusal(self) -> str:
        """Reason for which a stop cannot be cleared yet; empty if it can be cleared."""
        return clear_refusal(self.state, MonotonicClock().now())

    @property
    def busy(self) -> bool:
        """True while a path is being planned that the arm will then follow."""
        return self._planning_worker is not None and self._planning_worker.busy

    @property
    def planning_failure(self) -> str:
        """Reason for which the path of the newest command was not found; else empty."""
        return "" if self._planning_worker is None else self._planning_worker.failure

    def heartbeat(self) -> None:
        """Send a heartbeat of the server to the arm's process."""
        self._front_end.heartbeat()

    @property
    def age(self) -> float:
        """Time since the arm's process last proved that its control loop runs [s]."""
        return self._front_end.age


class Nodes(ABC):
    """Nodes of a robot and its environment by name."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def _values(self, state: State) -> Mapping[str, float]:
        return self._robot.joint_values(state.q, state.gripper)

    @abstractmethod
    def world(self, state: State) -> answers.World:
        """Return all nodes with their present values."""

    @abstractmethod
    def read(self, state: State, fields: Iterable[requests.FieldName]) -> tuple[answers.Value, ...]:
        """Return the present values of the fields. Raises InputError for an unknown name."""

    @abstractmethod
    def command(self, state: State, settings: Iterable[requests.FieldSetting]) -> cmd.Command:
        """Return the command that sets all fields. Raises InputError if one cannot be set."""
