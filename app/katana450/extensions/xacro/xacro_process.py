"""The subprocess that expands one xacro file.

``expanded`` starts it as ``python -m katana450.extensions.xacro.xacro_process FILE NAME:=VALUE``.
Before it reads the file, it limits its memory and time and the files that it can open. It writes
JSON to standard output: {"urdf": text}, or the fault as {"what", "file", "line"}. The file is null
if it is FILE, and the line if it is unknown.
"""

from __future__ import annotations

import ast
import errno
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr, suppress
from pathlib import Path
from typing import Any
from xml.parsers.expat import ErrorString, ExpatError

import xacro
from xacro import substitution_args

from katana450.extensions.xacro.xacro_file import MAX_BYTES, MAX_MEMORY_BYTES, READABLE, SECONDS
from katana450.platform_support import limit_resources

NAME = re.compile(r"[A-Za-z][\w-]*")

MANIFEST = "package.xml"

MANIFEST_NAME = re.compile(rb"<name>\s*([\w-]+)\s*</name>")
"""The name of a package in its package.xml."""

WORKSPACES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "CMAKE_PREFIX_PATH")
"""Environment variables that list folders of packages."""

HOME = Path(os.path.expanduser("~")).resolve()
"""The home folder of this user; `Path.home` fails where there is none."""


def package_folder(name: str, folder: Path) -> Path | None:
    """Return the folder of the package ``name``; None if it is not found.

    It is ``folder`` or one above it, if its package.xml has that name; a folder ``name`` beside one
    of these; or where ROS_PACKAGE_PATH and AMENT_PREFIX_PATH lead. A folder beside the home folder
    or one above it, in the home folder, or behind a link needs a package.xml.
    """
    if not NAME.fullmatch(name):
        return None
    for above in (folder, *folder.parents):
        if _manifest_name(above) == name:
            return above
        if _is_package(above / name):
            return above / name
    return next((place for place in _installed(name) if place.is_dir()), None)


def package_of(file: Path) -> Path:
    """Return the innermost folder around ``file`` with a package.xml, or else its own folder."""
    return next((above for above in file.parents if _has_manifest(above)), file.parent)


def workspaces() -> list[Path]:
    """Return the folders with packages that the environment names."""
    return [path for variable in WORKSPACES for path in _paths(variable)]


def real_folders(folder: Path) -> set[Path]:
    """Return the folder behind the link ``folder``, and the one behind its package.xml.

    colcon can install each file of a package as a link to its source.
    """
    source = (folder / MANIFEST).resolve()
    linked = source.name == MANIFEST and source.is_file()
    return {folder.resolve(), *([source.parent] if linked else [])}


def _has_manifest(folder: Path) -> bool:
    # Path.is_file raises an error where a folder is private.
    return os.path.isfile(folder / MANIFEST)


def _is_package(folder: Path) -> bool:
    above = folder.parent.resolve()
    plain = folder.resolve().parent == above and above not in (HOME, *HOME.parents)
    return folder.is_dir() and (plain or _has_manifest(folder))


def _manifest_name(folder: Path) -> str | None:
    with suppress(OSError):
        match = MANIFEST_NAME.search((folder / MANIFEST).read_bytes())
        return match and match[1].decode()
    return None


def _installed(name: str) -> Iterator[Path]:
    for part in _paths("ROS_PACKAGE_PATH"):
        yield part if part.name == name or _manifest_name(part) == name else part / name
    for part in _paths("AMENT_PREFIX_PATH"):
        yield part / "share" / name


def _paths(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]


PLAIN = (str, int, float, complex, list, tuple, dict, set, frozenset)
"""Types of values whose public methods an expression can call."""

REFUSED = frozenset({"format", "format_map"})
"""Methods whose text argument can read attributes."""

ATTRIBUTE = "attribute of"
"""Name of the function that reads an attribute; no expression can contain it."""


class UnsafeExpressionError(Exception):
    """An expression that is not evaluated, with the reason."""


def evaluated(text: str, symbols: dict[str, Any], names: Mapping[str, Any] | None = None) -> object:
    """Return the value of the expression ``text``.

    Args:
        text: a Python expression.
        symbols: what its names mean; gets two more entries.
        names: what its names mean first.

    Raises:
        UnsafeExpressionError: it uses a private name, or an attribute of anything but plain values.
        Exception: whatever the expression raises.
    """
    tree = _Guarded().visit(ast.parse(text.strip(), "<expression>", "eval"))
    code = compile(ast.fix_missing_locations(tree), "<expression>", "eval")
    symbols.update({"__builtins__": {}, ATTRIBUTE: _attribute})
    return eval(code, symbols, names)


