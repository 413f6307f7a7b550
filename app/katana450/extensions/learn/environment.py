"""An environment of gymnasium: the session of an arm, stepped on a simulated clock.

Each episode of a task begins with a scene on the table that is drawn at random.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import numpy.typing as npt

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.grip import finger_forces
from katana450.arm.control.objects.pouring import BASIN, CUP
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.object_joint import ObjectJoint
from katana450.arm.control.state.scene_objects import SceneObject, Shape, named
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.physics.joint import BodyJoint
from katana450.maths.water.units import MILLILITRE, ML
from katana450.resources import robot_file
from katana450.settings import Settings

Numbers = npt.NDArray[np.float32]

TASKS = {
    "PickPlace": ("cube",),
    "Stack": ("upper", "lower"),
    "Pour": (CUP, BASIN),
    "Drawer": ("handle",),
}
"""Names of the objects that are observed in each task. The first one is to be grasped."""

SIDE = 0.04
"""[m] Length of a side of the cubes."""

HANDLE, FRONT, CABINET = (0.07, 0.012, 0.06), (0.012, 0.16, 0.11), (0.12, 0.16, 0.11)
"""[m] Sizes of the handle and the front of a drawer, and of the cabinet, along the drawer first."""

HANDLE_HEIGHT, GAP = 0.036, 0.002
"""[m] Height of the lower edge of a handle, and distance between a drawer and its cabinet."""

TRAVEL, FRICTION, DAMPING, MASS = 0.1, 2.0, 5.0, 0.8
"""[m, N, N s/m, kg] How far a drawer opens, and what its joint takes."""

FILLED, WANTED = 100.0, 50.0
"""[ml] Water in the cup at the start, and in the basin at success."""

RADIUS = 0.75, 1.0
"""[1] Range of the distances of places from axis 1, as ratios to that of the tool when ready."""

HANDLE_RADIUS = 0.72, 0.79
"""[1] The same of the handle of a closed drawer: it comes nearer as the drawer opens."""

MAX_AZIMUTH, MAX_YAW = 0.6, 0.2
"""[rad] Maximum angle of a place beside the tool when ready, and of an object to its radius."""

ROOM = 0.12
"""[m] Minimum distance between the middles of two places: the fingers fit between them."""


class Scene(NamedTuple):
    """A first scene, with the water in its cup [m^3].

    ``goal``: (3,) where the first object is to stand [m], from the second one if there is one.
    """

    objects: tuple[SceneObject, ...]
    goal: FloatArray
    volume: float | None = None


class Table:
    """The part of the table before an arm in which objects are placed."""

    def __init__(self, tool: FloatArray, axis: FloatArray, rng: np.random.Generator) -> None:
        """Create it without a place. ``tool``: place of the tool, ``axis``: of axis 1, (3,) [m]."""
        (x, y), self._axis, self._rng = (tool - axis)[:2], axis[:2], rng
        self._radius, self._azimuth = math.hypot(x, y), math.atan2(y, x)
        self._places: list[FloatArray] = []

    def scene(self, task: str, objects: tuple[SceneObject, ...]) -> Scene:
        """Return a random scene of ``task``; ``objects``: those of the app."""
        if task == "PickPlace":
            return Scene((self._cube("cube"),), self._draw()[:3, 3])
        if task == "Stack":
            return Scene((self._cube("upper"), self._cube("lower")), np.array((0.0, 0.0, SIDE)))
        if task == "Drawer":
            return _drawer(self._draw(HANDLE_RADIUS, max_yaw=0.0))
        cup, basin = named(objects, CUP), named(objects, BASIN)
        if cup is None or basin is None:
            raise InputError("There is no cup or basin for this arm. Choose another task.")
        return Scene((replace(cup, T=self._draw()), basin), np.zeros(3), FILLED * ML)

    def _cube(self, name: str) -> SceneObject:
        return SceneObject(name, Shape.BOX, (SIDE,) * 3, self._draw(), can_be_held=True)

    def _draw(self, radius: tuple[float, float] = RADIUS, max_yaw: float = MAX_YAW) -> FloatArray:
        """Return the pose (4, 4) of an object with room around it."""
        while True:
            azimuth = self._azimuth + self._rng.uniform(-MAX_AZIMUTH, MAX_AZIMUTH)
            distance = self._radius * self._rng.uniform(*radius)
            place = self._axis + distance * np.array((math.cos(azimuth), math.sin(azimuth)))
            yaw = azimuth + self._rng.uniform(-max_yaw, max_yaw)
            # An arm too small for the room gets places without it.
            room = min(ROOM, 0.5 * MAX_AZIMUTH * self._radius)
            if all(math.dist(place, other) > room for other in self._places):
                self._places.append(place)
                return se3.from_rotation_translation(so3.rotation_z(yaw), (*place, 0.0))


def _drawer(T: FloatArray) -> Scene:
    """Return a closed drawer that opens against x of ``T`` (4, 4), and has its handle there."""
    front = 0.5 * (HANDLE[0] + FRONT[0])
    cabinet = front + 0.5 * (FRONT[0] + CABINET[0]) + GAP
    axis = tuple((-T[:3, 0]).tolist())
    joint = BodyJoint(True, (0.0,) * 3, axis, 0.0, TRAVEL, FRICTION, DAMPING, MASS)

    def part(name: str, size: tuple[float, ...], x: float, z: float) -> SceneObject:
        pose = T @ se3.from_rotation_translation(np.eye(3), (x, 0.0, z))
        moves = None if name == "cabinet" else ObjectJoint("drawer", joint, pose)
        held = name == "handle"
        return SceneObject(name, Shape.BOX, size, pose, can_be_held=held, joint=moves)

    objects = (
        part("cabinet", CABINET, cabinet, 0.0),
        part("drawer", FRONT, front, GAP),
        part("handle", HANDLE, 0.0, HANDLE_HEIGHT),
    )
    return Scene(objects, joint.motion(TRAVEL)[:3, 3] + objects[-1].T[:3, 3])


PLACE_ERROR = 0.01
"""[m] Maximum distance of an object from its goal at success."""

STEP_TICKS = 10
"""Number of ticks in a step: 0.1 s. A jog lasts for 0.2 s."""

LINEAR, ANGULAR = 0.25, 1.0
"""[m/s, rad/s] Rates of the tool at the action 1. The linear rate is that of the page."""

MAX_PLACE, MAX_FORCE, MAX_AMOUNT = 4.0, 1000.0, 1000.0
"""[m, N, ml] Bounds of places, forces and amounts of water in an observation."""


class TaskEnvironment(gymnasium.Env[Numbers, Numbers]):
    """A task of one arm.

    Attributes:
        parts: the slice of each part of an observation, by its name.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as gymnasium declares it)

    def __init__(self, task: str, urdf: str | Path | None = None) -> None:
        """Load the arm.

        Args:
            task: a key of ``TASKS``.
            urdf: description of the arm, or "so101"; None for the Katana450.

        Raises InputError for an unknown task or one of another arm, and RobotDescriptionError for
        a file without an arm whose hand can hold objects.
        """
        if task not in TASKS:
            raise InputError(f"There is no task {task!r}. Choose from {', '.join(TASKS)}.")
        if urdf is not None and task == "Pour":
            raise InputError("Pour is for the Katana450 alone. Leave `urdf` out.")
        path = robot_file(urdf)
        robot, self._session, _ = describe_robot(Settings(), path, None)
        self._arm, self._task, self._names = robot.require_arm(), task, TASKS[task]
        hand = self._session.environment.hand
        if hand is None or not hand.can_hold:
            raise RobotDescriptionError(
                f"{path.name}: This arm has no hand that can hold objects. Choose another file."
            )
        self._hand, self._goal = hand, np.zeros(3)
        gripper, limits = self._arm.gripper, self._arm.limits
        self._state = self._session.begin(self._session.ready, gripper.opened, 0.0)
        self._rates = np.repeat((LINEAR, ANGULAR), (3, self._arm.kinematics.freedoms - 3))
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(self._rates) + 1,), np.float32)
        pose = np.array((MAX_PLACE,) * 3 + (1.0,) * 6)
        forces = np.full(len(finger_forces(hand, self._state)), MAX_FORCE)
        bounds = {
            "joints": (limits.lower, limits.upper),
            "fingers": (np.array([gripper.lower]), np.array([gripper.upper])),
            "tool": (-pose, pose),
            **dict.fromkeys(self._names, (-pose, pose)),
            "forces": (np.zeros_like(forces), forces),
            "goal": (-pose[:3], pose[:3]),
            "water": (np.zeros(2), np.full(2, MAX_AMOUNT)),
        }
        ends = np.cumsum([len(lower) for lower, _ in bounds.values()]).tolist()
        self.parts = dict(zip(bounds, map(slice, [0, *ends], ends), strict=False))
        low, high = map(np.concatenate, zip(*bounds.values(), strict=True))
        self._low, self._high = low.astype(np.float32), high.astype(np.float32)
        self.observation_space = gymnasium.spaces.Box(self._low, self._high, dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Return the observation and the info of a new episode, whose places ``seed`` decides.

        Raises InputError for any of ``options``, because there are none.
        """
        super().reset(seed=seed)
        if options:
            raise InputError(f"`reset` has no options. Leave out {', '.join(map(str, options))}.")
        self._state = self._session.begin(self._session.ready, self._arm.gripper.opened, 0.0)
        table = Table(self._tool()[:3, 3], self._arm.T_base_shoulder[:3, 3], self.np_random)
        scene = table.scene(self._task, self._state.objects)
        self._goal, self._tick = scene.goal, 0
        self._advance(cmd.ReplaceScene(scene.objects, scene.volume))
        return self._observation(), self._info(False)

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Jog the tool for 0.1 s.

        Args:
            action: (k + 1,) the k rates of the tool, then the opening of the fingers, all from -1
                to 1; greater numbers are clipped.

        Raises InputError for another shape and for numbers that are not finite.
        """
        values = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise InputError(f"An action is {len(self._rates) + 1} finite numbers, not {action!r}.")
        closed, opened = self._arm.gripper.closed, self._arm.gripper.opened
        fingers = closed + 0.5 * (values[-1] + 1.0) * (opened - closed)
        self._advance(cmd.Jog(values[:-1] * self._rates), cmd.Gripper(float(fingers)))
        for _ in range(1, STEP_TICKS):
            self._advance()
        place, held = self._pose(self._names[0])[:3, 3], self._state.held is not None
        if self._task == "Pour":
            error = max(1.0 - self._water()[1] / WANTED, 0.0)
            success = error == 0.0
        else:
            error = float(np.linalg.norm(place - self._goal_place()))
            success = error <= PLACE_ERROR and not held and not self._state.objects_move
        away = 0.0 if held or success else float(np.linalg.norm(place - self._tool()[:3, 3]))
        reward = float(success) - error - away
        return self._observation(), reward, success, False, self._info(success)

    def _advance(self, *commands: cmd.Command) -> None:
        """Execute ``commands`` in a tick of an arm that follows exactly."""
        self._tick += 1
        state = self._session.step(self._state, commands, self._tick / Settings.rate)
        self._state = Session.observe(state, state.setpoint, state.gripper_setpoint)

    def _tool(self) -> FloatArray:
        """Return the pose (4, 4) of the tool in the base frame."""
        T = forward(self._arm.chain_to(self._state.tool), self._state.q)
        return np.asarray(self._arm.T_base_shoulder @ T)

    def _pose(self, name: str) -> FloatArray:
        """Return the pose (4, 4) of an object in the base frame."""
        scene_object = named(self._state.objects, name)
        assert scene_object is not None
        return self._session.environment.pose(scene_object, self._state.x)

    def _goal_place(self) -> FloatArray:
        """Return where the first object is to stand, (3,) in the base frame [m]."""
        return self._goal + sum(self._pose(name)[:3, 3] for name in self._names[1:])

    def _water(self) -> tuple[float, float]:
        """Return the water in the cup and in the basin [ml]."""
        if self._state.poured is None:
            return 0.0, 0.0
        water = self._state.poured.water
        return water.cup.volume / MILLILITRE, water.basin / MILLILITRE

    def _observation(self) -> Numbers:
        poses = (self._tool(), *map(self._pose, self._names))
        numbers = [self._state.x, *(np.append(T[:3, 3], T[:3, :2].T) for T in poses)]
        forces = np.array([*finger_forces(self._hand, self._state).values()])
        numbers += [forces, self._goal_place(), np.array(self._water())]
        return np.clip(np.concatenate(numbers).astype(np.float32), self._low, self._high)

    def _info(self, success: bool) -> dict[str, Any]:
        """Return the success, and the reasons that limit the arm."""
        reasons = (finding.reason.value for finding in self._state.findings)
        return {"is_success": success, "limited_by": ", ".join(reasons)}
