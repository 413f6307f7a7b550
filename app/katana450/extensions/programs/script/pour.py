"""The script of the pouring demo."""

from __future__ import annotations

from dataclasses import dataclass

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
