"""The rules by which an arm follows a leader, as a machine without clock, port or connection.

The arm first moves to the leader's posture on a planned path. It follows only once both are near
each other. Everything unexpected ends this: the samples end, the arm comes to rest by itself, and
nothing moves again before a person asks for it. Times are in s, angles in rad.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np

from katana450.client.client import is_over
from katana450.extensions.leader.joint_map import LeaderPosture
from katana450.maths.geometry.arrays import FloatArray
from katana450.sdk import answers

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
        recent = [posture for posture in self._postures if end - posture[0] <= RATE_WINDOW]
        t = np.array([posture[0] for posture in recent])
        q = np.array([posture[1].q for posture in recent])
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


NEAR = 0.09
"""[rad] Difference of each joint up to which the arm follows the leader without a planned path."""

HELD_BACK = 0.5
"""[rad] Difference at which an arm that waits before a contact no longer follows."""

SERVER_SILENCE = 1.0
"""[s] Time without a state of the server after which the arm no longer follows. A page that draws
slowly is late by up to 0.6 s."""

FINGER_NEAR = 0.1
"""[1] Fraction of the range of the fingers within which the leader's jaw has met them."""

FINGER_STEP = 0.02
"""[1] Fraction of the range of the fingers from which a motion of the jaw is sent."""

FINGER_INTERVAL = 0.1
"""[s] Minimum time between two targets of the fingers."""


class LeadPhase(Enum):
    """The activity of a follower."""

    WAITING = "waiting"
    """Nothing, until a person asks for it."""
    EASING = "easing"
    """The arm moves to the leader's posture on a planned path."""
    SETTLING = "settling"
    """The arm has arrived, and the leader is elsewhere."""
    FOLLOWING = "following"


@dataclass(frozen=True, eq=False)
class Ease:
    """Move the arm to the joint angles ``q`` (n,) [rad] on a planned path, by a program.

    ``revocations``: number of the state in which the motion was decided.
    """

    q: FloatArray
    revocations: int


@dataclass(frozen=True)
class EndEase:
    """End the program."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Send joint angles ``q`` (n,) [rad] with their rates ``qd`` (n,) [rad/s] to the arm.

    ``first``: whether it is the first one, whose refusal is to be reported.
    """

    q: FloatArray
    qd: FloatArray
    revocations: int
    first: bool


@dataclass(frozen=True)
class FingerTarget:
    """Move the finger joint to ``angle`` [rad, or m for fingers that slide]."""

    angle: float
    revocations: int


@dataclass(frozen=True)
class ReleaseControl:
    """Release the lease, so that other people may clear a stop and drive."""


@dataclass(frozen=True)
class Say:
    """Report a sentence to the person."""

    text: str


Action = Ease | EndEase | Sample | FingerTarget | ReleaseControl | Say


