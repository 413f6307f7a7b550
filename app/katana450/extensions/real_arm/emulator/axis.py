"""One emulated axis: a motor with encoder, its orders, and the state that it reports."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

from katana450.extensions.real_arm.codec.replies import AxisStatus
from katana450.extensions.real_arm.codec.requests import AxisSegment, More
from katana450.extensions.real_arm.encoder_map import AXIS_FACTS, MAX_SPEED, AxisFacts
from katana450.extensions.real_arm.plant.axis import STEP, PlantAxis, PlantProfile


@dataclass(frozen=True)
class MotorFacts:
    """One motor as its controller knows it after power-up.

    Attributes:
        axis: encoder and joint.
        speed: speed limit [counts / 10 ms], as the motor counts.
        collision_limit: deviation from the setpoint that counts as a collision [counts].
    """

    axis: AxisFacts
    speed: int
    collision_limit: int

    @property
    def counts_per_radian(self) -> float:
        """Encoder counts in a radian of the joint's motor."""
        return self.axis.encoders_per_turn / math.tau

    @property
    def stops(self) -> tuple[int, int]:
        """Mechanical stops in counts of the calibrated arm, the lower one first."""
        return self.axis.encoder_min, self.axis.encoder_max

    @property
    def stop(self) -> int:
        """Counts of the stop that the calibration searches."""
        return self.axis.encoder_offset

    @property
    def sign(self) -> int:
        """Direction of that stop: 1 or -1."""
        return 1 if self.stop > 0 else -1

    @property
    def halving(self) -> float:
        """Counts of the motor in a count of the protocol; its limits are in those of the motor."""
        return MAX_SPEED / self.axis.speed


CONFIGURED = ((30, 250), (25, 200), (20, 250), (25, 200), (25, 100), (25, 100))
"""Speed and collision limits of the axes, from the configuration of this arm."""

MOTORS = tuple(
    MotorFacts(axis, *limits) for axis, limits in zip(AXIS_FACTS, CONFIGURED, strict=True)
)

CALIBRATION_ORDER = (2, 3, 4, 5, 6, 1)
"""Axes in the order in which they are calibrated."""

CALIBRATED_AT = 30500
"""Counts, with the sign of the stop, at which the calibration leaves an axis of a real arm."""

MAX_ACCELERATION = 20000.0
"""[counts/s^2] Larger of the two acceleration limits, 2 counts / (10 ms)^2."""

POWER_UP_POSTURE = (12000, -24000, -22000, 20000, 12000, 24000)
"""Counts where the emulated arm stands before its first calibration."""


DEPTH = 16
"""Polynomials that fit. Reported by people who drove real arms, as a guess."""

TICK = 0.01
"""[s] Unit of time of the polynomials."""


class SplineBuffer:
    """The waiting polynomials of an axis, and the one that is executed.

    A polynomial stays in the buffer until it ends. When the next one is late, the setpoint waits at
    the end of the last.

    Attributes:
        position: the setpoint [counts].
        speed: its speed [counts/s].
    """

    def __init__(self) -> None:
        self.position = 0.0
        self.speed = 0.0
        self._waiting: deque[tuple[AxisSegment, bool]] = deque()
        self._tick = 0.0
        self._is_last = False
        self.is_running = False

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def is_full(self) -> bool:
        """True if no further polynomial fits."""
        return len(self._waiting) >= DEPTH

    def store(self, segment: AxisSegment, more: int) -> None:
        """Append ``segment``. The caller has checked ``is_full``."""
        self._waiting.append((segment, more == More.LAST))

    def start(self, more: int) -> None:
        """Execute what is stored. The newest polynomial is the end of the motion for LAST."""
        if more == More.LAST and self._waiting:
            self._waiting[-1] = (self._waiting[-1][0], True)
        if not self.is_running and self._waiting:
            self.is_running, self._is_last, self._tick = True, False, 0.0
            self.position = float(self._waiting[0][0].p0)

    def flush(self) -> None:
        """Drop all polynomials but the one that is executed, which ends the motion then."""
        current = self._waiting[0][0] if self.is_running and self._waiting else None
        self._waiting.clear()
        if current is not None:
            self._waiting.append((current, True))
        self._is_last = True

    def clear(self) -> None:
        """Drop everything and end the motion."""
        self._waiting.clear()
        self.is_running = False
        self.speed = 0.0

    def advance(self, dt: float) -> None:
        """Move the setpoint for ``dt`` [s]; ``is_running`` is False after the end."""
        self._tick += dt / TICK
        while self._waiting:
            segment, is_last = self._waiting[0]
            if self._tick < segment.ticks:
                self.position = segment.at(self._tick)
                self.speed = segment.speed_at(self._tick) / TICK
                return
            self._waiting.popleft()
            self._tick -= max(segment.ticks, 0)
            self.position, self.speed = float(segment.target), 0.0
            self._is_last = is_last
        self._tick = 0.0
        self.is_running = self.is_running and not self._is_last


