"""Parts of the answer ``state``: margins, water, and the measurements of a real arm."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Numbers


class Margins(msgspec.Struct, frozen=True, kw_only=True):
    """Distances to joint limits, singularity and contact.

    Attributes:
        limit: Distance of the joint nearest to one of its limits from that limit [rad]; negative
            beyond it.
        axis: Number of that joint, counted from 1.
        limits: (n,) Distance of each joint from its nearer limit [rad]; negative beyond it.
        smallest_singular_value: Smallest singular value of the Jacobian over the characteristic
            length of the arm [1]; 0 in a singularity.
        condition_number: Largest over smallest singular value [1]; null from 1e6, in a singularity.
        manipulability: Product of the singular values [1] (Yoshikawa 1985); 0 in a singularity.
        clearance: Distance of the two nearest parts [m]; null where contacts are not checked.
        parts: The two nearest parts; null where contacts are not checked.
    """

    limit: float
    axis: int
    limits: Numbers
    smallest_singular_value: float
    condition_number: float | None
    manipulability: float
    clearance: float | None
    parts: tuple[str, str] | None


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """Water by its place.

    Attributes:
        cup_ml: Volume in the cup, without the film on its wall [ml].
        film_ml: Volume of the film on the wall of the cup [ml].
        basin_ml: Volume in the basin [ml].
        air_ml: Volume in free flight [ml].
        spilled_ml: Volume elsewhere [ml].
        vessels_ml: Volume in each other vessel, with its film, by its name [ml].
        margin_to_rim: Height of the lip of the vessel in the hand, or of the cup, above its water
            [m]; negative while water flows out.
    """

    cup_ml: float
    film_ml: float
    basin_ml: float
    air_ml: float
    spilled_ml: float
    vessels_ml: dict[str, float]
    margin_to_rim: float


class MeasuredArm(msgspec.Struct, frozen=True, kw_only=True):
    """Measurements and mode of an arm that a driver reports. ``q`` of the state is measured too.

    Attributes:
        mode: disconnected, connected, uncalibrated, calibrating, holding, moving, collided, fault
            or lost.
        note: Sentence about the mode; empty if there is nothing to say.
        acts: Acts that are possible now, see ``operate_arm``.
        t: Time of the measurement [s], on the clock of the state.
        expected: (n + 1,) Joints and finger joint where the arm should have been then [rad].
        tracking_error: Maximum difference of a joint from there [rad].
        axis: Number of that joint, counted from 1.
        speeds: (n + 1,) Measured speeds [rad/s]; null if they are not measured.
        round_trip: Time of the newest exchange with the arm [s].
        stop_time: Time to rest of the newest stop, as measured [s]; null before the first.
        stop_angle: Maximum angle of a joint in it [rad]; null before the first.
        stop_distance: Travel of the tool in it [m]; null before the first, and if it is not known.
        sensors: Raw values of the sensors of the gripper; empty without sensors.
    """

    mode: str
    note: str
    acts: list[str]
    t: float
    expected: Numbers
    tracking_error: float
    axis: int
    speeds: Numbers | None
    round_trip: float
    stop_time: float | None
    stop_angle: float | None
    stop_distance: float | None
    sensors: list[float]