class Follower:
    """The rules, advanced by ``step``.

    Attributes:
        phase: its activity.
        history: the newest postures of the leader.
    """

    def __init__(self, finger_range: tuple[float, float] | None, name: str = "") -> None:
        """Wait.

        Args:
            finger_range: finger joint closed and open; None without fingers.
            name: name of this client, as states give it.
        """
        self._name = name
        self.phase = LeadPhase.WAITING
        self.history = PostureHistory()
        self._range = finger_range
        self._eased: float | None = None
        self._revocations = 0
        self._first = True
        self._holds = False
        # Whether a state has shown that it drives, and whether a person has taken the arm then.
        self._drove = self._suspended = False
        self._finger: tuple[float, float] | None = None

    def step(
        self,
        t: float,
        posture: LeaderPosture | None,
        state: answers.State,
        heard: float,
        *,
        confirmed: bool = False,
    ) -> list[Action]:
        """Return what is to be done now.

        Args:
            t: now [s].
            posture: posture of the leader; None if it did not answer.
            state: newest state of the server.
            heard: time [s] at which it arrived, on the clock of ``t``.
            confirmed: whether a person asks to begin, or to end.
        """
        if self.phase is not LeadPhase.WAITING and (ended := self._ended(t, state, heard)):
            return ended
        accepted = posture is not None and self.history.add(t, posture)
        match self.phase:
            case LeadPhase.WAITING:
                # A person who gives the arm back asks for it as one who presses Enter does.
                confirmed |= self._suspended and state.holder == self._name
                return self._begun(t, state) if confirmed else self._released(t, state, heard)
            case _ if confirmed:
                return self.rest("You have ended it.")
            case LeadPhase.EASING:
                return self._arrived(state)
            case LeadPhase.SETTLING:
                return self._settled(t, state)
            case LeadPhase.FOLLOWING:
                return self._followed(t, state) if accepted else []

    def eased(self, since: float) -> None:
        """Take note that the program was accepted.

        ``since``: time of the server [s] from which states report it.
        """
        self._eased = since

    def rest(self, why: str) -> list[Action]:
        """Follow no longer, for the reason ``why``."""
        ends: list[Action] = [EndEase()] if self.phase is LeadPhase.EASING else []
        return [*ends, self.refused(why)]

    def refused(self, why: str) -> Say:
        """Follow no longer, because the server has refused a request for the reason ``why``."""
        self.phase = LeadPhase.WAITING
        return Say(f"{why} The arm rests.")

    def _begun(self, t: float, state: answers.State) -> list[Action]:
        self._drove = self._suspended = False
        if not self.history.fresh(t):
            return self.rest("The leader does not answer.")
        if state.stopped is not None:
            return self.rest(f"The arm is stopped: {state.stopped} Clear the stop first.")
        return self._ease(
            state, "The arm moves to the posture of the leader. Keep the leader still."
        )

    def _released(self, t: float, state: answers.State, heard: float) -> list[Action]:
        """Release the lease once the arm is at rest."""
        if not self._holds or state.moving or t - heard > SERVER_SILENCE:
            return []
        self._holds = False
        return [ReleaseControl()]

    def _ease(self, state: answers.State, text: str) -> list[Action]:
        self.phase, self._eased, self._revocations = LeadPhase.EASING, None, state.revocations
        return [Say(text), Ease(self.history.newest.q, state.revocations)]

    def _ended(self, t: float, state: answers.State, heard: float) -> list[Action]:
        """Return the actions that end the motion; none if it may continue."""
        if not self.history.fresh(t):
            return self.rest(f"The leader has sent no valid posture for {SILENCE:g} s.")
        if t - heard > SERVER_SILENCE:
            return self.rest("The server does not answer.")
        if state.stopped is not None:
            return self.rest(f"The arm was stopped: {state.stopped}")
        if self.phase is LeadPhase.EASING:
            # The program has a lease of its own, which counts as a revocation when it ends.
            return []
        other_drives = self._drove and state.holder not in (None, self._name)
        if other_drives or state.revocations != self._revocations:
            self._suspended = other_drives
            return self.rest("The arm was stopped or changed its driver.")
        if state.status == "paused":
            return self.rest("The arm was paused.")
        if state.status == "blocked" and self._distance(state) > HELD_BACK:
            return self.rest(f"The arm is held back: {state.why}")
        return []

    def _arrived(self, state: answers.State) -> list[Action]:
        program = state.program
        if self._eased is None or state.sent < self._eased or program is None:
            return []
        if not is_over(program):
            return []
        if program.status != "done":
            why = f"The arm did not reach the posture of the leader: {program.why}"
            return [self.refused(why)]
        self.phase, self._revocations, self._first = LeadPhase.SETTLING, state.revocations, True
        self._finger = None
        if self._distance(state) <= NEAR:
            return []
        return [Say("The leader has moved. Keep it still, and the arm moves there.")]

    def _settled(self, t: float, state: answers.State) -> list[Action]:
        if self._distance(state) <= NEAR:
            self.phase = LeadPhase.FOLLOWING
            return [Say("The arm follows the leader.")]
        if not self.history.at_rest(t):
            return []
        return self._ease(state, "The arm moves to the posture of the leader.")

    def _followed(self, t: float, state: answers.State) -> list[Action]:
        newest = self.history.newest
        sample = Sample(newest.q, self.history.rates(), self._revocations, self._first)
        self._first, self._holds = False, True
        self._drove |= state.holder == self._name
        grip = self._gripped(t, newest.finger, state.gripper)
        return [sample] if grip is None else [sample, grip]

    def _gripped(self, t: float, target: float | None, present: float) -> FingerTarget | None:
        """Return the next target of the fingers, which wait until the jaw has met them."""
        if target is None or self._range is None:
            return None
        span = abs(self._range[1] - self._range[0])
        if self._finger is None:
            if abs(target - present) <= FINGER_NEAR * span:
                self._finger = t, present
            return None
        then, last = self._finger
        if t - then < FINGER_INTERVAL or abs(target - last) < FINGER_STEP * span:
            return None
        self._finger = t, target
        return FingerTarget(target, self._revocations)

    def _distance(self, state: answers.State) -> float:
        """Return the largest difference of a joint of the leader from the setpoint [rad]."""
        return float(np.abs(self.history.newest.q - np.array(state.setpoint)).max())
