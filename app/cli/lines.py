"""``katana450 fk`` and ``katana450 ik``: a JSON object a line in, one a line out."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from app.control.choices import met
from app.errors import InputError
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.kinematics.badge import Badge
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.inverse import inverse
from app.kinematics.projection import project
from app.robot.collision import standing_around, world_of
from app.robot.model import load
from app.robot.props import load_props

Answer = Callable[[Mapping[str, Any]], dict[str, Any]]


class Kinematics:
    """Forward and inverse kinematics of the arm in the URDF, on plain JSON values."""

    def __init__(
        self, urdf: Path, tool: str | None, *, in_base_frame: bool, badges: bool = False
    ) -> None:
        """``in_base_frame``: poses are in the base frame on the table, else in {S}.

        ``urdf``, ``tool``: the arm, and the link that is its default tool; see ``load``.
        ``badges``: solutions carry what they cost to take from the request's ``q``.
        """
        self._badges = badges
        model = load(urdf, tool)
        self._arm = model.arm
        self._world = None
        if badges:
            world, _ = world_of(model)
            self._world = world and world.with_obstacles(standing_around(load_props()))
        self._T_frame_shoulder = model.T_base_shoulder if in_base_frame else np.eye(4)

    def fk(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """``{"q": [n rad], "tool"}`` to ``{"T": 4x4}`` [m]."""
        chain = self._chain(request, {"q", "tool"})
        q = chain.check_q(_numbers(request, "q"))
        return {"T": (self._T_frame_shoulder @ forward(chain, q)).tolist()}

    def ik(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """``{"T": 4x4, "tool"}`` to every solution for the nearest pose five axes can do.

        The residuals say how far that pose is from ``T``, limits of the joints left aside:
        ``within_limits`` tells of each solution whether the arm can go there. With badges there are
        also its way from ``q`` ([n rad]; the zero posture if not given), its smallest singular
        value, and the two parts in contact there, if any are, with the finger joint at 0 or the
        limit next to it.
        """
        chain = self._chain(request, {"T", "tool", "q"} if self._badges else {"T", "tool"})
        start = chain.check_q(request.get("q", [0.0] * chain.n))
        T = se3.validated(_numbers(request, "T"), "T")
        T_shoulder = se3.inverse(self._T_frame_shoulder) @ T
        nearest = project(chain, T_shoulder, within_limits=False).T
        # With axes that do not cross, not every branch reaches every pose.
        solutions = [solution for solution in inverse(chain, nearest) if solution.exact]
        reached = [forward(chain, solution.q) for solution in solutions]
        return {
            "solutions": [
                {
                    "q": solution.q.tolist(),
                    "within_limits": solution.within_limits,
                    "branch": str(solution.branch),
                }
                | (self._badge(Badge.of(chain, solution, start)) if self._badges else {})
                for solution in solutions
            ],
            "residual_mm": 1e3 * max(_distance(T_shoulder, T_q) for T_q in reached),
            "residual_rad": max(so3.angle(T_shoulder[:3, :3], T_q[:3, :3]) for T_q in reached),
        }

    def _badge(self, badge: Badge) -> dict[str, Any]:
        contact = met(self._world, badge.q, self._arm.gripper.clamp(0.0))
        return {
            "distance_rad": badge.distance,
            "time_s": badge.time,
            "smallest_singular_value": badge.smallest_singular_value,
            "contact": None if contact is None else contact.parts,
        }

    def _chain(self, request: Mapping[str, Any], keys: set[str]) -> Chain:
        unknown = set(request) - keys
        if unknown:
            raise InputError(f"There is no key {sorted(unknown)[0]!r}; known: {sorted(keys)}.")
        return self._arm.chain_to(request.get("tool", self._arm.default_tool))


def answer_lines(answer: Answer, source: TextIO | None = None, sink: TextIO | None = None) -> None:
    """Answer each line as it comes; a bad one gets ``{"error": ...}`` and the rest go on."""
    source, sink = source or sys.stdin, sink or sys.stdout
    for number, line in enumerate(source, start=1):
        if not line.strip():
            continue
        try:
            reply = answer(_request(line))
        except InputError as error:
            reply = {"error": f"line {number}: {error}"}
        print(json.dumps(reply, allow_nan=False), file=sink, flush=True)


def _request(line: str) -> Mapping[str, Any]:
    try:
        request = json.loads(line)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"This is not JSON: {error}") from error
    if not isinstance(request, dict):
        raise InputError(f"A request is a JSON object, not a {type(request).__name__}.")
    return request


def _numbers(request: Mapping[str, Any], key: str) -> Any:
    if key not in request:
        raise InputError(f"The key {key!r} is missing.")
    return request[key]


def _distance(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
