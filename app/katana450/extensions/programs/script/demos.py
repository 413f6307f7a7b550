"""The scripts of the demos, with their parameters."""

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


Spot = tuple[float, float]
"""A place on the table: x, y [mm] in the base frame."""


@dataclass(frozen=True)
class PourDemo:
    """The pouring demo with its parameters.

    Attributes:
        water: [ml].
        cup: its place on the table [mm]; None to leave it.
        basin: its place on the table [mm]; None to leave it.
        shake: number of shakes of the cup.
    """

    water: float = 200.0
    cup: Spot | None = None
    basin: Spot | None = None
    shake: int = 3

    @property
    def text(self) -> str:
        """The YAML text of the script."""
        puts = "".join(
            f"  - put: {{object: {name}, x: {spot[0]:g}, y: {spot[1]:g}}}\n"
            for name, spot in (("cup", self.cup), ("basin", self.basin))
            if spot is not None
        )
        # At most 1 ml may stay in the cup and on its wall.
        least = 100.0 - 100.0 / max(self.water, 1.0)
        return f"""\
name: Pour
about: The paper's second experiment; a full cup is carried and emptied into a basin.
frame: base
tool: grasp
steps:
{puts}  - fill: {self.water:g}
  - grasp: cup
  - line: {{by: {{z: 140}}}}
  - pour: {{into: basin, shake: {self.shake}}}
  - set_down:
  - home
expect:
  emptied_percent: {{at_least: {least:g}, at_most: 99.99}}
  spilled_ml: {{at_most: 0}}
  carried_margin_to_rim_mm: {{at_least: 1}}
  max_speed_fraction: {{at_most: 1.000001}}
  max_acceleration_fraction: {{at_most: 1.000001}}
  max_jerk_fraction: {{at_most: 1.000001}}
"""
