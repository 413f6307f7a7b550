"""A file in which the joints that closed loops move follow others, in place of the loops.

A loop is closed where two frames on different links meet: in one point for a ball, in a point and
an axis for a hinge, and in a whole pose for a weld. The joints of the loops are divided into
drivers and followers, so that the followers' part of the constraint Jacobian has full rank. For
postures of the drivers the followers are found by Gauss-Newton steps, which project onto the
constraints. If the solved followers are proportional to one driver each, as in every parallelogram,
the closed robot is a tree with followers, exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring

import numpy as np

from katana450.arm.robot.description import explained
from katana450.arm.robot.urdf import Urdf, UrdfJoint, urdf_of
from katana450.assembly.robot_files import read_urdf
from katana450.errors import RobotDescriptionError
from katana450.extensions.derived_urdf import derived_urdf
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray


def solved_file(path: Path) -> Path:
    """Return a file with the robot at ``path`` as a tree with followers, without loops.

    Raises RobotDescriptionError with the loop that cannot be solved.
    """
    data = read_urdf(path)
    with explained(path):
        root, urdf = fromstring(data), urdf_of(data, path.parent)
        loops = [_loop(element, set(urdf.links), path) for element in root.findall("loop_joint")]
        solved = [closure.followers() for closure in closures(urdf, loops, path.name)]
        followers = {closure.joint: closure for some in solved for closure in some}
    for element in root.findall("loop_joint"):
        root.remove(element)
    for joint in root.findall("joint"):
        follower = followers.get(joint.attrib["name"])
        if follower is not None:
            factor, offset = repr(follower.factor), repr(follower.offset)
            SubElement(joint, "mimic", joint=follower.driver, multiplier=factor, offset=offset)
    return derived_urdf(root, path, "loops")


def _loop(element: Element, links: set[str], path: Path) -> JointLoop:
    """Return the loop of an element <loop_joint>, as Drake and Isaac Sim write it."""
    name, kind = element.get("name", "without a name"), element.get("type", "")
    where = f"{path.name}: <loop_joint> {name!r}"
    # Isaac Sim names both ends link1.
    ends = [child for child in element if child.tag in ("link1", "link2")]
    named = tuple(end.get("link", "") for end in ends)
    if kind not in KINDS:
        raise RobotDescriptionError(
            f"{where} is of the type {kind!r}; closed loops are solved for {', '.join(KINDS)}."
        )
    if len(named) != 2 or not {*named} <= links:
        raise RobotDescriptionError(
            f"{where} must name two links of the robot in <link1> and <link2>, not "
            f"{', '.join(map(repr, named)) or 'none'}."
        )
    places = tuple(
        se3.from_rotation_translation(
            so3.from_rpy(*_numbers(end, "rpy", where).tolist()), _numbers(end, "xyz", where)
        )
        for end in ends
    )
    stated = element.find("axis")
    axis = np.array((1.0, 0.0, 0.0)) if stated is None else _numbers(stated, "xyz", where)
    size = float(np.linalg.norm(axis))
    if not size > 0.0:
        raise RobotDescriptionError(f"{where} has no axis.")
    return JointLoop(name, kind, (named[0], named[1]), (places[0], places[1]), axis / size)


def _numbers(element: Element, attribute: str, where: str) -> FloatArray:
    text = element.get(attribute, "0 0 0")
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise RobotDescriptionError(f"{where}: {attribute}={text!r} must be 3 finite numbers.")
    return numbers


KINDS = ("revolute", "continuous", "spherical", "fixed")
"""Types of a joint that closes a loop."""

CLOSED = 1e-9
"""Maximum opening [m] of a loop that counts as closed."""

PROPORTIONAL = 1e-6
"""Maximum opening [m] of a loop whose followers are moved in proportion to their drivers: files
round their lengths and angles to about as much."""

INDEPENDENT = 1e-6
"""Minimum singular value of a set of constraints, relative to the largest, that are independent."""

STEPS = 50
"""Maximum number of steps of a projection."""

PLACES = np.linspace(-1.0, 1.0, 9)
"""Postures of a driver at which its loop is solved, as fractions [1] of RANGE."""

RANGE = 0.5
"""[rad, m] Range of a driver in which its loops are solved, on both sides of zero."""


@dataclass(frozen=True, eq=False)
class JointLoop:
    """A joint that closes a loop.

    Attributes:
        name: of the joint.
        type: one of KINDS.
        links: names of the two links.
        places: pose (4, 4) of the joint in each of them [m].
        axis: (3,) unit direction of a hinge, in the frames of the joint.
    """

    name: str
    type: str
    links: tuple[str, str]
    places: tuple[FloatArray, FloatArray]
    axis: FloatArray


@dataclass(frozen=True)
class FollowingJoint:
    """A joint that a loop moves: value = factor * driver + offset [rad or m]."""

    joint: str
    driver: str
    factor: float
    offset: float


def closures(urdf: Urdf, loops: Sequence[JointLoop], file: str) -> list[Closure]:
    """Return the loops of a robot in groups that share no joint; ``file`` names it in messages."""
    groups: list[Closure] = []
    for loop in loops:
        new = Closure(urdf, [loop], file)
        shared = [group for group in groups if {*group.joints} & {*new.joints}]
        together = [other for group in shared for other in group.loops]
        groups = [group for group in groups if group not in shared]
        groups.append(Closure(urdf, [*together, loop], file))
    return groups


class Closure:
    """Loops that share joints, and these joints."""

    def __init__(self, urdf: Urdf, loops: Sequence[JointLoop], file: str) -> None:
        """Prepare the loops; ``file`` is its name for messages."""
        self._urdf = urdf
        self.loops = tuple(loops)
        self._file = file
        self._above = {joint.child: joint for joint in urdf.joints.values()}
        paths = [[self._path(link) for link in loop.links] for loop in loops]
        # The joints above both links do not move them against each other.
        inside = {name for one, other in paths for name in {*one} ^ {*other}}
        self.joints = tuple(
            name
            for name, joint in urdf.joints.items()
            if name in inside and joint.type != "fixed" and joint.mimic is None
        )

    def followers(self) -> tuple[FollowingJoint, ...]:
        """Return the joints that follow others in the closed robot.

        Raises RobotDescriptionError with the loop if it cannot be closed, or is not of the kind
        whose followers are proportional to a driver.
        """
        n = len(self.joints)
        if not n:
            raise self._refusal("has no joint that could move")
        start = self._projected(np.zeros(n), list(range(n)))
        if start is None:
            raise self._refusal("cannot be closed: its links do not meet in any posture near zero")
        drivers, following = self._divided(start)
        factors = np.zeros((len(following), len(drivers)))
        for column, driver in enumerate(drivers):
            self._solve(start, driver, following)
            J = self._jacobian(start)
            rates = np.linalg.lstsq(J[:, following], -J[:, driver], rcond=None)[0]
            factors[:, column] = [_simple(rate) for rate in rates.tolist()]
        if ((factors != 0.0).sum(axis=1) > 1).any():
            raise self._refusal("moves a joint by more than one other joint")
        for column, driver in enumerate(drivers):
            for place in PLACES.tolist():
                q = start.copy()
                q[driver] += RANGE * place
                q[following] += factors[:, column] * RANGE * place
                if np.abs(self._opening(q)).max() > PROPORTIONAL:
                    raise self._refusal("moves a joint out of proportion to another")
        # Several drivers at once, each somewhere in its range.
        for places in np.random.default_rng(0).uniform(-RANGE, RANGE, (len(PLACES), len(drivers))):
            q = start.copy()
            q[drivers] += places
            q[following] += factors @ places
            if np.abs(self._opening(q)).max() > PROPORTIONAL:
                raise self._refusal("moves a joint by more than one other joint")
        leads = [int(np.abs(row).argmax()) for row in factors]
        return tuple(
            FollowingJoint(
                self.joints[joint],
                self.joints[drivers[lead]],
                float(factors[number, lead]),
                float(start[joint] - factors[number, lead] * start[drivers[lead]]),
            )
            for number, (joint, lead) in enumerate(zip(following, leads, strict=True))
        )

    def _solve(self, start: FloatArray, driver: int, following: list[int]) -> None:
        """Raise RobotDescriptionError unless the loops can be closed all along a driver."""
        for places in (PLACES[PLACES >= 0.0], PLACES[PLACES <= 0.0][::-1]):
            q = start
            for place in places.tolist():
                q = q.copy()
                q[driver] = start[driver] + RANGE * place
                posture = self._projected(q, following)
                if posture is None:
                    raise self._refusal(
                        f"opens where joint {self.joints[driver]!r} turns by "
                        f"{np.degrees(RANGE * place):.0f}°"
                    )
                q = posture

    def _divided(self, q: FloatArray) -> tuple[list[int], list[int]]:
        """Return the joints that drive, first in the file, and those that follow."""
        J = self._jacobian(q)
        rank = _rank(J)
        following: list[int] = []
        for joint in reversed(range(len(self.joints))):
            if _rank(J[:, [joint, *following]]) > len(following):
                following.insert(0, joint)
        drivers = [index for index in range(len(self.joints)) if index not in following]
        if not drivers or rank == 0:
            raise self._refusal("leaves no joint free to move")
        return drivers, following

    def _projected(self, q: FloatArray, free: list[int]) -> FloatArray | None:
        """Return ``q`` (n,) with the joints ``free`` moved so that all loops are closed."""
        q = q.copy()
        for _ in range(STEPS):
            opening = self._opening(q)
            if np.abs(opening).max() <= CLOSED:
                return q
            step = np.linalg.lstsq(self._jacobian(q)[:, free], -opening, rcond=1e-9)[0]
            longest = float(np.abs(step).max())
            q[free] += step * min(1.0, 0.5 / longest) if longest > 0.0 else step
        return None

    def _opening(self, q: FloatArray) -> FloatArray:
        """Return by how much the loops are open at ``q`` (n,) [m; 1 for directions]."""
        frames = self._frames(dict(zip(self.joints, q.tolist(), strict=True)))
        parts = []
        for loop in self.loops:
            one, other = (
                frames[link] @ place for link, place in zip(loop.links, loop.places, strict=True)
            )
            parts.append(other[:3, 3] - one[:3, 3])
            if loop.type == "fixed":
                parts.append(so3.log(one[:3, :3].T @ other[:3, :3]))
            elif loop.type != "spherical":
                parts.append(np.cross(one[:3, :3] @ loop.axis, other[:3, :3] @ loop.axis))
        return np.concatenate(parts)

    def _jacobian(self, q: FloatArray) -> FloatArray:
        """Return the derivative (m, n) of the opening, by central differences."""
        step = 1e-6
        columns = []
        for number in range(len(q)):
            change = np.zeros(len(q))
            change[number] = step
            columns.append((self._opening(q + change) - self._opening(q - change)) / (2.0 * step))
        return np.stack(columns, axis=1)

    def _frames(self, values: Mapping[str, float]) -> dict[str, FloatArray]:
        frames: dict[str, FloatArray] = {}
        for name in self._urdf.parents_first():
            joint = self._above.get(name)
            if joint is None:
                frames[name] = np.eye(4)
                continue
            leader, factor, offset = joint.mimic or (joint.name, 1.0, 0.0)
            value = factor * values.get(leader, 0.0) + offset
            frames[name] = frames[joint.parent] @ joint.origin @ _motion(joint, value)
        return frames

    def _path(self, link: str) -> list[str]:
        names = []
        while link in self._above:
            names.append(self._above[link].name)
            link = self._above[link].parent
        return names

    def _refusal(self, problem: str) -> RobotDescriptionError:
        names = ", ".join(repr(loop.name) for loop in self.loops)
        return RobotDescriptionError(
            f"{self._file}: the closed loop of {names} with the joints {', '.join(self.joints)} "
            f"{problem}. Loops are solved whose joints are proportional to each other, such as "
            "parallelograms. Remove the <loop_joint>, or replace it by a <mimic> that is near "
            "enough."
        )


def _motion(joint: UrdfJoint, value: float) -> FloatArray:
    if joint.type == "fixed":
        return np.eye(4)
    axis = value * joint.axis / np.linalg.norm(joint.axis)
    if joint.type == "prismatic":
        return se3.from_rotation_translation(np.eye(3), axis)
    return se3.from_rotation_translation(so3.exp(axis), np.zeros(3))


def _rank(J: FloatArray) -> int:
    sizes = np.linalg.svd(J, compute_uv=False)
    return int((sizes > INDEPENDENT).sum())


def _simple(factor: float) -> float:
    """Return ``factor`` without the rounding of its computation."""
    near = round(factor)
    return float(near) if abs(factor - near) < 1e-5 else factor