class _Guarded(ast.NodeTransformer):
    """Replaces each attribute by a call of ``_attribute``, and refuses private names."""

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id.startswith("__"):
            raise UnsafeExpressionError(f"the name {node.id!r} is not allowed")
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        function = ast.Name(ATTRIBUTE, ast.Load())
        return ast.Call(function, [self.visit(node.value), ast.Constant(node.attr)], [])


def _attribute(value: object, name: str) -> object:
    """Return the entry ``name`` of a mapping, or a public attribute of a plain value."""
    # Namespaces of xacro and mappings of YAML are mappings that are read with a dot.
    if isinstance(value, dict) and name in value and not name.startswith("_"):
        return value[name]
    kind = next((kind for kind in PLAIN if isinstance(value, kind)), None)
    if kind is None or name.startswith("_") or name in REFUSED or not hasattr(kind, name):
        raise UnsafeExpressionError(f"the attribute {name!r} is not allowed, or does not exist")
    return getattr(value, name)


HIDDEN = ("type", "vars")
"""Functions of the namespace ``python`` that lead from a value to other code."""

LEGACY = ("include", "macro", "property")
"""Elements of xacro that older files have at their top without its prefix; a URDF has none there.
"""

FORBIDDEN = ("os.exec", "os.posix_spawn", "os.system", "socket.connect", "subprocess.Popen")
"""Audit events of Python that no expansion causes."""

MAX_WHAT = 300
"""Maximum number of characters of a fault; an error of Python can quote a whole value."""

ENDLESS = "its macros, properties or includes contain themselves"


class _FaultError(Exception):
    """A fault that this module found, as a clause."""


