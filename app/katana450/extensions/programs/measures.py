"""What is measured of a run, by name; a script may say in which bounds it expects it."""

from __future__ import annotations

from typing import Final

MEASURES: Final = {
    "max_position_error_mm": "forward kinematics of the planned joints, from the desired path",
    "rms_position_error_mm": "the same, root mean square",
    "max_orientation_error_deg": "the tool's, from the desired pitch and roll",
    "executed_position_error_mm": "where the arm was told to be, from the path, at each tick",
    "between_ticks_error_mm": "the same half-way between ticks, joints on straight lines",
    "path_length_mm": "of the tool on its paths",
    "smallest_singular_value": "of the Jacobian, translations by the characteristic length",
    "margin_to_limits_deg": "the least of any joint, on the whole run",
    "nearest_clearance_mm": "between any two parts, on all plans but those that lift something off",
    "greatest_speed_share": "of any joint, of its most",
    "greatest_acceleration_share": "of any joint, over two ticks, of its most",
    "greatest_jerk_share": "of any joint, over three ticks, of its most",
    "greatest_tool_speed_mm_s": "of the tool point",
    "duration_s": "of the run",
    "emptied_percent": "of the water, what is in the basin at the end",
    "spilled_ml": "what lies on table and floor at the end",
    "carried_margin_to_rim_mm": "the least of the lip over the water, until it is poured",
    "cup_peak_jerk_m_s3": "of the middle of the cup, over a tick",
}
"""The name, its unit at its end, and what it is."""
