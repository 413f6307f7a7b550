"""The newest postures of a leader: whether they are plausible, how fast they are, whether at rest.

Times in s, angles in rad.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from katana450.extensions.leader.joint_map import LeaderPosture
from katana450.maths.geometry.arrays import FloatArray

GAP, GAP_JUMP = 0.2, 0.09
"""[s], [rad] The arm rests after this time without a posture. The next one must be this near."""

SILENCE = 1.0
"""[s] Time without a valid posture after which the leader is silent."""

MAX_SPEED = 12.0
"""[rad/s] Speed of a joint beyond which a posture is an error of the encoder and refused."""

MAX_INTERVAL = 0.05
"""[s] A longer interval between two postures allows no larger jump."""

NOISE = 0.01
"""[rad] Jump that is always allowed."""

RATE_WINDOW = 0.07
"""[s] Time over which the rates are averaged."""

REST_TIME, REST_ANGLE = 0.5, 0.02
"""[s], [rad] A leader that moves less than this angle for this time is at rest."""


class PostureHistory:
    """The accepted postures of the last REST_TIME."""

    def __init__(self) -> None:
        self._postures: deque[tuple[float, LeaderPosture]] = deque()
        self._begun = 0.0

    def add(self, t: float, posture: LeaderPosture) -> bool:
        """Take ``posture`` at ``t``; return whether it is accepted.

        A posture that no hand could have reached since the last accepted one is refused. After
        SILENCE without an accepted one the history begins again.
        """
        if not self.fresh(t):
            self._postures.clear()
            self._begun = t
        elif self._postures:
            then, last = self._postures[-1]
            allowed = NOISE + MAX_SPEED * min(t - then, MAX_INTERVAL)
            if t - then > GAP:
                allowed = GAP_JUMP
            if np.abs(posture.raw - last.raw).max() > allowed:
                return False
        self._postures.append((t, posture))
        while t - self._postures[0][0] > REST_TIME:
            self._postures.popleft()
        return True

    def fresh(self, t: float) -> bool:
        """Return whether a posture was accepted within SILENCE before ``t``."""
        return bool(self._postures) and t - self._postures[-1][0] <= SILENCE

    @property
    def newest(self) -> LeaderPosture:
        """The newest accepted posture. There must be one."""
        return self._postures[-1][1]

    def rates(self) -> FloatArray:
        """Return the rates (n,) of ``newest.q``: the slope of the line through the last ones."""
        end = self._postures[-1][0]
        found = [each for each in self._postures if end - each[0] <= RATE_WINDOW]
        t = np.array([each[0] for each in found])
        q = np.array([each[1].q for each in found])
        t -= t.mean()
        spread = float(t @ t)
        slope: FloatArray = t @ q / spread if spread > 0.0 else np.zeros(q.shape[1])
        return slope

    def at_rest(self, t: float) -> bool:
        """Return whether the leader was at rest for REST_TIME until ``t``."""
        if not self._postures or t - self._postures[-1][0] > GAP or t - self._begun < REST_TIME:
            return False
        q = np.array([posture.q for _, posture in self._postures])
        return float(np.ptp(q, axis=0).max()) <= REST_ANGLE
