"""Checks of a URDF file before its robot is read, so that each fault is reported with its line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from katana450.errors import RobotDescriptionError

XACRO = re.compile(r"^https?://(www\.|wiki\.)?ros\.org/(wiki/)?xacro")
"""Namespaces of xacro, the macro language in which most URDF files are written."""

SUFFIX = ".xacro"
"""Suffix of the files that are always expanded."""

DECLARATION = re.compile(rb"\A(\s*)<\?xml\s+version\s*=\s*[\"'][^\"']*[\"']([^?]*\?>)")
"""An XML declaration, which must be the first bytes of a file."""

PREFIX = re.compile(rb"<([A-Za-z_][\w.-]*):")
DECLARED = re.compile(rb"\sxmlns:([\w.-]+)\s*=")
ROOT = re.compile(rb"<robot\b")
"""The prefix of an element, the declaration of one, and the outermost element."""

UNEXPANDED = re.compile(r"\$[({]")
"""Beginning of an expression of xacro."""

COUNTS: Mapping[tuple[str, str], tuple[int, ...]] = {
    ("origin", "xyz"): (3,),
    ("origin", "rpy"): (3,),
    ("axis", "xyz"): (3,),
    ("box", "size"): (3,),
    ("mesh", "scale"): (1, 3),
    ("color", "rgba"): (3, 4),
    **{("cylinder", name): (1,) for name in ("radius", "length")},
    **{("sphere", "radius"): (1,), ("mass", "value"): (1,)},
    **{("limit", name): (1,) for name in ("lower", "upper", "velocity", "effort")},
    **{("mimic", name): (1,) for name in ("multiplier", "offset")},
    **{("inertia", name): (1,) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
}
"""Allowed counts of numbers in an attribute of an element."""

BOUNDS = ("limit", "mass", "inertia")
"""Elements whose numbers may be infinite."""

COMMAS = ("box", "mesh")
"""Elements whose numbers may be separated by commas."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "link": ("name",),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "mimic": ("joint",),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("filename",),
}
"""Required attributes of an element."""

PARTS = ("link", "joint", "material")
"""Elements of a robot that are read."""

SHAPES = ("box", "cylinder", "sphere", "mesh")

JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def unexpanded(path: Path) -> bytes:
    """Raise RobotDescriptionError for the xacro file at ``path``."""
    raise RobotDescriptionError(
        f"{path} is in xacro. Install the extension that expands it, or: xacro FILE > robot.urdf"
    )


def checked(path: Path, expand: Callable[[Path], bytes] = unexpanded) -> bytes:
    """Check the URDF file at ``path`` and return its contents; a xacro file's after ``expand``.

    Raises RobotDescriptionError that names the file, the line and what to do.
    """
    if not path.is_file():
        raise RobotDescriptionError(f"There is no robot description at {path}.")
    try:
        data = _mended(path.read_bytes())
    except OSError as error:
        raise RobotDescriptionError(f"{path} cannot be opened: {error.strerror}.") from error
    checks = _Checks(str(path))
    root = checks.parsed(data)
    if path.suffix == SUFFIX or _template(root) is not None:
        data = expand(path)
        checks = _Checks(
            f"{path} (expanded)", "; if it only defines macros, name the file that includes it"
        )
        root = checks.parsed(data)
    checks.check(root)
    return data


