"""The effect of every command in every mode of the session: the table that the session obeys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.modes import (
    MODES,
    Following,
    Idle,
    Jogging,
    Mode,
    Positioning,
    Servoing,
    Tracking,
)
from katana450.arm.control.state.state import State


class Effect(Enum):
    """The effect of a command on the mode.

    A command can still be refused for a reason of its own, which is then a finding. For example,
    a plan is refused if the arm does not stand at its start.
    """

    ACCEPTED = "accepted"
    """The command takes effect, and the mode stays."""
    CONTINUES = "continues"
    """The mode continues with the values of the command."""
    SUPERSEDES = "supersedes"
    """Another mode begins, and no data of the present one is left."""
    REFUSED = "refused"
    """Nothing changes."""


A, C, S, R = Effect


@dataclass(frozen=True)
class Row:
    """The effects of one command.

    Attributes:
        begins: the mode that the command begins where it supersedes; None if it never does, or if
            that is the mode of a state that it brings.
        effects: the effect in each mode.
    """

    begins: type[Mode] | None
    effects: Mapping[type[Mode], Effect]


def _row(begins: type[Mode] | None, *effects: Effect) -> Row:
    return Row(begins, dict(zip(MODES, effects, strict=True)))


TABLE: Mapping[type[cmd.Command], Row] = {
    # begins                          Idle Pos. Trk. Jog. Srv. Fol.
    cmd.AxisCommand: _row(Positioning, S,   S,   S,   S,   S,   S),
    cmd.Joints: _row(Positioning,      S,   S,   S,   S,   S,   S),
    cmd.Home: _row(Positioning,        S,   S,   S,   S,   S,   S),
    cmd.GoToZero: _row(Positioning,    S,   S,   S,   S,   S,   S),
    cmd.Pose: _row(Positioning,        S,   S,   S,   S,   S,   S),
    cmd.Branch: _row(Positioning,      S,   S,   S,   S,   S,   S),
    cmd.Position: _row(Tracking,       S,   S,   C,   S,   S,   S),
    cmd.Turn: _row(Tracking,           S,   S,   C,   S,   S,   S),
    cmd.Orient: _row(Tracking,         S,   S,   C,   S,   S,   S),
    cmd.StepTool: _row(Tracking,       S,   S,   C,   S,   S,   S),
    cmd.EndDrag: _row(Positioning,     A,   S,   C,   R,   R,   R),
    cmd.Jog: _row(Jogging,             S,   S,   S,   C,   S,   S),
    cmd.TurnElbow: _row(Jogging,       S,   S,   S,   C,   S,   S),
    cmd.Servo: _row(Servoing,          S,   S,   S,   S,   C,   S),
    cmd.Follow: _row(Following,        S,   S,   S,   S,   S,   S),
    # The mode is that of the restored state.
    cmd.RestoreState: _row(None,       S,   S,   S,   S,   S,   S),
    cmd.Stop: _row(Idle,               S,   S,   S,   S,   S,   S),
    cmd.ClearStop: _row(Idle,          S,   S,   S,   S,   S,   S),
    # A jog ends along its twist, as without renewal.
    cmd.Hold: _row(Idle,               S,   S,   S,   C,   S,   S),
    # A target refers to the earlier tool frame, so it ends; the goal stays.
    cmd.Tool: _row(Positioning,        A,   S,   S,   S,   S,   A),
    # A tool target is projected again.
    cmd.SetPriority: _row(None,        A,   C,   C,   A,   A,   A),
    cmd.Pause: _row(None,              A,   A,   A,   A,   A,   A),
    cmd.Resume: _row(None,             A,   A,   A,   A,   A,   A),
    cmd.Speed: _row(None,              A,   A,   A,   A,   A,   A),
    cmd.Gripper: _row(None,            A,   A,   A,   A,   A,   A),
    cmd.PlaceObject: _row(None,        A,   A,   A,   A,   A,   A),
    cmd.MoveObject: _row(None,         A,   A,   A,   A,   A,   A),
    cmd.Attach: _row(None,             A,   A,   A,   A,   A,   A),
    cmd.ReplaceScene: _row(None,       A,   A,   A,   A,   A,   A),
    cmd.Remove: _row(None,             A,   A,   A,   A,   A,   A),
    cmd.Fill: _row(None,               A,   A,   A,   A,   A,   A),
    # The driver performs the act; the session has stopped.
    cmd.OperateArm: _row(None,         A,   A,   A,   A,   A,   A),
    # Each of its commands has the effect of its own row.
    cmd.Batch: _row(None,              A,   A,   A,   A,   A,   A),
}  # fmt: skip


def row_of(kind: type[cmd.Command]) -> Row:
    """Return the row of a class of commands: its own, or that of its nearest base."""
    return next(TABLE[base] for base in kind.__mro__ if base in TABLE)


def effect_of(command: cmd.Command, state: State) -> Effect:
    """Return the effect that ``command`` has on ``state``."""
    if state.stopped is not None and not command.traits.while_stopped:
        return Effect.REFUSED
    if state.paused and not command.traits.while_paused:
        return Effect.REFUSED
    return row_of(type(command)).effects[type(state.intent)]
