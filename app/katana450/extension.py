"""Extensions: parts of the app that the core never imports, found by name and loaded on first use.

An extension is a value of ``Extension``. ``extensions/built_in.py`` lists those of this
distribution. Another distribution names its own in the entry point group ``katana450.extensions``:

    [project.entry-points."katana450.extensions"]
    weather = "weather_station.katana450:EXTENSION"

Such a module must import nothing heavy, because it is imported whenever options are read.
"""

from __future__ import annotations

import logging
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from katana450.arm.runtime.pipes.private_listener import Greeting, PrivateAddress
    from katana450.arm.runtime.tick import TickRecord
    from katana450.settings import Settings

Target: TypeAlias = Callable[..., Any] | str
"""A function or class, or where it is: ``"module:name"``, which is imported on first use."""

GROUP = "katana450.extensions"
"""Name of the group of entry points."""

BUILT_IN = f"{GROUP}.built_in:EXTENSIONS"
"""Where the extensions of this distribution are listed, in the order of their commands."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CliCommand:
    """A command ``katana450 NAME``.

    Attributes:
        name: Name of the command on the command line.
        help: One line for ``katana450 --help``.
        add_options: Adds its options to a parser.
        run: Runs it with the parsed options and returns the exit status.
    """

    name: str
    help: str
    add_options: Target
    run: Target


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
    """Description of a server for each process of it, used each time the process is started.

    Attributes:
        settings: Settings of the server.
        urdf: File of the robot.
        tool: Link to which targets refer; None for that of the file.
        port: Port of the page.
        address: Address of the arm's process.
        options: Options of the command, with those of the extensions.
        folder: Private folder for the meshes of scene objects.
    """

    settings: Settings
    urdf: Path
    tool: str | None
    port: int
    address: PrivateAddress
    options: Namespace
    folder: Path


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
class Extension:
    """One extension of the app: where its parts are. Each part is imported when it is used.

    The process of the arm calls ``initial_scene``, ``driver`` and ``tick_sender``, and that which
    starts the others calls ``process``. The process of the view calls the rest.

    Attributes:
        name: Its name in messages.
        commands: Commands of ``katana450``.
        prepare: Completes the options of a command before it runs, whichever extension it is of.
            Raises KatanaError.
        serve_options: Adds options to the parser of ``serve``.
        initial_scene: Returns the InitialScene according to the options, or None. Its second
            argument returns the session of the robot, and raises RobotDescriptionError if the robot
            has no arm. Raises KatanaError.
        view_layer: Returns a layer of the 3D scene according to the options, or None. Raises
            KatanaError.
        routes: Returns routes for the web server, below ``/api/v1``, given a RouteContext.
        handler: Class that answers further requests.
        step: A script step, a class derived from ``Step``. Other steps of its module are added too.
        folder: Adds a folder to the panel or nodes to the scene, given a FolderContext, or returns
            None. Called also for a robot without an arm. Raises KatanaError.
        process: Returns a further process of the server, given the options and a ServerFacts, or
            None.
        tick_sender: Returns the TickSender to that process according to the options, or None.
        driver: Returns the driver of the arm according to the options, in place of the ideal
            simulation, or None. Its further arguments are the robot, the joints (n,) [rad] and the
            finger joint [rad] at which a simulation begins. Raises KatanaError.
    """

    name: str
    commands: tuple[CliCommand, ...] = ()
    prepare: Target | None = None
    serve_options: Target | None = None
    initial_scene: Target | None = None
    view_layer: Target | None = None
    routes: Target | None = None
    handler: Target | None = None
    step: Target | None = None
    folder: Target | None = None
    process: Target | None = None
    tick_sender: Target | None = None
    driver: Target | None = None


def load(target: Target) -> Any:
    """Return the function or class that ``target`` is, or names."""
    if not isinstance(target, str):
        return target
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)


def provided(part: str) -> Iterator[Any]:
    """Yield what the extensions provide for ``part``, a field of Extension, loaded one by one.

    A part of another distribution that cannot be loaded is left out and logged.
    """
    for extension in extensions():
        target = getattr(extension, part)
        if target is None:
            continue
        try:
            loaded = load(target)
        except Exception as error:
            if extension in load(BUILT_IN):
                raise
            # Third-party code, as in `_added`.
            _report(extension.name, error)
        else:
            yield loaded


def results(part: str, *arguments: Any) -> Iterator[Any]:
    """Yield what the functions of ``part`` return for ``arguments``, one by one, without None."""
    for make in provided(part):
        if (result := make(*arguments)) is not None:
            yield result


@cache
def extensions() -> tuple[Extension, ...]:
    """Return all extensions, the built-in ones first.

    Extensions of other distributions that cannot be loaded are left out and logged.
    """
    return (*load(BUILT_IN), *_added())


def _added() -> Iterator[Extension]:
    """Yield the extensions of other distributions."""
    files = (file for folder in sys.path for file in Path(folder).glob("*-info/entry_points.txt"))
    if not any(map(_may_name_group, files)):
        return
    # This library takes 20 ms of each process.
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP):
        try:
            extension = entry.load()
        except Exception as error:
            # Third-party code: the app must start without it, whatever error it raises.
            _report(entry.name, error)
            continue
        if isinstance(extension, Extension):
            yield extension
        else:
            _report(entry.name, TypeError(f"{entry.value} is not an {Extension.__name__}"))


def _may_name_group(file: Path) -> bool:
    try:
        return GROUP.encode() in file.read_bytes()
    except OSError:
        return True


def _report(name: str, error: Exception) -> None:
    log.warning("The extension %s cannot be loaded and is left out: %s.", name, error)
