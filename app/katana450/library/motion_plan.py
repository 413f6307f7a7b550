"""A plan of the arm, for use in programs: it can be sampled, plotted, shown or run.

matplotlib is loaded when a plan is plotted.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from katana450.errors import InputError
from katana450.library.pose_frame import PoseFrame
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.plan import Plan, Segment

if TYPE_CHECKING:
    from katana450.client import Client
    from katana450.server.api.answers import State
    from katana450.server.api.requests import Request

DRAWN_SAMPLES: Final = 400
"""Number of intervals of a plan in its figure."""

MAX_WAIT: Final = 2.0
"""[s] Time for which a run waits until a slow machine or connection takes a sample in time."""


MAX_SAMPLES = 1_000_000
"""Maximum number of samples; their poses take 128 MB."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of a plan. Every sample is evaluated on the plan; nothing is interpolated.

    Attributes:
        t: (N,) times from the start [s], at equal steps except the last, which is the end.
        q, qd, qdd: (N, n) joint angles and their derivatives [rad, rad/s, rad/s^2].
        T: (N, 4, 4) poses of the tool in the frame of the arm object [m].
    """

    t: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    T: FloatArray

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    @property
    def points(self) -> FloatArray:
        """(N, 3) positions of the tool point [m]."""
        return self.T[:, :3, 3]


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """A timed, collision-free path of the joints, from rest to rest.

    Made by `Arm.plan`, `Arm.line` and `Arm.circle`. Speed, acceleration and jerk of the joints and
    the speed of the tool point (0.5 m/s) keep their limits. Bodies keep a distance of 6 mm.

    Attributes:
        core: the plan as the controller follows it.
        chain: the arm for which it was planned, with its tool.
        pose_frame: the frame of the poses of its samples.
    """

    core: Plan
    chain: Chain
    pose_frame: PoseFrame

    def __repr__(self) -> str:
        """Return a short description."""
        return f"<katana450 plan, {self.duration:.2f} s, {1e3 * self.length:.0f} mm>"

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.core.duration

    @property
    def length(self) -> float:
        """Length of the tool point's path [m]."""
        return self.core.length

    @property
    def start(self) -> FloatArray:
        """(n,) joint angles where it begins [rad]."""
        return self.core.start

    @property
    def end(self) -> FloatArray:
        """(n,) joint angles where it ends [rad]."""
        return self.core.end

    @property
    def clearance(self) -> float | None:
        """Minimum distance between two bodies on the whole path [m].

        None if the arm's description has no collision shapes; the path is then not checked.
        """
        return None if self.core.nearest is None else self.core.nearest.contact.distance

    def sample(self, dt: float = 0.01) -> Trajectory:
        """Return the motion every ``dt`` [s], from start to end.

        Raises InputError if ``dt`` is not a number above 0, or gives a million samples or more.

        >>> samples = arm.line(by=(0.0, 0.0, -0.05)).sample(0.01)
        >>> samples.q.shape == samples.qd.shape == (len(samples), 5)
        True
        >>> bool(np.allclose(samples.points[-1] - samples.points[0], (0.0, 0.0, -0.05)))
        True
        """
        return _sampled(self.core, dt, self.chain, self.pose_frame)

    def plot(self) -> Any:
        """Draw the tool's path and the joints over time; return the matplotlib ``Figure``.

        This call loads matplotlib. Raises ConfigurationError if it is not installed.

        >>> figure = arm.circle((0.15, 0.0, -0.11), 0.1).plot()
        >>> figure.savefig("circle.png")  # doctest: +SKIP
        """
        return _figure(self.sample(self.duration / DRAWN_SAMPLES))

    def run(self, client: Client, dt: float = 0.02, speed: float = 1.0) -> State:
        """Drive the arm of a server along this plan; return its state once it rests at the end.

        The arm first goes to the start, then follows the joint angles as a stream. A stop or a
        change of driver ends the run, even if the stop is cleared at once: the server refuses the
        rest of the plan. While this machine or the connection is too slow, the arm rests and the
        plan waits, for MAX_WAIT at most.

        Args:
            client: a connection, from `katana450.connect`.
            dt: time from one command to the next [s].
            speed: fraction of the plan's own speed, above 0 and up to 1.

        Raises:
            RefusedError: the server refuses a command, or the arm is stopped.
            LostError: the connection is lost.
            InputError: as `sample`, or an invalid speed.
        """
        from katana450.server.api import answers, requests

        if not 0.0 < speed <= 1.0:
            raise InputError(f"The speed is {speed!r}; it must be above 0 and up to 1.")
        samples = self.sample(dt * speed)
        # After a stop, even one that was cleared at once, the server refuses all that follows.
        revocations = client.query(answers.State).revocations
        client.go(requests.Joints(q=samples.q[0], revocations=revocations))
        started = time.monotonic()
        for t, q, qd in zip(samples.t / speed, samples.q, samples.qd * speed, strict=True):
            time.sleep(max(started + t - time.monotonic(), 0.0))
            # Each command is answered before the next is sent, so that a refusal ends the stream.
            if _has_waited(client, requests.Servo(q=q, qd=qd, revocations=revocations)):
                started = time.monotonic() - t
        return client.go(requests.Joints(q=samples.q[-1], revocations=revocations))


