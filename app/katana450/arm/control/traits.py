"""Traits of the commands: the properties of a command's class that other modules need.

A command declares them where it is defined. No other list decides who may give a
command, and when.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, kw_only=True)
class CommandTraits:
    """Traits of one class of commands. The default is a motion of an arm that has a tool.

    Attributes:
        stream: several in a row are one motion, so a newer one replaces one that waits for a tick.
        relative: counts from the present target, so that several in a row add up.
        while_stopped: takes effect while a stop holds the arm; all others are refused then.
        while_paused: takes effect during a pause. A jog does not: it has no goal to keep for later.
        supersedes: ends the motion or the program that is under way or being planned.
        passive: leaves a path that is being planned as it is; all others end the planning.
        pacing: may also be given by the owner of the running program, which holds the lease itself.
        protective: may also be given by the server itself, which never moves the arm.
        joints_only: possible for a mechanism that has joints and no tool.
        planned: a path is planned first, so the command takes effect later than its ticket.
        safety: may be given by every participant at any time, also without the lease. It is never
            refused, and commands that wait before it are dropped.
    """

    stream: bool = False
    relative: bool = False
    while_stopped: bool = False
    while_paused: bool = True
    supersedes: bool = True
    passive: bool = False
    pacing: bool = False
    protective: bool = False
    joints_only: bool = False
    planned: bool = False
    safety: bool = False

    def __post_init__(self) -> None:
        if self.passive and self.supersedes:
            raise ValueError("A command that supersedes a motion cannot be passive to planning.")


class BaseCommand:
    """Base of all commands. Each class declares ``traits``."""

    traits: ClassVar[CommandTraits]

    @property
    def parts(self) -> tuple[BaseCommand, ...]:
        """The single commands in this one."""
        return (self,)

    @property
    def sample(self) -> bool:
        """True if it is one of many in a row, which is refused when it arrives late.

        The hand may have let go since it was made.
        """
        return self.traits.stream or self.traits.relative

    def replaces(self, waiting: BaseCommand) -> bool:
        """Return whether ``waiting``, the newest command before this one, need not be executed."""
        return self.traits.stream and type(waiting) is type(self)
