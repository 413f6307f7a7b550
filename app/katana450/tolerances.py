"""All tolerances of the pure core, each with its unit and its reason."""

from __future__ import annotations

from typing import Final

# [1] Maximum deviation from orthonormal (largest entry of R^T R - I) of a matrix that is accepted
# as a rotation. A matrix printed with four decimals, whose rounding is at most 1.8e-4, passes; a
# scale or a shear does not.
ROTATION_INPUT: Final = 1e-3

# [1] Deviation from orthonormal (root mean square of six misfits) of a product of a few rotations
# in double precision. Orthonormalising it would only replace this rounding by another.
ROTATION_EXACT: Final = 4e-15

# [1] Maximum deviation of the last row of a pose from 0 0 0 1: rounding of a product of poses.
POSE_LAST_ROW: Final = 1e-9

# [1, m] Maximum deviation of a joint's screw axis from |omega| = 1 and from zero pitch.
SCREW: Final = 1e-9

# [1] Cosine of the pitch below which roll and yaw turn about one axis, so only their sum is known.
GIMBAL_LOCK: Final = 1e-9

# [rad], [m] Maximum deviation of the axes of a described arm that are meant to be parallel,
# perpendicular, upright or crossing. A file with five decimals passes; a real offset does not. Such
# an arm is replaced by the nearest exact one, once, when it is read.
FAMILY_ANGLE: Final = 1e-4
FAMILY_LENGTH: Final = 1e-5

# [rad] Twice the error of a right angle written as 1.57; smaller than the offsets of real arms.
COARSE_ANGLE: Final = 2e-3

# [rad, m] Maximum deviation of an arm that is used unchanged, without a note.
FAMILY_EXACT: Final = 1e-9

# [1, m] Error of a 0 or a 1 after a few products of matrices in double precision.
ROUNDING: Final = 1e-15

# [1] Cosine of the tool's pitch up to which its heading is only rounding.
UPRIGHT: Final = 1e-14

# [m] Distance below which a point counts as lying on a rotation axis. Its direction from the axis
# is then known to fewer digits than a joint encoder resolves.
ON_AXIS: Final = 1e-9

# [1] Ratio of the tool point's distance from axis 1 to the length of the arm, below which the
# direction of the tool determines theta1 better than its position does.
NEAR_AXIS_1: Final = 1e-3

# [rad] Step of theta1 at which the search for the nearest point beside axis 1 has converged.
ALIGNED: Final = 1e-13

# [rad] Excess over a limit up to which an angle counts as on the limit. Near a singularity rounding
# grows to its square root, and an encoder step is 5e-4 rad or more.
LIMIT_SLACK: Final = 1e-9

# [rad] The same inside the closed-form planar solutions, which are then moved onto the limit. This
# moves the tool by less than 1e-12 m.
PLANAR_LIMIT_SLACK: Final = 1e-12

# [1] Negative radicand, relative to the squared lengths it came from, that is only rounding.
RADICAND: Final = 1e-12

# [rad] Error of angles where two circles touch: somewhat more than the square root of rounding.
TOUCHING: Final = 1e-6

# [m], [rad] Difference below which two residuals count as equal; the solution that moves the arm
# less is then chosen.
SAME_POSITION: Final = 1e-9
SAME_ROTATION: Final = 1e-9

# [m] Maximum distance of a pose; beyond it the sum of a few coordinates can overflow.
FARTHEST: Final = 1e300
