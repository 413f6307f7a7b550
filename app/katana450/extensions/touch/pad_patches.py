"""The pressure on the pads in the 3D scene: coloured patches on the fingers while they press."""

from __future__ import annotations

import numpy as np

from katana450.extensions.touch.pad import COLUMNS, MODULUS, ROWS, Pad, PadPressure
from katana450.extensions.touch.squeeze import Squeeze
from katana450.extensions.touch.touch_model import TouchModel
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.panel_folder import FolderContext
from katana450.server.view.scene import node_name
from katana450.srgb import to_light

FULL_PRESSURE = 0.5 * MODULUS
"""[Pa] Pressure that has the last colour."""

COLOURS = np.array(((46, 94, 200), (20, 164, 156), (246, 196, 40), (226, 52, 40)), dtype=np.float64)
"""Colours of hardly any pressure, a third, two thirds, and FULL_PRESSURE. The page has the same."""

LIFT = 0.3e-3
"""[m] Height of the patches over the pad."""

RIM_WIDTH, RIM_DEPTH = 1.5e-3, 4e-3
"""[m] Size of the patches on the rims of the finger, which show the greatest pressure of their row:
what is pressed is hidden by what presses it. Those at the centre of pressure are white."""

ASIDE = 0.03
"""[m] Distance of the text with the force from the pad, behind the finger."""

WHITE = np.full(3, 255.0)

BRIGHTNESS = 0.6
"""[1] Part of the light of a colour, which the lamps of the scene make brighter."""

HIDDEN = 1e-6
"""[1] Scale of a patch without pressure."""

BOX = 0.5 * np.array(
    [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float32
)
FACES = np.array(
    (
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ),
    dtype=np.uint32,
)


class PadPatches:
    """One patch for each taxel, and two on the rims for each row, without controls in the panel."""

    def __init__(self, context: FolderContext) -> None:
        """Show the touch of the arm of ``context``."""
        self._context = context
        self._shown: Squeeze | None = None
        # Made at the first touch.
        self._pads: list[_PatchedPad] = []

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
        self._pads = self._pads or [_PatchedPad(self._context, pad) for pad in model.pads]
        for number, pad in enumerate(self._pads):
            pad.show(None if squeeze is None else squeeze.pads[number])


class _PatchedPad:
    """The patches of one finger, and its force in newtons beside the centre of pressure."""

    def __init__(self, context: FolderContext, pad: Pad) -> None:
        """Add the patches of ``pad``, hidden."""
        robot = context.robot
        link = next(candidate for candidate in robot.links if candidate.name == pad.finger)
        path = "/".join(node_name(ancestor.name) for ancestor in robot.path_to(link))
        normals = np.stack([pad.summed(coordinate) for coordinate in pad.normals.T], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        across = np.array((0.0, 0.0, 1.0))
        turns = np.stack(
            (np.cross(normals, across), normals, np.broadcast_to(across, normals.shape))
        )
        turned = np.array(
            [so3.to_quaternion(R) for R in np.moveaxis(turns, 0, -1).reshape(-1, 3, 3)]
        )
        taxel = np.array((pad.length / ROWS, 2.0 * LIFT, pad.width / COLUMNS))
        rim = np.array((pad.length / ROWS, RIM_DEPTH, RIM_WIDTH))
        edges = 0.5 * (pad.width + RIM_WIDTH) * np.array((-1.0, 1.0))[:, None]
        middle = pad.middles.mean(axis=1)
        row = middle - 0.5 * (RIM_DEPTH - LIFT) * normals[:, 0]
        places = [pad.middles.reshape(-1, 3), *(row + edge * across for edge in edges)]
        quaternions = turned.reshape(ROWS, COLUMNS, 4)
        self._scales = np.concatenate(
            (np.tile(taxel, (ROWS * COLUMNS, 1)), np.tile(rim, (2 * ROWS, 1)))
        ).astype(np.float32)
        self._node = context.server.scene.add_batched_meshes_simple(
            f"/arm/{path}/touch",
            BOX,
            FACES,
            np.concatenate((turned, quaternions[:, 0], quaternions[:, 0])).astype(np.float32),
            np.concatenate(places).astype(np.float32),
            batched_scales=HIDDEN * self._scales,
            batched_colors=np.zeros((len(self._scales), 3), dtype=np.uint8),
            lod="off",
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._pad, self._behind = pad, middle - ASIDE * normals[:, 0]
        self._label = context.server.scene.add_label(
            f"/arm/{path}/force", "", anchor="center-center", visible=False
        )

    def show(self, touch: PadPressure | None) -> None:
        """Show ``touch``; None to hide everything."""
        centre = None if touch is None else touch.centre
        visible = centre is not None
        if visible != self._node.visible:
            self._node.visible = self._label.visible = visible
        if touch is None or centre is None:
            return
        pressure = touch.pressure
        rims = pressure.max(axis=1)
        shown = np.concatenate((pressure.ravel(), rims, rims))
        colours = pressure_colours(shown)
        row = min(int(centre[0] / self._pad.length * ROWS), ROWS - 1)
        marks = ROWS * COLUMNS + np.array((row, ROWS + row))
        colours[marks], shown[marks] = WHITE, FULL_PRESSURE
        self._label.text = f"{touch.force:.1f} N"
        self._label.position = self._behind[row]
        # For instances viser expects linear light.
        light = BRIGHTNESS * to_light(colours / 255.0)
        self._node.batched_colors = np.round(255.0 * light).astype(np.uint8)
        self._node.batched_scales = np.where(shown > 0.0, 1.0, HIDDEN)[:, None] * self._scales


def pressure_colours(pressure: FloatArray) -> FloatArray:
    """Return the colours (n, 3), from 0 to 255, of pressures (n,) [Pa]."""
    place = np.clip(pressure / FULL_PRESSURE, 0.0, 1.0) * (len(COLOURS) - 1)
    return np.stack(
        [np.interp(place, np.arange(len(COLOURS)), channel) for channel in COLOURS.T], axis=1
    )
