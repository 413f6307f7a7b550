"""Interfaces of the arm and of the pictures that the hub uses."""

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
from katana450.arm.control.silence import SilenceProfile
from katana450.arm.control.state import Outcome, State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.state_publisher import Snapshot
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.service.nodes import Nodes


class ArmInterface(Protocol):
    """Interface of the arm for the gateway; ``ArmHandle`` implements it."""

    @property
    def robot(self) -> Robot:
        """The robot: an arm, or a mechanism that has only joints."""

    @property
    def arm(self) -> MountedArm:
        """The arm. Raises InputError for a mechanism that has only joints."""

    @property
    def nodes(self) -> Nodes:
        """Everything that has a name in the VRML world of the arm."""

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot."""

    @property
    def state(self) -> State:
        """The newest state."""

    @property
    def ready(self) -> FloatArray:
        """(n,) Posture to which Home moves [rad]."""

    @property
    def session(self) -> Session:
        """The rules of the robot."""

    @property
    def loop_timing(self) -> LoopTiming:
        """The recent timing of the control loop."""

    @property
    def profile(self) -> SilenceProfile:
        """The reaction of the moving arm to silence."""

    @property
    def environment(self) -> Environment:
        """The environment, which computes the poses of objects."""

    @property
    def pouring(self) -> Pouring | None:
        """The model of the water; None without one."""

    @property
    def holding(self) -> FloatArray | None:
        """(n,) Torques that hold the arm at rest [N m]; None where its masses are unknown."""

    @property
    def margins(self) -> Margins:
        """Distances to limits, singularity and contact. Raises InputError without an arm."""

    @property
    def event_log(self) -> Sequence[LogEntry]:
        """Recent entries of the event log, the oldest first."""

    @property
    def caught_up(self) -> bool:
        """True if the newest state includes every command."""

    @property
    def clear_refusal(self) -> str:
        """Reason for which a stop cannot be cleared yet; empty if it can be cleared."""

    @property
    def busy(self) -> bool:
        """True while a path is being planned that the arm will then follow."""

    @property
    def planning_failure(self) -> str:
        """Reason for which the path of the newest command was not found; else empty."""

    @property
    def age(self) -> float:
        """Time since the arm's process last proved that its control loop runs [s]."""

    def heartbeat(self, drivers: tuple[str, ...]) -> None:
        """Send a heartbeat of the server, with its drivers, to the arm's process."""

    def deliver(self, command: cmd.Command, actor: Actor) -> int:
        """Send ``command`` of ``actor``; return its ticket. Raises InputError if refused."""

    def outcome(self, ticket: int) -> Future[Outcome]:
        """Return the outcome of the command of ``ticket``, once it is reported."""

    def choices(self) -> tuple[BranchOption, ...]:
        """Return the branches that can be chosen. Raises InputError where there are none."""


class MeasuresAge(Protocol):
    """Interface for the age of a window's picture; ``Flow`` implements it."""

    def age(self, t: float) -> float:
        """Return the age of the picture [s] at time ``t`` [s]."""