class TargetMove:
    """A setpoint that speeds up, travels, and slows down to rest at its target.

    Attributes:
        position: the setpoint [counts].
        speed: its speed [counts/s].
        target: where it ends [counts].
    """

    def __init__(self, position: float, speed: float, target: float) -> None:
        self.position = position
        self.speed = speed
        self.target = target

    @property
    def is_done(self) -> bool:
        """True once the setpoint rests at the target."""
        return self.position == self.target and self.speed == 0.0

    def advance(self, dt: float, max_speed: float, acceleration: float) -> None:
        """Move the setpoint for ``dt`` [s] within limits [counts/s] and [counts/s^2]."""
        distance = self.target - self.position
        # The fastest speed from which the rest of the way is enough to brake.
        allowed = min(math.sqrt(2.0 * acceleration * abs(distance)), max_speed)
        wanted = math.copysign(allowed, distance)
        change = acceleration * dt
        speed = self.speed + min(max(wanted - self.speed, -change), change)
        if abs(distance) <= abs(speed) * dt and abs(speed) <= change + allowed:
            self.position, self.speed = self.target, 0.0
            return
        self.position += speed * dt
        self.speed = speed


SPEED_LIMIT, ACCELERATION_LIMIT, COLLISION_LIMIT, SPLINE_COLLISION_LIMIT = 3, 4, 5, 6
"""Numbers of parameters of an axis."""

PRESSING_TIME = 0.15
"""[s] Time at the whole current of the motor that counts as a collision. Assumed."""

PWM_MAX = 127
"""Drive at the whole effort, as the larger limits of the configuration."""


class AxisMode(Enum):
    """Activity of an axis."""

    OFF = "off"
    BRAKE = "brake"
    HOLD = "hold"
    TARGET = "target"
    SPLINE = "spline"
    CALIBRATE = "calibrate"


