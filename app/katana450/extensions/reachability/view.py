"""The reachability map in the scene: voxels as points, with a choice of cuts."""

from __future__ import annotations

from enum import Enum
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from katana450.errors import ConfigurationError
from katana450.extensions.reachability.reachability_file import StoredMap, load_map
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.layer import LayerContext, ViewLayer

_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
_COLORS = np.array([(52, 16, 90), (46, 79, 148), (22, 138, 134), (106, 192, 82), (250, 230, 60)])


def fraction_colors(fraction: FloatArray) -> npt.NDArray[np.uint8]:
    """Return red, green, blue (N, 3) for ``fraction`` (N,), scaled to its maximum.

    Five axes give a third of all orientations at best, so a scale up to 1 would show little.
    """
    relative = fraction / fraction.max(initial=np.finfo(np.float64).tiny)
    channels = [np.interp(relative, _FRACTIONS, channel) for channel in _COLORS.T]
    colors: npt.NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return colors


FILL = 0.2
"""Ratio of a point's radius to its voxel's edge; the arm is visible between the points."""

STOPS = 9
"""Number of colours of the scale; the browser interpolates between them."""


class Cut(Enum):
    """The part of the map that is drawn."""

    HIDDEN = "Hidden"
    SLICE = "Slice through axis 1"
    HALF = "Left half"
    WHOLE = "Whole"


class ReachabilityLayer(ViewLayer):
    """A stored map as a layer of the scene, hidden until a person chooses a cut."""

    def __init__(self, path: Path) -> None:
        """Show the map of the file ``path``, which is read by `attach`."""
        self._path = path

    @property
    def what(self) -> str:
        """The sentence that states why an arm is needed."""
        return f"{self._path} is a map of the points that a tool reaches."

    def attach(self, context: LayerContext) -> None:
        """Read the map and prepare to draw it in the scene of ``context``.

        Raises InputError if the file is not a map, and ConfigurationError if it is the map of
        another arm.
        """
        stored, robot = load_map(self._path), context.robot
        if stored.robot != robot.name:
            raise ConfigurationError(
                f"The map given with --workspace is of the arm {stored.robot!r}; this arm is "
                f"{robot.name!r}. Make a map with: katana450 workspace --urdf ... --out map.npz"
            )
        middle = float(robot.require_arm().T_base_shoulder[1, 3])
        self._cloud = ReachabilityCloud(context.server, stored, middle)

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add the choice of a cut, and the legend that is shown with it."""
        cuts = gui.add_dropdown(
            "Reachability",
            tuple(cut.value for cut in Cut),
            initial_value=Cut.HIDDEN.value,
            hint="Points that the tool reaches, from the map that the server was started with",
        )
        legend = gui.add_html(self._cloud.legend, visible=False)

        @cuts.on_update
        def _(_: viser.GuiEvent[Any]) -> None:
            cut = Cut(cuts.value)
            legend.visible = cut is not Cut.HIDDEN
            self._cloud.show(cut)


class ReachabilityCloud:
    """The voxels of a map as points in the scene."""

    def __init__(self, server: viser.ViserServer, stored: StoredMap, middle: float) -> None:
        """Prepare to draw ``stored``; ``middle`` is y [m] of axis 1 in the base frame."""
        self._server = server
        self._stored = stored
        self._middle = middle
        self._node: viser.PointCloudHandle | None = None
        self._colors = fraction_colors(stored.fraction)

    @property
    def legend(self) -> str:
        """The legend as HTML: a colour scale, with labels at its ends."""
        top = self._stored.fraction.max(initial=0.0)
        stops = ", ".join(
            f"rgb({red}, {green}, {blue})"
            for red, green, blue in fraction_colors(np.linspace(0.0, 1.0, STOPS)).tolist()
        )
        return (
            "<div class='k450'><p class='scale'>"
            f"How freely {escape(self._stored.tool)} can be turned there"
            f"<i style='background: linear-gradient(to right, {stops})'></i>"
            f"0 %<span>{100.0 * top:.0f} % of all orientations</span></p></div>"
        )

    def show(self, cut: Cut) -> None:
        """Draw the part ``cut`` of the map."""
        if self._node is not None:
            self._node.remove()
            self._node = None
        if cut is Cut.HIDDEN:
            return
        across = self._stored.points[:, 1] - self._middle
        edge = self._stored.voxel
        shown = {
            # The slice is one of the two layers beside the plane.
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
