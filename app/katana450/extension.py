"""Extensions: parts of the app that the core never imports, found by name and loaded on first use.

An extension is one module with the constant ``EXTENSION``. ``BUILT_IN`` lists the extensions of
this distribution. Another distribution names its own in the entry point group
``katana450.extensions``:

    [project.entry-points."katana450.extensions"]
    weather = "weather_station.katana450:EXTENSION"

Such a module must import nothing heavy, because it is imported whenever options are read.
"""

from __future__ import annotations

import logging
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from starlette.routing import BaseRoute

    from katana450.arm.control.scene_objects import Environment, Hand
    from katana450.arm.control.session import Session
    from katana450.arm.drivers.driver import Driver
    from katana450.arm.robot.arm_reader import FindArm
    from katana450.arm.robot.initial_scene import InitialScene
    from katana450.arm.robot.robot import Robot
    from katana450.arm.runtime.arm_listener import ArmAddress, Greeting
    from katana450.arm.runtime.tick import TickRecord
    from katana450.maths.collision.world import CollisionWorld
    from katana450.maths.geometry.arrays import FloatArray
    from katana450.server.service.nodes import Nodes
    from katana450.server.service.recorder import Recorder
    from katana450.server.service.request_handler import RequestHandler
    from katana450.server.service.runner import Runner
    from katana450.server.service.server_log import ServerLog
    from katana450.server.view.gizmo import Gizmo
    from katana450.server.view.layer import ViewLayer
    from katana450.server.view.panel_folder import FolderContext, PanelFolder
    from katana450.server.view.view_updater import ViewUpdater
    from katana450.server.web.http_api import RouteContext
    from katana450.settings import Settings

RobotWorld: TypeAlias = "tuple[CollisionWorld | None, tuple[str, ...], tuple[str, ...]]"
"""The collision world of a robot, sentences on what it leaves out, and cautions for its driver."""

PACKAGE = "katana450.extensions"
"""Package of the built-in extensions, and the name of the group of entry points."""

