"""Priority between the six numbers of a target pose, for an arm that cannot satisfy all of them."""

from __future__ import annotations

from enum import Enum


class Priority(Enum):
    """The part of a target that is kept when the arm cannot satisfy all of it.

    PITCH and POSITION take the yaw from the arm. Their pitch is that of the roll axis below the
    horizontal, past the vertical when it points inwards. PITCH also accepts the same slope with the
    tool facing the other way: a pose that the arm can take is kept as it is; otherwise a direction
    that the roll of the target fits is preferred, then the nearer position.

    Arms of other kinds have POSE, POSITION and ORIENTATION; these take no yaw from the arm.

    Attributes:
        POSE: position, then the whole orientation as near as possible in angle.
        PITCH: the pitch, then the nearest position with it, then the roll.
        POSITION: position, then the nearest pitch inside the limits, then the roll. Arms of other
            kinds leave the orientation free.
        ORIENTATION: the orientation, then the nearest position with it.
    """

    POSE = "pose"
    PITCH = "position and pitch"
    POSITION = "position"
    ORIENTATION = "orientation"