def _has_waited(client: Client, sample: Request) -> bool:
    """Send ``sample`` until the server takes it; return whether it had to be sent again.

    Raises RefusedError for a refusal that is final, and after MAX_WAIT.
    """
    from katana450.client import RefusedError

    deadline, has_waited = time.monotonic() + MAX_WAIT, False
    while True:
        try:
            client.ask(sample)
        except RefusedError as refusal:
            if refusal.retry is None or time.monotonic() > deadline:
                raise
            has_waited = True
            time.sleep(refusal.retry)
        else:
            return has_waited


def _sampled(plan: Plan, dt: float, chain: Chain, frame: PoseFrame) -> Trajectory:
    """Sample ``plan`` every ``dt`` [s] and at its end. Raises InputError for an invalid ``dt``."""
    if not (isinstance(dt, int | float) and math.isfinite(dt) and dt > 0.0):
        raise InputError(f"The sampling time must be a number of seconds above 0, not {dt!r}.")
    count = math.ceil(plan.duration / dt - 1e-9)
    if count >= MAX_SAMPLES:
        raise InputError(
            f"A sampling time of {dt:g} s gives {count} samples of this plan; "
            f"choose one that gives fewer than {MAX_SAMPLES}."
        )
    t = np.append(dt * np.arange(count), plan.duration)
    starts = np.cumsum([0.0, *(segment.scaling.duration for segment in plan.segments)])
    numbers = np.searchsorted(starts[1:-1], t, side="right")
    moved = np.array(
        [
            _motion(plan.segments[number], time - float(starts[number]))
            for number, time in zip(numbers.tolist(), t.tolist(), strict=True)
        ]
    )
    q, qd, qdd = (frozen(moved[:, order]) for order in range(3))
    return Trajectory(frozen(t), q, qd, qdd, frozen(frame.from_shoulder(forward_batch(chain, q))))


def _motion(segment: Segment, t: float) -> FloatArray:
    """Return (3, n) angles, speeds and accelerations ``t`` [s] after the start of ``segment``."""
    tau, speed, acceleration = segment.scaling.motion_after(t)
    moving = segment.at(tau)
    return np.array(
        (
            moving.q,
            speed * moving.first,
            speed**2 * moving.second + acceleration * moving.first,
        )
    )


def _figure(samples: Trajectory) -> Any:
    """Draw ``samples`` of a plan and return the matplotlib ``Figure``, still open."""
    from katana450.extensions.media.figures import AXES, STYLE, TIME, draw_joints, equal_axes

    plt = import_module("matplotlib.pyplot")
    points = 1e3 * samples.points
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(9.0, 3.9), layout="constrained")
        space = figure.add_subplot(1, 2, 1, projection="3d")
        space.plot(*points.T, color=AXES[0], linewidth=1.4)
        space.scatter(*points[0], color=AXES[1], s=16, label="start")
        equal_axes(space, points)
        space.set_title("Path of the tool point")
        space.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
        space.legend(loc="upper left", fontsize=8.0)
        panel = figure.add_subplot(1, 2, 2)
        draw_joints(panel, samples.t, np.degrees(samples.q))
        panel.set_title("Joint angles")
        panel.set_xlabel(TIME)
        panel.set_ylabel("angle (deg)")
        panel.legend(ncols=samples.q.shape[1], fontsize=8.0, loc="upper center")
        panel.margins(x=0.0, y=0.15)
    return figure
