"""The joints of a leader that the joints of the arm follow, with directions and zero angles.

The default is the SO-101 of TheRobotStudio. Its joints have the structure of the arm: pan, three
parallel axes, roll, jaw. The angles are derived from the joint frames of the description
``so101_new_calib.urdf``, whose zero posture is the middle of all ranges: there the line from
shoulder to elbow rises by 76.0 degrees, the line from elbow to wrist by 2.2 degrees, and the hand
is horizontal. Both bend downwards for positive angles. The arm's own links are horizontal at zero.
So the directions of upper arm, forearm and hand are equal on leader and arm with these offsets.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import yaml
from msgspec import Meta

from katana450.errors import InputError

MAX_BYTES = 64_000
"""Maximum size of a layout file."""


class AxisSource(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joint of the leader that one joint of the arm follows.

    Attributes:
        motor: name of the motor in the calibration file.
        sign: whether both turn in the same direction.
        offset: angle of the arm's joint in the middle of the motor's range [deg].
    """

    motor: str
    sign: Literal[1, -1] = 1
    offset: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0


class FingerSource(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joint of the leader that the fingers follow.

    Attributes:
        motor: name of the motor in the calibration file.
        reversed: whether the fingers are open at the lower end of its range.
    """

    motor: str
    reversed: bool = False


class Layout(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The joints of a leader.

    Attributes:
        axes: one for each joint of the arm.
        gripper: that of the fingers; None for a leader without one.
    """

    axes: Annotated[tuple[AxisSource, ...], Meta(min_length=1)]
    gripper: FingerSource | None = None


SO101 = Layout(
    (
        # The leader's pan turns about its axis downwards, the arm's about its axis upwards.
        AxisSource("shoulder_pan", -1),
        AxisSource("shoulder_lift", 1, -76.0),
        AxisSource("elbow_flex", 1, 73.8),
        AxisSource("wrist_flex", 1, 2.2),
        # The leader's roll turns about its axis backwards, the arm's about its axis forwards.
        AxisSource("wrist_roll", -1),
    ),
    FingerSource("gripper"),
)
"""The SO-101 leader. The page has the same numbers in static/leader/follower.js."""


def read_layout(path: Path) -> Layout:
    """Return the layout in the YAML file ``path``. Raises InputError with what is wrong in it."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise InputError(f"{path} has more than {MAX_BYTES} bytes.")
        return msgspec.convert(yaml.safe_load(data), Layout)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except (msgspec.MsgspecError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} is not the layout of a leader: {error}. docs/leader.md has an example."
        ) from error
