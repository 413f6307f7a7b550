"""A scripted policy that grasps, carries and puts down by what it observes."""

from __future__ import annotations

import math

import gymnasium
import numpy as np

from katana450.extensions.learn.environment import ANGULAR, LINEAR, Numbers, TaskEnvironment
from katana450.maths.geometry.arrays import FloatArray

GAIN = 4.0
"""[1/s] Rate at which the tool is driven, by its distance from where it is to be."""

DOWN = 1.0
"""[rad] Pitch of the tool at which it grasps from above."""

GRASP, ABOVE, LOW = 0.03, 0.1, 0.006
"""[m] Height of the tool above the table as the fingers close, and of an object above its goal
while it is carried and as it is let go.
"""

OPEN, CLOSED = 1.0, -1.0

HANDLE_MIDDLE = 0.035
"""[m] Height of the tool over the lower edge of a handle as the fingers close."""


class Policy:
    """The policy in one episode of an environment.

    Attributes:
        env: the environment without wrappers.
        observation: the newest observation.
        rewards: the rewards so far.
        info: the newest info.
        over: whether the episode is over.
    """

    def __init__(self, env: gymnasium.Env[Numbers, Numbers], seed: int) -> None:
        """Begin an episode with the places of ``seed``."""
        assert isinstance(env.unwrapped, TaskEnvironment)
        self._env, self.env = env, env.unwrapped
        self._parts = self.env.parts
        self.observation, self.info = env.reset(seed=seed)
        self.rewards: list[float] = []
        self.over = False

    def place(self, part: str) -> FloatArray:
        """Return the place (3,) of a part in the newest observation [m]."""
        return self.observation[self._parts[part]][:3].astype(float)

    @property
    def pitch(self) -> float:
        """The angle of the tool below the horizontal [rad]."""
        x, y, z = self.observation[self._parts["tool"]][3:6].tolist()
        return math.atan2(-z, math.hypot(x, y))

    def move(self, part: str, target: FloatArray, fingers: float, pitch: float = DOWN) -> bool:
        """Take a step that moves ``part`` towards ``target`` (3,).

        Return whether it is there, with fingers at rest.
        """
        before = self.observation[self._parts["fingers"]]
        way = target - self.place(part)
        self._act(*(GAIN * way / LINEAR), GAIN * (pitch - self.pitch) / ANGULAR, 0.0, fingers)
        rest = np.array_equal(self.observation[self._parts["fingers"]], before)
        return rest and float(np.abs(target - self.place(part)).max()) < 2e-3

    def turn(self, rate: float, fingers: float) -> None:
        """Take a step that rolls the tool at ``rate``, from -1 to 1."""
        self._act(0.0, 0.0, 0.0, 0.0, rate, fingers)

    def _act(self, *action: float) -> None:
        rates = np.array(action)
        rates[:3] /= max(1.0, float(np.abs(rates[:3]).max()))
        values = np.clip(rates, -1.0, 1.0).astype(np.float32)
        self.observation, reward, over, late, self.info = self._env.step(values)
        self.rewards.append(float(reward))
        self.over = over or late


def put(policy: Policy, name: str) -> None:
    """Grasp the object ``name`` from above and put it at the goal."""
    up = np.array((0.0, 0.0, 1.0))
    middle, above = GRASP * up, ABOVE * up
    start, goal = policy.place(name), policy.place("goal")
    for part, place, fingers, steps in (
        ("tool", start + middle + above, OPEN, 60),
        ("tool", start + middle, OPEN, 40),
        ("tool", start + middle, CLOSED, 12),
        (name, start + above, CLOSED, 40),
        (name, goal + above, CLOSED, 60),
        (name, goal + LOW * up, CLOSED, 30),
    ):
        for step in range(steps):
            if policy.over or (policy.move(part, place, fingers) and step >= 4):
                break
    rest = policy.place("tool")
    for height in (0.0,) * 6 + (ABOVE,) * 20:
        if not policy.over:
            policy.move("tool", rest + height * up, OPEN)


def pour(policy: Policy) -> None:
    """Grasp the cup from the side, hold it over the basin and turn it until enough is poured."""
    cup, goal, up, pitch = policy.place("cup"), policy.place("goal"), np.array((0, 0, 0.01)), 0.2
    before = cup * (1.0 - 0.09 / np.hypot(*cup[:2]))
    for part, place, fingers, steps in (
        ("tool", before + 16 * up, OPEN, 60),
        ("tool", before + 6 * up, OPEN, 50),
        ("tool", cup + 6 * up, OPEN, 40),
        ("tool", cup + 6 * up, CLOSED, 12),
        ("cup", cup + 14 * up, CLOSED, 40),
        ("cup", goal + 16 * up, CLOSED, 80),
    ):
        for step in range(steps):
            if policy.move(part, place, fingers, pitch) and step >= 4:
                break
    for _ in range(60):
        if not policy.over:
            policy.turn(0.6, CLOSED)


def pull(policy: Policy, pitch: float = 1.3) -> None:
    """Grasp the handle of the drawer from above, pull it to its goal, and let go of it."""
    up = np.array((0.0, 0.0, 1.0))
    handle, goal = policy.place("handle"), policy.place("goal")
    middle = handle + HANDLE_MIDDLE * up
    for part, place, fingers, least, most in (
        ("tool", middle + ABOVE * up, OPEN, 4, 60),
        ("tool", middle, OPEN, 4, 40),
        ("tool", middle, CLOSED, 16, 30),
        ("handle", goal, CLOSED, 4, 60),
    ):
        for step in range(most):
            if policy.over or (policy.move(part, place, fingers, pitch) and step >= least):
                break
    rest = policy.place("tool")
    for _ in range(20):
        if not policy.over:
            policy.move("tool", rest, OPEN, pitch)
