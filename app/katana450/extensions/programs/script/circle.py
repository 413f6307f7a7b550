"""The script of the circle demo, with the circle as a parameter."""

from __future__ import annotations

from dataclasses import dataclass

PAPER_CIRCLE = "First experiment of the paper, which reports a position error below 3e-12 mm."
"""Description of the script with default values, which is the circle of the paper."""


@dataclass(frozen=True)
class CircleDemo:
    """The parameters of the circle demo.

    Attributes:
        centre: centre of the circle [mm] in the shoulder frame.
        normal: direction of the circle's normal, written as in a script, such as ``x``.
        radius: radius of the circle [mm].
        turns: number of turns along the circle.
        pitch: pitch of the tool in a script: degrees, ``keep``, or ``roomiest`` for the greatest
            distance to the joint limits; None for the default of ``tool``.
        tool: tool frame that follows the circle; ``flange`` means an arm without its gripper.
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
        about = f"about: {PAPER_CIRCLE}\n" if self == CircleDemo() else ""
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
