"""Execution of a plan on a server, as a stream of joint angles."""

from __future__ import annotations

import time

from katana450.client import Client
from katana450.library.trajectory import Trajectory
from katana450.server.api import requests
from katana450.server.api.answers import State


def stream(samples: Trajectory, client: Client) -> State:
    """Go to the first of ``samples``, follow the others at their times, and wait for rest.

    Each command is answered before the next is sent, so that a refusal ends the stream. After a
    stop or a change of driver the server refuses all further commands, even if the stop was cleared
    at once.
    """
    revocations = client.query(State).revocations
    client.go(requests.Joints(q=samples.q[0], revocations=revocations))
    started = time.monotonic()
    for t, q, qd in zip(samples.t.tolist(), samples.q, samples.qd, strict=True):
        time.sleep(max(started + t - time.monotonic(), 0.0))
        client.ask(requests.Servo(q=q, qd=qd, revocations=revocations))
    return client.go(requests.Joints(q=samples.q[-1], revocations=revocations))