def _mended(data: bytes) -> bytes:
    """Return ``data`` without faults that readers of URDF in ROS overlook.

    These are an XML declaration that is not at the beginning or names another version, and
    prefixes, as of Gazebo, that are not declared. No line changes its number.
    """
    # The blank lines before the declaration are moved behind it.
    data = DECLARATION.sub(rb'<?xml version="1.0"\2\1', data, count=1)
    unknown = {*PREFIX.findall(data)} - {*DECLARED.findall(data), b"xml", b"xacro"}
    declarations = b"".join(b' xmlns:%s="%s"' % (prefix, prefix) for prefix in sorted(unknown))
    return ROOT.sub(lambda match: match[0] + declarations, data, count=1)


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn each unexpected error in reading the file at ``path`` into RobotDescriptionError."""
    try:
        yield
    except RobotDescriptionError:
        raise
    except Exception as error:
        raise RobotDescriptionError(
            f"{path} cannot be read as a robot description, and the reader does not say where it "
            f"fails ({type(error).__name__}). Test the file with check_urdf, or export it again."
        ) from error


def _template(root: Element) -> Element | None:
    """Return the first element that xacro has to replace or to fill in, if there is one."""
    for element in root.iter():
        if XACRO.match(element.tag):
            return element
    for part in root:
        for element in part.iter() if part.tag in PARTS else ():
            if any(UNEXPANDED.search(value) for value in element.attrib.values()):
                return element
    return None


class _Checks:
    """Checks of one file, with the line of each element.

    ``name`` is its name for messages; ``hint`` follows the message that it describes no robot.
    """

    def __init__(self, name: str, hint: str = "") -> None:
        self._name = name
        self._hint = hint
        self._line: dict[Element, int] = {}

    def check(self, root: Element) -> None:
        """Raise RobotDescriptionError for the first fault in the file."""
        wrong = f"{self._name} is not a robot description:"
        if root.tag != "robot":
            raise RobotDescriptionError(
                f"{wrong} its outermost element is <{root.tag}>, not <robot>."
            )
        if not root.get("name"):
            raise RobotDescriptionError(f"{wrong} its <robot> has no name{self._hint}.")
        left = _template(root)
        if left is not None:
            raise self._refuse(
                left,
                "xacro leaves this unexpanded. Its elements must begin with 'xacro:', and its "
                "expressions with one '$'.",
            )
        for part in root:
            if part.tag in PARTS:
                self._check_elements(part)
        links = self._named(root, "link")
        joints = self._named(root, "joint")
        for joint in joints.values():
            self._check_joint(joint, links)
        self._refuse_loops(root, links, joints)

    def parsed(self, data: bytes) -> Element:
        """Return the root of the XML in ``data``. Raises RobotDescriptionError."""
        wrong = f"{self._name} is not a robot description:"
        builder = TreeBuilder()
        parser = expat.ParserCreate(namespace_separator="}")

        def start(tag: str, attributes: dict[str, str]) -> None:
            self._line[builder.start(tag, attributes)] = parser.CurrentLineNumber

        parser.StartElementHandler = start
        parser.EndElementHandler = builder.end
        try:
            parser.Parse(data, True)
            return builder.close()
        except (expat.ExpatError, ValueError, LookupError) as error:
            raise RobotDescriptionError(f"{wrong} its XML is broken, {error}.") from error

    def _refuse(self, element: Element, what: str) -> RobotDescriptionError:
        return RobotDescriptionError(f"{self._name}, line {self._line[element]}: {what}")

    def _check_elements(self, part: Element) -> None:
        where = f"<{part.tag}> {part.get('name', 'without a name')!r}"
        for element in part.iter():
            tag = element.tag
            inner = "" if element is part else f"<{tag}> of "
            for name in NEEDED.get(tag, ()):
                if not element.get(name):
                    raise self._refuse(element, f"the {inner}{where} has no {name!r}.")
            for name, value in element.attrib.items():
                counts = COUNTS.get((tag, name))
                if counts is not None and not _numbers(tag, value, counts):
                    wanted = " or ".join(
                        "a finite number" if n == 1 else f"{n} finite numbers" for n in counts
                    )
                    raise self._refuse(
                        element, f"{name}={value!r} of the {inner}{where} must be {wanted}."
                    )
            if tag in ("visual", "collision"):
                self._check_shape(element, f"the {inner}{where}")

    def _check_shape(self, element: Element, what: str) -> None:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) == 0:
            raise self._refuse(element, f"{what} has no shape in a <geometry>.")
        if geometry[0].tag not in SHAPES:
            raise self._refuse(
                geometry[0],
                f"the shape of {what} is <{geometry[0].tag}>; known are {', '.join(SHAPES)}.",
            )

    def _named(self, root: Element, tag: str) -> dict[str, Element]:
        elements: dict[str, Element] = {}
        for element in root.findall(tag):
            name = element.attrib["name"]
            if name in elements:
                raise self._refuse(
                    element,
                    f"there is a {tag} {name!r} in line {self._line[elements[name]]} already; "
                    "give each a different name.",
                )
            elements[name] = element
        return elements

    def _check_joint(self, joint: Element, links: Mapping[str, Element]) -> None:
        name = joint.attrib["name"]
        if joint.attrib["type"] not in JOINTS:
            raise self._refuse(
                joint,
                f"joint {name!r} is of the type {joint.attrib['type']!r}; "
                f"known are {', '.join(JOINTS)}.",
            )
        for end in ("parent", "child"):
            element = joint.find(end)
            if element is None:
                raise self._refuse(joint, f"joint {name!r} has no <{end}>.")
            link = element.attrib["link"]
            if link not in links:
                raise self._refuse(
                    element,
                    f"the {end} of joint {name!r} is {link!r}, but there is no such link. "
                    f'Add <link name="{link}"/>, or correct the name.',
                )

    def _refuse_loops(
        self, root: Element, links: Mapping[str, Element], joints: Mapping[str, Element]
    ) -> None:
        # Drake and Isaac Sim close loops by this element, and other readers of URDF pass it over.
        for loop in root.findall("loop_joint"):
            raise self._refuse(
                loop,
                f"<loop_joint> {loop.get('name', 'without a name')!r} closes a loop of joints, "
                "which cannot be solved: remove it, and let each joint that it moves follow "
                "another by a <mimic>.",
            )
        above: dict[str, list[Element]] = {name: [] for name in links}
        parent: dict[str, str] = {}
        for joint in joints.values():
            upper, lower = (joint.find(end) for end in ("parent", "child"))
            if upper is not None and lower is not None:
                above[lower.attrib["link"]].append(joint)
                parent[lower.attrib["link"]] = upper.attrib["link"]
        tree = "Closed loops of joints cannot be solved: cut it, so that every link has one parent."
        for link, held in above.items():
            if len(held) > 1:
                names = ", ".join(joint.attrib["name"] for joint in held)
                raise self._refuse(
                    held[1], f"link {link!r} is the child of {len(held)} joints ({names}). {tree}"
                )
        for link in links:
            passed = {link}
            name: str | None = parent.get(link)
            while name is not None and name not in passed:
                passed.add(name)
                name = parent.get(name)
            if name is not None:
                joint = above[name][0]
                raise self._refuse(
                    joint,
                    f"link {name!r} is its own ancestor, by joint {joint.get('name')!r}. {tree}",
                )
        if not links:
            raise RobotDescriptionError(f"{self._name} describes no link{self._hint}.")
        roots = [name for name in links if name not in parent]
        if len(roots) != 1:
            raise RobotDescriptionError(
                f"{self._name} must have one link without a parent, not {len(roots)} "
                f"({', '.join(roots)}): every other link must be the child of a joint."
            )


def _numbers(tag: str, text: str, counts: tuple[int, ...]) -> bool:
    """Return whether ``text`` has an allowed count of numbers, all valid for an element ``tag``."""
    if tag in COMMAS:
        text = text.replace(",", " ")
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return False
    usable = (lambda x: not math.isnan(x)) if tag in BOUNDS else math.isfinite
    return len(numbers) in counts and all(map(usable, numbers))
