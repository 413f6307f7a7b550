"""Which of a target's six numbers count on an arm with five axes."""

from __future__ import annotations

from enum import Enum


class Priority(Enum):
    """What a target asks for, and what gives way when the arm cannot do all of it.

    POSE: position, then the whole orientation as near as possible in angle. PITCH: the pitch, then
    the position as near as it comes with it, then the roll. POSITION: position, then the nearest
    pitch inside the limits, then the roll. PITCH and POSITION take the yaw from the arm, and the
    pitch is that of the roll axis below the horizontal, past the vertical when it points inwards.
    PITCH also accepts the same slope with the tool facing the other way: a pose the arm can take
    is kept as it is; otherwise the way that keeps the roll counts, then the nearer one.
    """

    POSE = "pose"
    PITCH = "position and pitch"
    POSITION = "position"
