"""Faults of an emulated arm: a script of them, and which of them act now."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import yaml

from katana450.errors import InputError
from katana450.extensions.real_arm.emulator.arm import EmulatedArm

Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
Requests = Annotated[int, msgspec.Meta(ge=0, le=10**9)]
Axis = Annotated[int, msgspec.Meta(ge=1, le=6)]
Encoder = Annotated[float, msgspec.Meta(ge=-40000.0, le=40000.0)]


class Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="do"):
    """A fault, from a time or a number of requests on.

    Attributes:
        at: time after the start of the emulator from which on it acts [s].
        after: number of requests that are answered before it acts, in place of ``at``.
        lasts: time for which it acts [s]; None without an end.
    """

    at: Seconds | None = None
    after: Requests | None = None
    lasts: Seconds | None = None


class Once(Fault, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="do"):
    """A fault of single replies.

    Attributes:
        replies: number of replies that it spoils.
    """

    replies: Annotated[int, msgspec.Meta(ge=1, le=10**9)] = 1


class Delay(Fault, frozen=True, kw_only=True, tag="delay"):
    """Each reply is late by ``seconds``."""

    seconds: Seconds


class Jitter(Fault, frozen=True, kw_only=True, tag="jitter"):
    """Each reply is late by a random time of up to ``seconds``."""

    seconds: Seconds


class Silence(Fault, frozen=True, kw_only=True, tag="silence"):
    """Requests are executed, but nothing is answered."""


class HalfReply(Once, frozen=True, kw_only=True, tag="half_reply"):
    """The second half of a reply is not sent."""


class WrongCrc(Once, frozen=True, kw_only=True, tag="wrong_crc"):
    """A reply has a wrong checksum."""


class Reset(Once, frozen=True, kw_only=True, tag="reset"):
    """The connection is reset in place of a reply. The request was executed."""


class StuckAxis(Fault, frozen=True, kw_only=True, tag="stuck_axis"):
    """An axis is blocked where it is."""

    axis: Axis


class Obstacle(Fault, frozen=True, kw_only=True, tag="obstacle"):
    """Something stands in the way of an axis at ``encoder`` [counts of the calibrated arm]."""

    axis: Axis
    encoder: Encoder


class PowerCycle(Fault, frozen=True, kw_only=True, tag="power_cycle"):
    """The power is off for ``seconds``: the arm falls and is uncalibrated afterwards."""

    seconds: Seconds = 2.0


AnyFault = (
    Delay | Jitter | Silence | HalfReply | WrongCrc | Reset | StuckAxis | Obstacle | PowerCycle
)


class FaultScript(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Faults of an emulated arm.

    Attributes:
        faults: in any order.
        object_mm: width of an object between the fingers [mm].
        seed: of the random times.
    """

    faults: tuple[AnyFault, ...] = ()
    object_mm: Annotated[float, msgspec.Meta(ge=1.0, le=120.0)] | None = None
    seed: int = 450


def read_fault_script(path: Path) -> FaultScript:
    """Return the script in a YAML or JSON file. Raises InputError with the place of an error."""
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        script = msgspec.convert(content or {}, FaultScript)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except (yaml.YAMLError, UnicodeError) as error:
        raise InputError(f"{path} is no YAML: {error}.") from error
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {error}. See docs/arm-emulator.md for the form.") from error
    for number, fault in enumerate(script.faults):
        if fault.at is not None and fault.after is not None:
            raise InputError(f"{path}: `faults[{number}]` has `at` and `after`; give one of them.")
    return script


@dataclass
class _Scheduled:
    """A fault with its progress: when it began, what it spoiled, and whether it is over."""

    fault: AnyFault
    began: float | None = None
    spoiled: int = 0
    is_over: bool = False


@dataclass(frozen=True)
class ReplyFaults:
    """Way in which the next reply is sent.

    Attributes:
        delay: time after which it is sent [s].
        damage: the fault that spoils it, or None.
    """

    delay: float = 0.0
    damage: Silence | HalfReply | WrongCrc | Reset | None = None


CLEAN = ReplyFaults()


class FaultSchedule:
    """The faults of a script over time, applied to an arm and to its replies."""

    def __init__(self, script: FaultScript, arm: EmulatedArm) -> None:
        self._arm = arm
        self._faults = [_Scheduled(fault) for fault in script.faults]
        self._random = random.Random(script.seed)

    def follow(self, requests: int) -> None:
        """Begin and end faults for the time of the arm and the number of ``requests`` answered."""
        now = self._arm.time
        for each in self._faults:
            if each.is_over:
                continue
            fault = each.fault
            if each.began is None:
                if now < (fault.at or 0.0) or requests < (fault.after or 0):
                    continue
                each.began = now
                self._begin(fault)
            lasts = fault.seconds if isinstance(fault, PowerCycle) else fault.lasts
            if lasts is not None and now >= each.began + lasts:
                each.is_over = True
                self._end(fault)

    def next_reply(self) -> ReplyFaults:
        """Return how the next reply is sent."""
        active = [each for each in self._faults if each.began is not None and not each.is_over]
        if not active:
            return CLEAN
        delay = 0.0
        damage: Silence | HalfReply | WrongCrc | Reset | None = None
        for each in active:
            match each.fault:
                case Delay(seconds=seconds):
                    delay += seconds
                case Jitter(seconds=seconds):
                    delay += self._random.uniform(0.0, seconds)
                case Silence():
                    damage = damage or each.fault
                case HalfReply() | WrongCrc() | Reset() if damage is None:
                    damage = each.fault
                    each.spoiled += 1
                    each.is_over = each.spoiled >= each.fault.replies
        return ReplyFaults(delay, damage)

    def _begin(self, fault: AnyFault) -> None:
        match fault:
            case StuckAxis(axis=axis):
                self._arm.block(axis)
            case Obstacle(axis=axis, encoder=encoder):
                self._arm.obstruct(axis, encoder)
            case PowerCycle():
                self._arm.switch_off()

    def _end(self, fault: AnyFault) -> None:
        match fault:
            case StuckAxis(axis=axis) | Obstacle(axis=axis):
                self._arm.release(axis)
            case PowerCycle():
                self._arm.switch_on()
