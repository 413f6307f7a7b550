"""The effect of every command in every mode of the session: the table that the session obeys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from katana450.arm.control import commands as cmd
from katana450.arm.control.modes import (
    MODES,
    Following,
    Idle,
    Jogging,
    Mode,
    Positioning,
    Servoing,
    Tracking,
)
from katana450.arm.control.state import State


class Effect(Enum):
    """The effect of a command on the mode.

    A command can still be refused for a reason of its own, which is then a finding: a plan, because
    the arm does not stand at its start.
    """

    ACCEPTED = "accepted"
    """It takes effect, and the mode stays as it is."""
    CONTINUES = "continues"
    """The mode goes on with what the command says."""
    SUPERSEDES = "supersedes"
    """Another mode begins, and nothing of the present one is left."""
    REFUSED = "refused"
    """Nothing changes."""


A, C, S, R = Effect


@dataclass(frozen=True)
class Row:
    """The effects of one command.

    begins: the mode that it begins where it supersedes; None where it never does.
    effects: by mode.
    """

    begins: type[Mode] | None
    effects: Mapping[type[Mode], Effect]


def _row(begins: type[Mode] | None, *effects: Effect) -> Row:
    return Row(begins, dict(zip(MODES, effects, strict=True)))


TABLE: Mapping[type[cmd.Command], Row] = {
    # begins                         Idle Pos. Trac Jog. Serv Foll
    cmd.SetJoint: _row(Positioning,     S,   S,   S,   S,   S,   S),
    cmd.SetAxes: _row(Positioning,      S,   S,   S,   S,   S,   S),
    cmd.SetJoints: _row(Positioning,    S,   S,   S,   S,   S,   S),
    cmd.Home: _row(Positioning,         S,   S,   S,   S,   S,   S),
    cmd.Stretch: _row(Positioning,      S,   S,   S,   S,   S,   S),
    cmd.SetPose: _row(Positioning,      S,   S,   S,   S,   S,   S),
    cmd.TakeBranch: _row(Positioning,   S,   S,   S,   S,   S,   S),
    cmd.MoveTool: _row(Tracking,        S,   S,   C,   S,   S,   S),
    cmd.TurnTool: _row(Tracking,        S,   S,   C,   S,   S,   S),
    cmd.Settle: _row(Positioning,       A,   S,   C,   R,   R,   R),
    cmd.Jog: _row(Jogging,              S,   S,   S,   C,   S,   S),
    cmd.Servo: _row(Servoing,           S,   S,   S,   S,   C,   S),
    cmd.Follow: _row(Following,         S,   S,   S,   S,   S,   S),
    cmd.GoAlong: _row(None,             R,   R,   R,   R,   R,   C),
    cmd.Stop: _row(Idle,                S,   S,   S,   S,   S,   S),
    cmd.Release: _row(Idle,             S,   S,   S,   S,   S,   S),
    cmd.Reset: _row(Idle,               S,   S,   S,   S,   S,   S),
    # The target was one of the other tool frame; the goal stays.
    cmd.SetTool: _row(Positioning,      A,   S,   S,   S,   S,   A),
    # A tool target is projected anew.
    cmd.SetReading: _row(None,          A,   C,   C,   A,   A,   A),
    cmd.Pause: _row(None,               A,   A,   A,   A,   A,   A),
    cmd.Resume: _row(None,              A,   A,   A,   A,   A,   A),
    cmd.SpeedScale: _row(None,          A,   A,   A,   A,   A,   A),
    cmd.SetGripper: _row(None,          A,   A,   A,   A,   A,   A),
    cmd.Place: _row(None,               A,   A,   A,   A,   A,   A),
    cmd.Shift: _row(None,               A,   A,   A,   A,   A,   A),
    cmd.Attach: _row(None,              A,   A,   A,   A,   A,   A),
    cmd.Furnish: _row(None,             A,   A,   A,   A,   A,   A),
    cmd.Remove: _row(None,              A,   A,   A,   A,   A,   A),
    cmd.Fill: _row(None,                A,   A,   A,   A,   A,   A),
    cmd.Dress: _row(None,               A,   A,   A,   A,   A,   A),
    # Each of its commands has the effect of its own row.
    cmd.Together: _row(None,            A,   A,   A,   A,   A,   A),
}  # fmt: skip

WHILE_STOPPED = (cmd.Stop, cmd.Release, cmd.SpeedScale, cmd.Together, *cmd.THINGS)
"""The commands that are not refused while a stop holds the arm."""

NOT_WHILE_PAUSED = (cmd.Jog,)
"""The commands that are refused during a pause: a jog has no goal to be kept for later."""


def effect_of(command: cmd.Command, state: State) -> Effect:
    """The effect that ``command`` has on ``state``."""
    if state.stopped is not None and not isinstance(command, WHILE_STOPPED):
        return Effect.REFUSED
    if state.paused and isinstance(command, NOT_WHILE_PAUSED):
        return Effect.REFUSED
    return TABLE[type(command)].effects[type(state.intent)]
