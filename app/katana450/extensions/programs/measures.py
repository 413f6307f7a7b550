"""Measures of a run by name; a script can give the bounds that it expects of them."""

from __future__ import annotations

from typing import Final

MEASURES: Final = {
    "max_position_error_mm": "distance of the planned tool positions from the desired path",
    "rms_position_error_mm": "the same, root mean square",
    "max_orientation_error_deg": "deviation of the tool from the desired pitch and roll",
    "executed_position_error_mm": "distance of the setpoints at each tick from the desired path",
    "between_ticks_error_mm": "the same half-way between ticks, joints interpolated linearly",
    "measured_position_error_mm": "distance of the measured tool from the desired path",
    "measured_rms_error_mm": "the same, root mean square",
    "tool_tracking_error_mm": "distance of the measured tool from where it was sent by then",
    "joint_tracking_error_deg": "the same of the joints, maximum of all",
    "tracking_lag_ms": "time by which the measured joints are behind the setpoints",
    "path_length_mm": "length of the tool's paths",
    "smallest_singular_value": "of the Jacobian, translations divided by the characteristic length",
    "margin_to_limits_deg": "minimum of all joints over the whole run",
    "nearest_clearance_mm": "minimum of all pairs of parts; plans that lift an object are left out",
    "max_speed_fraction": "maximum of all joints, as a fraction of the limit",
    "max_acceleration_fraction": "the same of the acceleration, over two ticks",
    "max_jerk_fraction": "the same of the jerk, over three ticks",
    "max_tool_speed_mm_s": "of the tool point",
    "duration_s": "of the run",
    "emptied_percent": "fraction of the water that is in the basin at the end",
    "spilled_ml": "water on table and floor at the end",
    "carried_margin_to_rim_mm": "minimum height of the lip above the water, until it is poured",
    "cup_peak_jerk_m_s3": "maximum of the cup's middle, over one tick",
}
"""Name of each measure, with its unit at the end, and its definition."""

OF_A_MEASURED_ARM: Final = frozenset(
    (
        "measured_position_error_mm",
        "measured_rms_error_mm",
        "tool_tracking_error_mm",
        "joint_tracking_error_deg",
        "tracking_lag_ms",
    )
)
"""Measures of an arm that is measured beside its setpoints."""

UNITS: Final = {
    "_m_s3": "m/s³",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_ml": "ml",
    "_percent": "%",
    "_deg": "deg",
    "_ms": "ms",
    "_s": "s",
}
"""Unit of a measure by the suffix of its name; longer suffixes first."""


def unit_of(measure: str) -> str:
    """Return the unit of ``measure``; "" for a number."""
    return next((unit for end, unit in UNITS.items() if measure.endswith(end)), "")


def title_of(measure: str) -> str:
    """Return the name of ``measure`` for people, without its unit."""
    end = next((end for end in UNITS if measure.endswith(end)), "")
    return measure.removesuffix(end).replace("_", " ").capitalize()
