"""Priority between the six numbers of a target pose on an arm with five axes."""

from __future__ import annotations

from enum import Enum


class Priority(Enum):
    """The part of a target that is kept when the arm cannot satisfy all of it.

    PITCH and POSITION take the yaw from the arm. Their pitch is that of the roll axis below the
    horizontal, past the vertical when it points inwards. PITCH also accepts the same slope with the
    tool facing the other way: a pose that the arm can take is kept as it is; otherwise the
    direction that keeps the roll is preferred, then the nearer one.

    Attributes:
        POSE: position, then the whole orientation as near as possible in angle.
        PITCH: the pitch, then the nearest position with it, then the roll.
        POSITION: position, then the nearest pitch inside the limits, then the roll.
    """

    POSE = "pose"
    PITCH = "position and pitch"
    POSITION = "position"
