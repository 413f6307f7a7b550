"""The model of touch of one arm: forces and slip of a state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypedDict

import numpy as np

from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.objects.support import SUPPORT_GAP
from katana450.arm.control.state.scene_objects import SceneObject, same
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import load_props
from katana450.extensions.touch.pad import Pad, PadPressure, pads_of
from katana450.extensions.touch.solid_body import (
    FRICTION,
    acceleration,
    along_pads,
    body_of,
    height_above_support,
    mass,
    sliding_speed,
)
from katana450.extensions.touch.squeeze import FORCE_LIMIT, Squeeze, SqueezedBody
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.units import GRAVITY

UP = np.array((0.0, 0.0, 1.0))
"""Direction against gravity in the base frame."""


class PadReport(TypedDict):
    """The touch of one pad.

    Attributes:
        finger: name of its link.
        force: [N].
        centre: centre of pressure along and across the pad [m]; None without a force.
        pressure: 16 by 8 pressures [Pa], row by row from the palm; empty without a force.
    """

    finger: str
    force: float
    centre: tuple[float, float] | None
    pressure: list[float]


class TouchReport(TypedDict):
    """The touch of a gripper: squeeze [rad], greatest force of a finger [N], and pads."""

    squeeze: float
    force_limit: float
    pads: list[PadReport]


class TouchModel:
    """Forces and slip of a gripper with known pads. It implements ``GripModel``.

    Its results depend on their arguments alone. The last grip is kept, because it lasts for many
    states.
    """

    def __init__(
        self,
        world: CollisionWorld,
        hand: Hand,
        pads: tuple[Pad, Pad],
        masses: Mapping[str, float],
        force_limit: float = FORCE_LIMIT,
    ) -> None:
        """Model the fingers of ``hand``.

        Args:
            world: the bodies of the arm.
            hand: the palm and the fingers.
            pads: the pads of the fingers.
            masses: known masses of objects by name [kg].
            force_limit: greatest force of a finger [N].
        """
        self.pads, self.force_limit = pads, force_limit
        self._linkage, self._palm, self._masses = world.linkage, hand.palm, masses
        groups = {part.name: part.mover for part in world.parts}
        self._fingers = tuple(groups[pad.finger] for pad in pads)
        self._zero = np.zeros(int(world.linkage.variable.max()))
        # Each is replaced as a whole, because several threads may ask.
        self._last_body: tuple[SceneObject, float, SqueezedBody] | None = None
        self._last_squeeze: tuple[SqueezedBody, float, Squeeze] | None = None

    def overload(self, state: State) -> float | None:
        """Return the load [N] under which the held object slides; None if the fingers hold it.

        The load is the weight and the inertia of the object across the closing direction. They hold
        it by friction: up to FRICTION times the sum of both forces. An object that still stands on
        its support does not slide, and neither does one that is held beside the pads.
        """
        body, squeeze, held = self._held(state), self.squeeze(state), state.held
        if body is None or squeeze is None or held is None or not body.on_pads:
            return None
        load = float(np.linalg.norm(self._pull(state, held, squeeze)))
        if load <= FRICTION * squeeze.normal_force:
            return None
        T = self._pose(state.x_setpoint) @ held.T
        return None if height_above_support(state, held, T) <= SUPPORT_GAP else load

    def slid(self, state: State, dt: float) -> SceneObject | None:
        """Return the held object after it has slid for ``dt`` [s]; None if it leaves the pads.

        Friction grows with the speed, so the object slides as fast as the load beyond the friction
        at rest says, and in the direction of the load. It ends on what carries it.
        """
        held, squeeze = state.held, self.squeeze(state)
        assert held is not None
        assert squeeze is not None
        pull = self._pull(state, held, squeeze)
        load = float(np.linalg.norm(pull))
        speed = sliding_speed(load - FRICTION * squeeze.normal_force)
        step = speed * dt / load * pull
        T = self._pose(state.x_setpoint)
        room = height_above_support(state, held, T @ held.T)
        if -step[2] > room:
            step *= room / -step[2]
        moved = held.T.copy()
        moved[:3, 3] += T[:3, :3].T @ step
        slid = replace(held, T=frozen(moved))
        objects = tuple(
            slid if scene_object is held else scene_object for scene_object in state.objects
        )
        body = self._held(replace(state, objects=objects))
        return slid if body is not None and body.on_pads else None

    def _pull(self, state: State, held: SceneObject, squeeze: Squeeze) -> FloatArray:
        """Return the force (3,) by which weight and inertia pull along the pads [N]."""
        middle = held.T_collision_shape[:3, 3]
        force = acceleration(state, middle, self._pose) + GRAVITY * UP
        axis = self._pose(state.x_setpoint)[:3, :3] @ squeeze.axis
        return along_pads(-mass(held, state, self._masses) * force, axis)

    def squeeze(self, state: State) -> Squeeze | None:
        """Return the forces on the object that the fingers hold; None with an empty hand."""
        body = self._held(state)
        if body is None:
            return None
        last = self._last_squeeze
        if last is None or last[0] is not body or last[1] != state.squeeze:
            last = (body, state.squeeze, body.squeezed(state.squeeze))
            self._last_squeeze = last
        return last[2]

    def report(self, state: State) -> TouchReport:
        """Return the touch in ``state`` for the answer to a query."""
        squeeze = self.squeeze(state)
        pads = (
            [_untouched(pad) for pad in self.pads]
            if squeeze is None
            else [_pad_report(pad) for pad in squeeze.pads]
        )
        return {
            "squeeze": state.squeeze,
            "force_limit": self.force_limit,
            "pads": pads,
        }

    def _held(self, state: State) -> SqueezedBody | None:
        held, grip = state.held, state.grip
        if held is None or grip is None:
            return None
        last = self._last_body
        # By its values: states from a pipe have new objects when any of them has changed.
        if last is None or last[1] != grip or not (last[0] is held or same((last[0],), (held,))):
            pose = held.T_collision_shape
            body = SqueezedBody(
                self.pads, body_of(held), pose, self._finger_poses, grip, self.force_limit
            )
            last = self._last_body = (held, grip, body)
        return last[2]

    def _pose(self, x: FloatArray) -> FloatArray:
        return np.asarray(self._linkage.poses(x)[self._palm])

    def _finger_poses(self, angle: float) -> tuple[FloatArray, FloatArray]:
        """Return the poses (4, 4) of both fingers in the palm at the finger joint ``angle``."""
        poses = self._linkage.poses(np.append(self._zero, angle))
        T_palm_base = se3.inverse(poses[self._palm])
        right, left = self._fingers
        return T_palm_base @ poses[right], T_palm_base @ poses[left]


def touch_model(
    world: CollisionWorld, hand: Hand, masses: Mapping[str, float]
) -> TouchModel | None:
    """Return the model of the fingers of ``hand``; None if their pads are not known."""
    pads = pads_of(hand.fingers)
    return TouchModel(world, hand, (pads[0], pads[1]), masses) if len(pads) == 2 else None


def with_touch(world: CollisionWorld, hand: Hand) -> Hand:
    """Return ``hand`` with the model of its touch."""
    return replace(hand, grip_model=touch_model(world, hand, {"cup": load_props().cup.mass}))


def _untouched(pad: Pad) -> PadReport:
    return {"finger": pad.finger, "force": 0.0, "centre": None, "pressure": []}


def _pad_report(pad: PadPressure) -> PadReport:
    return {
        "finger": pad.finger,
        "force": pad.force,
        "centre": pad.centre,
        "pressure": np.round(pad.pressure.ravel()).tolist() if pad.force else [],
    }