class FileGuard:
    """An audit hook of Python that lets this process open only files of packages and of Python.

    ``path`` is the xacro file. ``folders`` are the folders of its package, of those that the
    environment names, and of Python.
    """

    def __init__(self, path: Path) -> None:
        self.folders: set[Path] = set()
        # Python loads some of its modules when they are first used.
        python = map(Path, (sys.prefix, sys.base_prefix, *sys.path))
        own = (package_of(path), package_of(path.resolve()))
        for folder in (*own, *workspaces(), *python):
            self.folders |= real_folders(folder)

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Refuse the event by an exception, or do nothing."""
        if event in FORBIDDEN:
            raise _FaultError(f"it must not call {event}")
        if event == "open" and not isinstance(arguments[0], int):
            name = os.fsdecode(arguments[0])
            real = Path(os.path.realpath(name))
            if not any(real.is_relative_to(folder) for folder in self.folders):
                raise PermissionError(errno.EACCES, "it is outside the packages of the robot", name)


class Expansion:
    """The expansion of the file at ``path``; each package it finds is added to ``folders``.

    ``arguments``: values of arguments of the file.

    It replaces the parts of xacro that evaluate expressions and that ask ROS or the environment.
    """

    def __init__(self, path: Path, folders: set[Path], arguments: Mapping[str, str]) -> None:
        self._path = path
        self._arguments = dict(arguments)
        self._folders = folders
        self._at_fault = ""
        """Text in the line at fault."""
        for name in HIDDEN:
            dict.pop(xacro._global_symbols["python"], name)
        self._parse = xacro.parse
        xacro.parse = self._parsed
        xacro.safe_eval = self._value
        # Without this entry `eval` in that module is Python's.
        vars(substitution_args)["eval"] = self._value
        substitution_args._eval_dict.update(substitution_args._eval_dict["__builtins__"])
        substitution_args._eval_dict.update(env=self._eval_env, find=self._eval_find)
        for function in (self._eval_arg, self._eval_env, self._eval_find):
            setattr(substitution_args, function.__name__, function)

    def run(self) -> dict[str, object]:
        """Return the answer."""
        try:
            document = xacro.process_file(str(self._path), mappings=self._arguments, verbosity=0)
            urdf = document.documentElement.toxml()
            # Text with one half of a surrogate pair cannot be encoded in UTF-8.
            urdf.encode()
        except Exception as error:
            return self._fault(error)
        if len(urdf) > MAX_BYTES:
            return self._fault(_FaultError(f"the result has more than {MAX_BYTES:,} characters"))
        return {"urdf": urdf}

    def _parsed(self, source: object, name: str | None = None) -> Any:
        """Return the document of a file, with the prefix of xacro where older files omit it."""
        document = self._parse(source, name)
        for node in document.documentElement.childNodes:
            if node.nodeName in LEGACY:
                node.tagName = node.nodeName = f"xacro:{node.nodeName}"
        return document

    def _value(
        self, text: str, symbols: dict[str, Any], names: Mapping[str, Any] | None = None
    ) -> object:
        try:
            value = evaluated(text, symbols, names)
            if isinstance(value, str):
                value.encode()
            return value
        except Exception:
            # The innermost expression is at fault.
            self._at_fault = self._at_fault or text
            raise

    def _eval_arg(self, name: str, args: Mapping[str, str]) -> str:
        if name in args:
            return args[name]
        self._at_fault = f"arg {name}"
        raise _FaultError(
            f"the argument {name!r} has no value and no default. Give it one with "
            f"--xacro-arg {name}:=VALUE"
        )

    def _eval_env(self, name: str) -> str:
        if name in os.environ:
            return os.environ[name]
        self._at_fault = f"env {name}"
        raise _FaultError(f"there is no environment variable {name!r} of ROS")

    def _eval_find(self, package: str) -> str:
        folder = package_folder(package, self._path.parent)
        if folder is not None:
            self._folders |= real_folders(folder)
            return str(folder)
        self._at_fault = f"find {package}"
        raise _FaultError(
            f"there is no package {package!r}. Put its folder beside the file or beside a folder "
            "above it, or add the folder that contains it to ROS_PACKAGE_PATH"
        )

    def _fault(self, error: Exception) -> dict[str, object]:
        chain = [error]
        while (cause := getattr(chain[-1], "exc", None)) is not None:
            chain.append(cause)
        cause, line = chain[-1], None
        if isinstance(cause, ExpatError):
            what, line = f"its XML is broken ({ErrorString(cause.code)})", cause.lineno
        elif any(isinstance(error, RecursionError) for error in chain):
            what = ENDLESS
        elif isinstance(cause, _FaultError):
            what = str(cause)
        elif isinstance(cause, OSError):
            self._at_fault = self._at_fault or Path(str(cause.filename)).name
            what = f"{cause.filename} cannot be opened ({cause.strerror})"
        elif self._at_fault:
            what = f"{_reason(cause)}, in the expression {self._at_fault!r}"
        else:
            what = _reason(cause).rstrip(".")
            self._at_fault = what.rpartition("xacro:")[2]
        stack = [*xacro.filestack, *(macro.history[-1][-1] for macro in xacro.macrostack)]
        # An included file that could not be opened can be left on the stack.
        file = next((Path(entry) for entry in reversed(stack) if os.path.isfile(entry)), self._path)
        if line is None and self._at_fault:
            for entry in (*reversed(stack), *xacro.all_includes):
                line = _line(Path(entry), self._at_fault)
                if line is not None:
                    file = Path(entry)
                    break
        other = None if file == self._path else _shown(str(file))
        return {"what": _shown(what), "file": other, "line": line}


def _shown(text: str) -> str:
    """Return the first MAX_WHAT characters of ``text``, each other than printable as "?"."""
    return "".join(character if character.isprintable() else "?" for character in text[:MAX_WHAT])


def _reason(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "it needs too much memory"
    if isinstance(error, NameError):
        return f"{error.name!r} is not defined" if error.name else str(error)
    if isinstance(error, KeyError):
        return f"there is no {error}"
    if isinstance(error, UnicodeEncodeError):
        return "a surrogate is not a character"
    if isinstance(error, SyntaxError):
        return "the syntax is wrong"
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def _line(file: Path, text: str) -> int | None:
    """Return the number of the first line of ``file`` that contains ``text``, from 1."""
    with suppress(OSError):
        lines = file.read_text(errors="replace").splitlines() if file.is_file() else []
        return next((number for number, line in enumerate(lines, start=1) if text in line), None)
    return None


def main(path: Path, arguments: Mapping[str, str]) -> None:
    """Expand the file at ``path`` with ``arguments``.

    The process fails only at the limits of memory and time.
    """
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))
    guard = FileGuard(path)
    for name in [variable for variable in os.environ if not variable.startswith(READABLE)]:
        del os.environ[name]
    # The messages of the file are dropped; standard error tells why this program did not start.
    with Path(os.devnull).open("w") as null, redirect_stderr(null):
        sys.addaudithook(guard)
        try:
            answer = json.dumps(Expansion(path, guard.folders, arguments).run())
        except MemoryError as error:
            answer = json.dumps({"what": _reason(error), "file": None, "line": None})
    print(answer)


if __name__ == "__main__":
    main(Path(sys.argv[1]), dict(argument.split(":=", 1) for argument in sys.argv[2:]))
