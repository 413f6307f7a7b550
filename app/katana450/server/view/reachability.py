"""The reachability map in the scene: voxels as points, cut open so that one sees inside."""

from __future__ import annotations

from enum import Enum
from html import escape

import numpy as np
import viser

from katana450.arm.robot.robot import Robot
from katana450.errors import ConfigurationError
from katana450.extensions.export.reachability_file import StoredMap
from katana450.extensions.reachability.colors import share_colors

FILL = 0.2
"""Radius of a point to the edge of its voxel: the arm is seen between them."""


STOPS = 9
"""Colours of the scale; a browser draws those between them."""


class Cut(Enum):
    """What of the map is drawn."""

    HIDDEN = "Hidden"
    SLICE = "Slice through axis 1"
    HALF = "Left half"
    WHOLE = "Whole"


class ReachabilityCloud:
    """Hidden until a person asks for it."""

    def __init__(self, server: viser.ViserServer, robot: Robot, stored: StoredMap) -> None:
        """Raises ConfigurationError when ``stored`` is the map of another arm."""
        if stored.robot != robot.name:
            raise ConfigurationError(
                f"The map given with --workspace is of the arm {stored.robot!r}; this one is "
                f"{robot.name!r}. Make one with: katana450 workspace --urdf ... --out map.npz"
            )
        self._server = server
        self._stored = stored
        self._middle = float(robot.require_arm().T_base_shoulder[1, 3])
        self._node: viser.PointCloudHandle | None = None
        self._colors = share_colors(stored.share)

    @property
    def legend(self) -> str:
        """What the colours mean, as HTML: a scale, and its ends in words."""
        top = self._stored.share.max(initial=0.0)
        stops = ", ".join(
            f"rgb({red}, {green}, {blue})"
            for red, green, blue in share_colors(np.linspace(0.0, 1.0, STOPS)).tolist()
        )
        return (
            "<div class='k450'><p class='scale'>"
            f"How freely {escape(self._stored.tool)} can be turned there"
            f"<i style='background: linear-gradient(to right, {stops})'></i>"
            f"0 %<span>{100.0 * top:.0f} % of all pitches and rolls</span></p></div>"
        )

    def show(self, cut: Cut) -> None:
        """Draw the map as ``cut`` has it."""
        if self._node is not None:
            self._node.remove()
            self._node = None
        if cut is Cut.HIDDEN:
            return
        across = self._stored.points[:, 1] - self._middle
        edge = self._stored.voxel
        shown = {
            # Of the two layers beside the plane one is the slice.
            Cut.SLICE: np.floor(across / edge) == 0.0,
            Cut.HALF: across >= 0.0,
            Cut.WHOLE: np.ones(len(across), dtype=bool),
        }[cut]
        self._node = self._server.scene.add_point_cloud(
            "/reachability",
            self._stored.points[shown].astype(np.float32),
            self._colors[shown],
            point_size=FILL * edge,
            point_shape="circle",
        )
