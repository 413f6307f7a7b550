"""Acts: what people, scripts, programs and the server itself ask of the arm or of the server.

An act is one class. The API decodes it, the gate judges it, the mailbox orders it, the session
executes it, recordings and the event log write it, and clients send it. A ``Command`` is executed
by the session of the arm; a ``Request`` can come from outside; most acts are both. An act is
checked when it is made, so every number in it is finite and every array has the right shape.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeVar

import msgspec
from msgspec import Meta

MIN_WAIT, MAX_WAIT = 0.1, 600.0
"""Limits of the time in which a motion that a request waits for has to end [s]."""

MAX_JOINTS = 32

Id = Annotated[int, Meta(ge=0, le=2**53 - 1)] | Annotated[str, Meta(max_length=64)] | None
Name = Annotated[str, Meta(min_length=1, max_length=40)]

K = TypeVar("K", bound="Act")


def tag_of(name: str) -> str:
    """Return the tag of the message class ``name``: ``clear_stop`` for ``ClearStop``."""
    return re.sub(r"(?<=.)([A-Z])", r"_\1", name).lower()


@dataclass(frozen=True, kw_only=True)
class Traits:
    """Traits of one class of acts. The default is a motion of an arm that has a tool.

    No other list decides who may ask for an act, and when.

    Attributes:
        stream: several in a row are one motion, so a newer one replaces one that waits for a tick.
        relative: counts from the present target, so that several in a row add up.
        while_stopped: takes effect while a stop holds the arm; all others are refused then.
        while_paused: takes effect during a pause. A jog does not: it has no goal to keep for later.
        supersedes: ends the motion or the program that is under way or being planned.
        passive: leaves a path that is being planned as it is; all others end the planning.
        pacing: may also be given by the owner of the running program, which holds the lease itself.
            A request of the owner goes to the program.
        protective: may also be given by the server itself, which never moves the arm.
        joints_only: possible for a mechanism that has joints and no tool.
        planned: a path is planned first, so the command takes effect later than its ticket.
        goal: name of its change of the arm's goal, by which undo names it; empty if it changes
            none.
        gesture: continues the change by the command before it if it follows soon, as the samples of
            a stream do, so that undo takes both back.
        safety: may be given by every participant at any time, also without the lease and beyond
            the rate limit. It is never refused, and commands that wait before it are dropped.
        at_once: answered at once, before the arm's process has taken it.
        free: costs nothing of the budget, even when that is used up.
        question: changes nothing.
        answered: answered even without an ``id``.
        extension: answered by an extension. A server without it refuses the request.
    """

    stream: bool = False
    relative: bool = False
    while_stopped: bool = False
    while_paused: bool = True
    supersedes: bool = True
    passive: bool = False
    pacing: bool = False
    protective: bool = False
    joints_only: bool = False
    planned: bool = False
    goal: str = ""
    gesture: bool = False
    safety: bool = False
    at_once: bool = False
    free: bool = False
    question: bool = False
    answered: bool = False
    extension: bool = False

    def __post_init__(self) -> None:
        if self.passive and self.supersedes:
            raise ValueError("A command that supersedes a motion cannot be passive to planning.")
        if self.planned and self.joints_only:
            raise ValueError("A path is planned only for an arm with a tool.")


class Act(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    repr_omit_defaults=True,
    tag_field="do",
    tag=tag_of,
):
    """Base of all acts. ``do`` is the name of the class as ``tag_of`` gives it.

    Each class declares ``traits``.
    """

    traits: ClassVar[Traits]


class Command(Act, frozen=True):
    """Base of the acts that the session of the arm executes."""

    @property
    def parts(self) -> tuple[Command, ...]:
        """The single commands in this one."""
        return (self,)

    @property
    def sample(self) -> bool:
        """True if it is one of many in a row, which is refused when it arrives late.

        The hand may have let go since it was made.
        """
        return self.traits.stream or self.traits.relative

    def replaces(self, waiting: Command) -> bool:
        """Return whether ``waiting``, the newest command before this one, need not be executed."""
        return self.traits.stream and type(waiting) is type(self)


class Request(Act, frozen=True, kw_only=True):
    """Base of the acts that can come from outside, as JSON objects of exactly these shapes.

    Attributes:
        id: Number or text of the client's own, repeated in the answer.
        revocations: Number from a state or an answer. A command is refused if there was a stop or
            a change of driver since then.
        made: Time of its making on the client's own clock [s], in all requests of a connection or
            in none. The server compares it with the least delay so far. A jog, a step, a sample of
            a stream or another target that is late is refused, and a late heartbeat counts as old.
    """

    id: Id = None
    revocations: Annotated[int, Meta(ge=0)] | None = None
    made: float | None = None


class MotionRequest(Request, frozen=True, kw_only=True):
    """Base of the requests whose answer can come at the end of their motion.

    Attributes:
        wait: Maximum duration of the motion [s]. The answer then comes at its end and has ``end``,
            and the open connection counts as the heartbeat. Without it the answer comes at once.
    """

    wait: Annotated[float, Meta(ge=MIN_WAIT, le=MAX_WAIT)] | None = None


ENVELOPE = MotionRequest.__struct_fields__
"""Names of the fields of a request that say nothing about the act itself."""


def content_names(kind: type[Act]) -> tuple[str, ...]:
    """Return the names of the fields of ``kind`` without those of the envelope."""
    return tuple(name for name in kind.__struct_fields__ if name not in ENVELOPE)


def classes_of(base: type[K]) -> tuple[type[K], ...]:
    """Return all classes of acts of ``base`` that can be made, in the order of their definition."""
    below = [kind for child in base.__subclasses__() for kind in classes_of(child)]
    return tuple(dict.fromkeys((*((base,) if hasattr(base, "traits") else ()), *below)))
