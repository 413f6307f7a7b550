"""The pressure on the pads in the 3D scene: coloured patches on the fingers while they press."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import viser

from katana450.extensions.touch.foundation import MODULUS
from katana450.extensions.touch.pad import Pad
from katana450.extensions.touch.squeeze import Squeeze
from katana450.extensions.touch.touch_model import TouchModel
from katana450.server.view.panel_folder import FolderContext
from katana450.server.view.scene import node_name

FULL_PRESSURE = 0.5 * MODULUS
"""[Pa] Pressure that has the last colour."""

COLOURS = np.array(((36, 62, 146), (22, 150, 160), (250, 200, 40), (232, 62, 38)), dtype=np.float64)
"""Colours of no pressure, a third, two thirds and FULL_PRESSURE, which the page uses too."""

LIFT = 0.5e-3
"""[m] Height of the patches over the pad."""

FILL = 0.55
"""[1] Radius of a patch relative to the distance of two along the pad."""


class PadPatches:
    """One point for each taxel, as a part of the panel that has no controls."""

    def __init__(self, context: FolderContext) -> None:
        """Show the touch of the arm of ``context``."""
        self._context = context
        self._shown: Squeeze | None = None
        # Made at the first touch.
        self._clouds: list[viser.PointCloudHandle] = []

    def follow(self) -> None:
        """Show the pressures of the newest state; hide the patches of an empty hand."""
        arm = self._context.hub.arm
        hand = None if arm is None else arm.environment.hand
        model = None if hand is None else hand.grip_model
        if not isinstance(model, TouchModel):
            return
        squeeze = model.squeeze(self._context.state())
        if squeeze is self._shown:
            return
        self._shown = squeeze
        self._clouds = self._clouds or [self._cloud(pad) for pad in model.pads]
        for number, cloud in enumerate(self._clouds):
            cloud.visible = squeeze is not None and squeeze.pads[number].force > 0.0
            if squeeze is not None and cloud.visible:
                cloud.colors = pressure_colours(squeeze.pads[number].pressure.ravel())

    def _cloud(self, pad: Pad) -> viser.PointCloudHandle:
        """Return the hidden patches of ``pad``."""
        robot = self._context.robot
        link = next(each for each in robot.links if each.name == pad.finger)
        path = "/".join(node_name(each.name) for each in robot.path_to(link))
        normals = np.stack([pad.summed(each) for each in pad.normals.T], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        points = (pad.middles + LIFT * normals).reshape(-1, 3)
        return self._context.server.scene.add_point_cloud(
            f"/arm/{path}/touch",
            points.astype(np.float32),
            pressure_colours(np.zeros(len(points))),
            point_size=FILL * pad.length / len(pad.middles),
            point_shape="square",
            visible=False,
        )


def pressure_colours(pressure: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """Return the colours (n, 3) of pressures (n,) [Pa]."""
    place = np.clip(pressure / FULL_PRESSURE, 0.0, 1.0) * (len(COLOURS) - 1)
    found = [np.interp(place, np.arange(len(COLOURS)), each) for each in COLOURS.T]
    return np.round(np.stack(found, axis=1)).astype(np.uint8)
