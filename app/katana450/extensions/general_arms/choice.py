"""The choice of the kinematics of a chain: a closed form where one exists, else numerical."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from katana450 import tolerances
from katana450.errors import RobotDescriptionError
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.links import FINE, exact_chain, links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.offset_wrist import OffsetWrist
from katana450.extensions.general_arms.refinement import FileRounding
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics, Kinematics


class ExactArm(NamedTuple):
    """A chain to drive, and notes on what was changed in that of its file."""

    chain: Chain
    notes: tuple[str, ...]


@lru_cache(maxsize=64)
def kinematics_of(chain: Chain) -> Kinematics:
    """Return the inverse kinematics of `chain`; the result is cached.

    Five axes of the family have the core's closed form. Four, six and seven axes have those of this
    package if their axes meet or are parallel as these need. All others are solved numerically, and
    `Kinematics.method` says which condition they miss. A closed form takes the angles and lengths
    that are rounded in a file as exact, and corrects its solutions by the difference.
    """
    links = links_of(chain)
    why = f"there is no closed form for {chain.n} axes"
    if any(chain.slides):
        why = "a joint slides"
    elif chain.n == 5:
        try:
            arm_of(chain)
        except RobotDescriptionError as error:
            why = str(error).removeprefix("The closed-form kinematics do not cover this arm: ")
            why = why.partition(". For right")[0].removesuffix(".")
        else:
            return FiveAxisKinematics(chain)
    elif chain.n in (4, 6, 7):
        closed = SevenAxes.of(chain) if chain.n == 7 else ClosedForm.of(chain, links)
        if not isinstance(closed, str):
            return closed
        offset = OffsetWrist.of(chain, links) if chain.n == 6 else ""
        if not isinstance(offset, str):
            return offset
        why = f"{closed}, and {offset}" if offset else closed
    return Numerical(chain, links_of(chain, exact=False), why)


def exact_arm(described: Chain) -> ExactArm:
    """Return the chain with exact axes for which the closed form of `described` holds.

    An arm that is solved numerically stays as it is, and so does one with an offset wrist, whose
    postures are refined. So does one whose file rounds by at most FINE, if that moves the tool by
    more than FAMILY_EXACT.
    """
    if kinematics_of(described).file_offset is None:
        return ExactArm(described, ())
    links = links_of(described)
    angle, length = links.rounding
    rounding = FileRounding(described, links)
    if rounding.offset <= tolerances.FAMILY_EXACT:
        return ExactArm(exact_chain(described, links), ())
    if max(angle, length) <= FINE:
        return ExactArm(described, ())
    note = (
        "Its axes deviate from right angles, parallels or meeting points by at most "
        f"{math.degrees(angle):.2g} deg and {1e3 * length:.2g} mm; the nearest exact arm is used."
    )
    return ExactArm(exact_chain(described, links), (note,))
