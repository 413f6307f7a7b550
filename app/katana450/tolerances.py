"""Every tolerance of the pure core, each with its unit and its reason."""

from __future__ import annotations

from typing import Final

# How far from orthonormal (largest entry of R^T R - I) a matrix may be and still be meant as a
# rotation: single-precision numbers and rounded text pass, a scale or a shear does not.
ROTATION_INPUT: Final = 1e-6

# The same for a matrix that a person or another program prints with four decimals or more: the
# rounding is at most 1.8e-4. It is taken where requests come in, and nowhere behind.
ROTATION_PRINTED: Final = 1e-3

# How far from orthonormal (root mean square of six misfits) a rotation is that a few products of
# rotations in double precision made: the nearest one would only exchange this rounding for its own.
ROTATION_EXACT: Final = 4e-15

# How far from 0 0 0 1 the last row of a pose may be: rounding of a product of poses, no more.
POSE_LAST_ROW: Final = 1e-9

# [1, m] How exactly a joint's screw axis must have |omega| = 1 and no travel along itself.
SCREW: Final = 1e-9

# Cosine of the pitch below which roll and yaw turn about one axis and only their sum is known.
GIMBAL_LOCK: Final = 1e-9

# [rad], [m] How far the axes of a described arm may be off parallel, square, upright or crossing
# and still be meant so: a file with five decimals passes, a real offset does not. Such an arm is
# replaced, once, when it is read, by the exact one next to it.
FAMILY_ANGLE: Final = 1e-4
FAMILY_LENGTH: Final = 1e-5

# [rad] What a right angle written as 1.57 is off by, twice over: no offset of a real arm.
COARSE_ANGLE: Final = 2e-3

# [rad, m] An arm that is off by no more is used as it is, without a word.
FAMILY_EXACT: Final = 1e-9

# [1, m] What is left of a 0 or a 1 after a few products of matrices in double precision.
ROUNDING: Final = 1e-15

# [1] Cosine of the tool's pitch up to which nothing but rounding is left of where it faces.
UPRIGHT: Final = 1e-14

# [m] Distance below which a point counts as lying on a rotation axis: its direction seen from the
# axis is then known to fewer digits than a joint encoder resolves.
ON_AXIS: Final = 1e-9

# [1] Distance of the tool point from axis 1, to the length of the arm, below which the direction of
# the tool tells theta1 better than its place does.
NEAR_AXIS_1: Final = 1e-3

# [rad] Step of theta1 at which the search for the nearest point beside axis 1 has settled.
ALIGNED: Final = 1e-13

# [m, or the unit of the plane's d] Misfit up to which a subproblem's answer counts as exact.
SUBPROBLEM_EXACT: Final = 1e-9

# [1] Sine of the angle between two axes below which they count as parallel.
PARALLEL: Final = 1e-9

# [rad] How far over a limit an angle still counts as on it: rounding grows as its square root next
# to a singularity, and an encoder step is 5e-4 rad or more.
LIMIT_SLACK: Final = 1e-9

# [rad] The same inside the closed-form planar solutions, which are then set onto the limit itself;
# it costs less than 1e-12 m at the tool.
PLANAR_LIMIT_SLACK: Final = 1e-12

# [1] Negative radicand, relative to the squared lengths it came from, that is rounding alone.
RADICAND: Final = 1e-12

# [rad] How well angles are known where two circles touch: to the root of rounding, and some more.
TOUCHING: Final = 1e-6

# [m], [rad] Residuals nearer than these are the same to a person and to the arm; the choice between
# them then goes to the solution that moves the arm less.
SAME_POSITION: Final = 1e-9
SAME_ROTATION: Final = 1e-9

# [m] How far away a pose may be: beyond it sums of a few coordinates leave the numbers there are.
FARTHEST: Final = 1e300

# [1, m] How exactly axis 1 must be upright and the tool point lie on axis 5 for a workspace to be
# mapped: what is off by this is nothing beside a voxel.
MAPPED_ARM: Final = 1e-6
