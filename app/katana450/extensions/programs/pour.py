"""The script of the pouring demo."""

from __future__ import annotations

from dataclasses import dataclass

Spot = tuple[float, float]


@dataclass(frozen=True)
class PourDemo:
    """water: [ml]. cup, basin: where they stand on the table [mm], None where they are. shake: how
    often the cup is shaken out.
    """

    water: float = 200.0
    cup: Spot | None = None
    basin: Spot | None = None
    shake: int = 3

    @property
    def text(self) -> str:
        """The script."""
        puts = "".join(
            f"  - put: {{object: {name}, x: {spot[0]:g}, y: {spot[1]:g}}}\n"
            for name, spot in (("cup", self.cup), ("basin", self.basin))
            if spot is not None
        )
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
  emptied_percent: {{at_least: 99}}
  spilled_ml: {{at_most: 0}}
  carried_margin_to_rim_mm: {{at_least: 1}}
  greatest_speed_share: {{at_most: 1.000001}}
  greatest_acceleration_share: {{at_most: 1.000001}}
  greatest_jerk_share: {{at_most: 1.000001}}
"""
