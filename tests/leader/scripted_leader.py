"""A leader and a server that follow a random script, for machines in Python and in JavaScript."""

from __future__ import annotations

import math
import random
from typing import Any

import msgspec
import numpy as np

from katana450.extensions.leader.follower import (
    Action,
    Ease,
    EndEase,
    FingerTarget,
    Follower,
    LeadPhase,
    ReleaseControl,
    Sample,
    Say,
)
from katana450.extensions.leader.joint_map import LeaderPosture
from tests.leader.follower_bench import FINGERS, Bench, ServerState

PERIOD = 0.012
"""[s] Time between two readings."""

REST, TIMES = 0.6, 30
"""Probability that the leader rests, and number of readings between two changes of mind."""


def scripted(seed: int, count: int = 1500) -> tuple[list[dict[str, Any]], list[list[Any]]]:
    """Return ``count`` inputs of a machine as JSON values, and what that in Python does with them.

    The server does what the machine asks, so that all phases are reached.
    """
    chance = random.Random(seed)
    follower, state = Follower(FINGERS), dict(Bench().values)
    t = heard = 100.0
    angle, finger, speed, done_at = 0.3, 0.5, 0.0, 0.0
    answers = hears = True
    inputs: list[dict[str, Any]] = []
    results: list[list[Any]] = []
    for number in range(count):
        t += PERIOD * chance.uniform(0.5, 1.5)
        if number % TIMES == 0:
            speed = 0.0 if chance.random() < REST else chance.uniform(-0.5, 0.5)
            answers, hears = chance.random() > 0.1, chance.random() > 0.07
            state |= {
                "stopped": "Ada pressed STOP." if chance.random() < 0.05 else None,
                "revocations": state["revocations"] + (chance.random() < 0.08),
                "status": chance.choices(("ok", "paused", "blocked"), (20, 1, 3))[0],
                "moving": chance.random() < 0.5,
            }
        angle += speed * PERIOD
        finger = min(max(finger + chance.uniform(-0.02, 0.02), 0.0), 1.0)
        if follower.phase is LeadPhase.EASING and 0.0 < done_at < t:
            status = chance.choices(("done", "failed"), (9, 1))[0]
            program = {"name": "", "by": "", "status": status, "why": "It ended."}
            state |= {"program": program, "setpoint": [angle + chance.uniform(-0.1, 0.1)] * 5}
        if hears:
            heard = state["sent"] = t
        jump = 1.0 if chance.random() < 0.02 else 0.0
        q = [angle + jump] * 5
        given = {"raw": q, "q": q, "finger": finger} if answers else None
        asked = chance.random() < (0.1 if follower.phase is LeadPhase.WAITING else 0.003)
        each = {"t": t, "posture": given, "state": dict(state), "heard": heard, "asked": asked}
        posture = None if given is None else LeaderPosture(np.array(q), np.array(q), finger)
        server: Any = msgspec.convert(state, ServerState)
        acts = follower.step(t, posture, server, heard, asked=asked)
        if any(isinstance(act, Ease) for act in acts):
            each["eased"] = t
            follower.eased(t)
            done_at = t + chance.uniform(0.05, 1.0)
            state["program"] = None
        if any(isinstance(act, Sample) for act in acts) and chance.random() < 0.9:
            state["setpoint"] = q
            state["gripper"] = finger
        inputs.append(each)
        results.append([follower.phase.value, *map(plain, acts)])
    return inputs, results


def plain(action: Action) -> dict[str, Any]:
    """Return ``action`` as JSON values, as the page has it."""
    match action:
        case Say(text=text):
            return {"act": "say", "text": text}
        case Ease(q=q, revocations=revocations):
            return {"act": "ease", "q": q.tolist(), "revocations": revocations}
        case Sample(q=q, qd=qd, revocations=revocations, first=first):
            rates = {"q": q.tolist(), "qd": qd.tolist()}
            return {"act": "sample", **rates, "revocations": revocations, "first": first}
        case FingerTarget(angle=angle, revocations=revocations):
            return {"act": "finger", "angle": angle, "revocations": revocations}
        case EndEase():
            return {"act": "end"}
        case ReleaseControl():
            return {"act": "release"}


def alike(one: Any, other: Any) -> bool:
    """Return whether two JSON values are equal, numbers up to rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(alike(one[each], other[each]) for each in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float) and isinstance(other, int | float):
        return math.isclose(one, other, abs_tol=1e-9)
    return bool(one == other)