class EmulatedAxis:
    """An axis. Its own counts are those of the calibrated arm; ``offset`` leads to what it reports.

    Attributes:
        facts: numbers of its motor.
        plant: its motion.
        offset: what the encoder reports minus the true counts.
        is_calibrated: whether the offset was set by a calibration.
        is_supported: whether something holds the axis up while its motor is off.
        mode: what it does.
        status: status byte that it reports, apart from ``SPLINE_BUFFER_FULL``.
        splines: its polynomials.
        setpoint: where it should be [counts].
    """

    def __init__(self, facts: MotorFacts, profile: PlantProfile, position: float) -> None:
        """Create an axis at ``position`` [counts] as after power-up."""
        self.facts = facts
        self.plant = PlantAxis(
            profile,
            position,
            facts.stops,
            facts.axis.speed / TICK,
            MAX_ACCELERATION / facts.halving,
            facts.counts_per_radian,
        )
        self.splines = SplineBuffer()
        self._move = TargetMove(position, 0.0, position)
        self.mode, self.status = AxisMode.OFF, AxisStatus.OFF
        # The weight under which nothing changes any more, until the axis is touched.
        self._still_under: float | None = None
        self.setpoint, self._speed, self._pressed = position, 0.0, 0.0
        self.parameters = {
            SPEED_LIMIT: (facts.speed, facts.speed, 0),
            ACCELERATION_LIMIT: (1, 0, 0),
            COLLISION_LIMIT: (*divmod(facts.collision_limit, 256), 0),
            SPLINE_COLLISION_LIMIT: (*divmod(facts.collision_limit, 256), 0),
        }
        self.offset = -round(self.plant.position)
        self.is_calibrated = self.is_supported = False

    @property
    def position(self) -> int:
        """Count that the encoder reports, a signed number of 16 bits."""
        return (round(self.plant.position) + self.offset + 0x8000) % 0x10000 - 0x8000

    @property
    def reported_status(self) -> int:
        """Status byte."""
        if self.mode is AxisMode.SPLINE and self.splines.is_full:
            return AxisStatus.SPLINE_BUFFER_FULL
        return self.status

    @property
    def pwm(self) -> int:
        """Drive of the motor as a byte: the size of its effort."""
        return round(abs(self.plant.effort) * PWM_MAX)

    def turn_off(self) -> None:
        """Switch the current off. The weight moves the axis then."""
        self._enter(AxisMode.OFF, AxisStatus.OFF)

    def freeze(self) -> None:
        """Brake, and hold where the axis comes to rest."""
        self._enter(AxisMode.BRAKE, AxisStatus.FIXED)

    def collide(self) -> None:
        """Brake and hold as after a collision."""
        self._enter(AxisMode.BRAKE, AxisStatus.COLLIDED)

    def move_to(self, reading: int) -> None:
        """Move to the encoder value ``reading``."""
        start = self._move if self.mode is AxisMode.TARGET else None
        position = self.setpoint if start or self.mode is AxisMode.HOLD else self.plant.position
        speed = start.speed if start else 0.0
        self._enter(AxisMode.TARGET, AxisStatus.MOVING_TO_TARGET)
        self._move = TargetMove(position, speed, reading - self.offset)

    def start_splines(self, more: int) -> None:
        """Execute the stored polynomials."""
        self.splines.start(more)
        if self.splines.is_running and self.mode is not AxisMode.SPLINE:
            self.mode, self.status = AxisMode.SPLINE, AxisStatus.MOVING
            self.touch()
            self._pressed = 0.0

    def begin_calibration(self) -> None:
        """Let ``calibrate`` lead the axis from now on."""
        self._enter(AxisMode.CALIBRATE, AxisStatus.CALIBRATING)

    def lead(self, setpoint: float, speed: float) -> None:
        """Set the setpoint [counts] and its speed [counts/s] during a calibration."""
        self.setpoint, self._speed = setpoint, speed
        self.touch()

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of speed [counts/s] and acceleration [counts/s^2] as the host has set them."""
        forward, reverse, _ = self.parameters[SPEED_LIMIT]
        upwards = self._move.target >= self._move.position
        speed = (forward if upwards else reverse) / TICK
        acceleration = max(self.parameters[ACCELERATION_LIMIT][0], 1) / TICK**2
        return max(speed, 100.0) / self.facts.halving, acceleration / self.facts.halving

    def step(self, load: float) -> bool:
        """Take a step of the plant under the weight ``load``; return whether anything changed."""
        if self._still_under == load:
            return False
        changed = self._moved(load)
        self._still_under = None if changed else load
        return changed

    def touch(self) -> None:
        """Simulate again, because something round the axis changed."""
        self._still_under = None

    def _moved(self, load: float) -> bool:
        plant = self.plant
        match self.mode:
            case AxisMode.OFF:
                return plant.coast(0.0 if self.is_supported else load)
            case AxisMode.BRAKE:
                before = plant.speed
                plant.brake(load)
                self.setpoint, self._speed = plant.position, 0.0
                if plant.speed * before <= 0.0:
                    self.mode = AxisMode.HOLD
                return True
            case AxisMode.TARGET:
                self._move.advance(STEP, *self.limits)
                self.setpoint, self._speed = self._move.position, self._move.speed
                if self._move.is_done:
                    self.mode, self.status = AxisMode.HOLD, AxisStatus.FIXED
            case AxisMode.SPLINE:
                self.splines.advance(STEP)
                self.setpoint = self.splines.position - self.offset
                self._speed = self.splines.speed
                if not self.splines.is_running:
                    self.mode, self.status = AxisMode.HOLD, AxisStatus.SPLINES_DONE
        changed = plant.follow(self.setpoint, self._speed, load)
        return changed or self.mode is not AxisMode.HOLD

    def has_collided(self) -> bool:
        """Return whether deviation and current mean a collision. Called once each step."""
        watched = (AxisMode.HOLD, AxisMode.TARGET, AxisMode.SPLINE)
        if self.mode not in watched or self.status == AxisStatus.COLLIDED:
            return False
        presses = abs(self.plant.effort) >= 1.0
        self._pressed = self._pressed + STEP if presses else 0.0
        in_spline = self.mode is AxisMode.SPLINE
        high, low, _ = self.parameters[SPLINE_COLLISION_LIMIT if in_spline else COLLISION_LIMIT]
        deviation = abs(self.setpoint - self.plant.position)
        return deviation > (256 * high + low) or self._pressed > PRESSING_TIME

    def _enter(self, mode: AxisMode, status: AxisStatus) -> None:
        self.mode, self.status = mode, status
        self.touch()
        self.splines.clear()
        self.setpoint, self._speed, self._pressed = self.plant.position, 0.0, 0.0
        if mode is not AxisMode.OFF:
            self.is_supported = False