BUILT_IN = (
    "server_commands",
    "api_description",
    "event_log",
    "programs",
    "importers",
    "reachability",
    "export",
    "experiments",
    "media",
    "phone",
    "recording",
    "kinematics",
    "real_arm",
    "hands",
    "touch",
    "leader",
    "rosbridge",
    "gallery",
    "bodies",
    "xacro",
    "loops",
    "objects",
    "undo",
    "joint_view",
    "conduit",
    "water",
    "ellipsoid",
    "general_arms",
)
"""Built-in extensions, in the order of their commands in the help text."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CliCommand:
    """A command ``katana450 NAME``.

    Attributes:
        name: Name of the command on the command line.
        help: One line for ``katana450 --help``.
        add_options: Adds its options to a parser.
        run: Runs it with the parsed options and returns the exit status. Imports what it needs.
    """

    name: str
    help: str
    add_options: Callable[[ArgumentParser], None]
    run: Callable[[Namespace], int]


class TickSender(Protocol):
    """Sends the records of ticks to a further process of the server."""

    def put(self, record: TickRecord) -> None:
        """Take ``record`` in the control thread; returns at once."""

    def attach(self, pipe: Connection, greeting: Greeting, /) -> None:
        """Send what waits, and all further records, by ``pipe`` in place of any previous one."""

    def close(self) -> None:
        """End after what waits, or after a short time."""


@dataclass(frozen=True)
class ServerFacts:
    """Description of a server for a further process of it.

    Attributes:
        settings: Settings of the server.
        urdf: File of the robot.
        tool: Link to which targets refer; None for that of the file.
        port: Port of the page.
        address: Address of the arm's process.
    """

    settings: Settings
    urdf: Path
    tool: str | None
    port: int
    address: ArmAddress


@dataclass(frozen=True)
class ExtraProcess:
    """A further process of the server. The supervisor starts it again when it ends.

    Attributes:
        name: Name of the process, of up to 15 letters.
        title: Its name for people, at the beginning of a sentence.
        run: Its function, of a module. It is called in the process with ``config`` and a
            ``SupervisorPipe``, and ends when the server does.
        config: A value that can be pickled.
        description: Line for the terminal.
    """

    name: str
    title: str
    run: Callable[[Any, Any], None]
    config: Any
    description: str


@dataclass(frozen=True)
class ServeExtension:
    """Functions that extend ``katana450 serve``. Each is called at most once, at the start.

    Attributes:
        add_options: Adds options to the parser of ``serve``.
        initial_scene: Returns the initial scene according to the options, or None. Its second
            argument returns the session of the robot, and raises RobotDescriptionError if the robot
            has no arm. Called in the process of the arm. Raises KatanaError.
        view_layer: Returns a layer of the 3D scene according to the options, or None. Called in the
            process of the view. Raises KatanaError.
        routes: Returns routes for the web server, below ``/api/v1``. Called in the process of the
            view.
        nodes: Returns the values of a robot and its environment that can be read and set by name.
            Called in the process of the view, of the first extension that has it.
        runner: Returns the class that drives the arm over time, with its requests. Called in the
            process of the view, of the first extension that has it.
        handler: Returns a class that answers further requests. Called in the process of the view.
        folder: Adds controls to a tab of the panel and returns them, or None. Called in the
            process of the view, also for a robot without an arm. Raises KatanaError.
        server_log: Returns the event log of the server on a port, or None. Called in the process
            that starts the others, of the first extension that has it.
        send_records: Sends records of the notes of a recorder by a pipe to that event log, and
            returns the function that ends this. Called in the process of the view.
        process: Returns a further process of the server, or None. Called in the process that starts
            the others.
        tick_sender: Returns the sender of the record of each tick to that process, or None. Called
            in the process of the arm.
        driver: Returns the driver of the arm according to the options, in place of the ideal
            simulation, or None. Its further arguments are the robot, the joints (n,) [rad] and the
            finger joint [rad] at which a simulation begins. Called in the process of the arm.
            Raises KatanaError.
        needs: Built-in extensions that must be installed; without them this part is left out.
    """

    add_options: Callable[[ArgumentParser], None] | None = None
    initial_scene: Callable[[Namespace, Callable[[], Session]], InitialScene | None] | None = None
    view_layer: Callable[[Namespace], ViewLayer | None] | None = None
    routes: Callable[[RouteContext], list[BaseRoute]] | None = None
    nodes: Callable[[Robot, Environment], Nodes] | None = None
    runner: Callable[[], type[Runner]] | None = None
    handler: Callable[[], type[RequestHandler]] | None = None
    folder: Callable[[FolderContext], PanelFolder | None] | None = None
    server_log: Callable[[Namespace, int], ServerLog | None] | None = None
    send_records: Callable[[Namespace, Recorder, Connection], Callable[[], None] | None] | None = (
        None
    )
    tick_sender: Callable[[Namespace], TickSender | None] | None = None
    driver: Callable[[Namespace, Robot, FloatArray, float], Driver | None] | None = None
    process: Callable[[Namespace, ServerFacts], ExtraProcess | None] | None = None
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Extension:
    """One extension of the app.

    Attributes:
        name: Its name in messages.
        commands: Commands of ``katana450``.
        serve: Its part of ``katana450 serve``, if it has one.
        prepare: Completes the options of a command before it runs, whichever extension it is of.
            Raises KatanaError.
        world: Returns the collision world of a robot, None without shapes, sentences on what it
            leaves out, and cautions for its driver. Of the first extension that has it.
        hand: Returns the hand of a robot with its collision world, completed by its sides, its
            closed end, or a model of the forces in it. Called for each session of an arm, in the
            order of the extensions.
        expand: Returns the URDF of a xacro file. Of the first extension that has it. Raises
            RobotDescriptionError.
        find_arm: Returns the arm outside the five-axis family in a URDF, with its kinematics, or
            None. Called when a robot is read for ``serve``.
        gizmo: Returns the class of the gizmo of a tool with so many freedoms, or None. Called in
            the process of the view.
        joint_view: Returns the class of the view of a robot that is driven joint by joint, which is
            called as that of `MachineView`, and then its ``add_panel``. Called in the process of
            the view.
    """

    name: str
    commands: tuple[CliCommand, ...] = ()
    serve: ServeExtension | None = None
    hand: Callable[[CollisionWorld, Hand], Hand] | None = None
    prepare: Callable[[Namespace], None] | None = None
    world: Callable[[Robot], RobotWorld] | None = None
    expand: Callable[[Path], bytes] | None = None
    find_arm: FindArm | None = None
    gizmo: Callable[[int], type[Gizmo] | None] | None = None
    joint_view: Callable[[], Callable[..., ViewUpdater]] | None = None


@cache
def extensions() -> tuple[Extension, ...]:
    """Return the installed extensions, the built-in ones first.

    Built-in extensions that are not installed are left out. Extensions that cannot be loaded are
    left out and logged.
    """
    return tuple(_loaded())


def serve_extensions() -> tuple[ServeExtension, ...]:
    """Return the parts of ``katana450 serve`` that the installed extensions provide."""
    parts = (extension.serve for extension in extensions() if extension.serve is not None)
    return tuple(part for part in parts if all(map(_is_installed, part.needs)))


def _is_installed(name: str) -> bool:
    try:
        return find_spec(f"{PACKAGE}.{name}") is not None
    except ImportError:
        return False


def missing_extension(error: ImportError) -> str | None:
    """Return the name of the extension that ``error`` could not import; None for another module."""
    prefix, _, rest = (error.name or "").partition(f"{PACKAGE}.")
    return rest.split(".")[0] if rest and not prefix else None


def _loaded() -> Iterator[Extension]:
    for name in BUILT_IN:
        try:
            extension: Extension = import_module(f"{PACKAGE}.{name}.extension").EXTENSION
        except ImportError as error:
            if (error.name or "") != PACKAGE and missing_extension(error) is None:
                _report(name, error)
        else:
            yield extension
    files = (file for each in sys.path for file in Path(each).glob("*-info/entry_points.txt"))
    if not any(map(_may_name_group, files)):
        return
    # This library takes 20 ms of each process.
    from importlib.metadata import entry_points

    for entry in entry_points(group=PACKAGE):
        try:
            found = entry.load()
        except Exception as error:
            # Third-party code: the app must start without it, whatever error it raises.
            _report(entry.name, error)
            continue
        if isinstance(found, Extension):
            yield found
        else:
            _report(entry.name, TypeError(f"{entry.value} is not an {Extension.__name__}"))


def _may_name_group(file: Path) -> bool:
    try:
        return PACKAGE.encode() in file.read_bytes()
    except OSError:
        return True


def _report(name: str, error: Exception) -> None:
    log.warning("The extension %s cannot be loaded and is left out: %s.", name, error)
