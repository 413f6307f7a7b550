"""Second path of STOP, as the front end knows it: its port, and whether it answers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class StopPath:
    """The port that serves STOP alone.

    Attributes:
        port: Port to which clients also send STOP; None if they have only the address of a proxy,
            or if there is no such port.
        problem: Problem of the path in words; empty if it answers.
    """

    port: int | None = None
    problem: str = ""
