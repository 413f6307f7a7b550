"""The script of the circle demo, for any circle."""

from __future__ import annotations

from dataclasses import dataclass

PAPER = "The paper's first experiment; it reports a position error below 3e-12 mm."
"""Description of the default script; the error is the value that the paper reports."""


@dataclass(frozen=True)
class CircleDemo:
    """The circle demo with its parameters.

    Attributes:
        centre: [mm] in the shoulder frame.
        normal: direction as in a script, such as ``x``.
        radius: [mm].
        turns: number of turns.
        pitch: [deg] as text, ``keep`` or ``roomiest``; None for the default of the tool.
        tool: tool frame; ``flange`` means an arm without its gripper.
    """

    centre: tuple[float, float, float] = (150.0, 0.0, -110.0)
    normal: str = "x"
    radius: float = 100.0
    turns: float = 1.0
    pitch: str | None = None
    tool: str = "flange"

    @property
    def text(self) -> str:
        """The YAML text of the script."""
        x, y, z = self.centre
        bare = self.tool == "flange"
        pitch = self.pitch or ("99" if bare else "roomiest")
        about = f"about: {PAPER}\n" if self == CircleDemo() else ""
        return f"""\
name: Circle
{about}gripper: {"none" if bare else "fitted"}
tool: {self.tool}
steps:
  - circle:
      centre: {{x: {x:g}, y: {y:g}, z: {z:g}}}
      normal: {self.normal}
      radius: {self.radius:g}
      turns: {self.turns:g}
      pitch: {pitch}
      roll: 0
  - home
expect:
  max_position_error_mm: {{at_most: 1.0e-12}}
  max_orientation_error_deg: {{at_most: 1.0e-9}}
  executed_position_error_mm: {{at_most: 1.0e-6}}
  max_speed_fraction: {{at_most: 1.000001}}
  max_acceleration_fraction: {{at_most: 1.000001}}
  max_jerk_fraction: {{at_most: 1.000001}}
  margin_to_limits_deg: {{at_least: 0.1}}
"""
