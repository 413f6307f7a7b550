"""The extension ``gallery``: ``--arm NAME``, and the command ``arms`` that lists the names."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from katana450.extension import CliCommand, Extension


def _add_options(parser: ArgumentParser) -> None:
    parser.description = (
        "List the robots that --arm NAME can name, with the licence of each description. With "
        "NAME, download that one if it is not here yet, and print its file and licence."
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="one robot, such as ur5e")
    parser.add_argument("--find", metavar="WORD", help="list only names and makers with this word")


def _arms(options: Namespace) -> int:
    from katana450.extensions.gallery.arms_command import arms

    return arms(options)


def _named(options: Namespace) -> None:
    name = getattr(options, "arm", None)
    # No robot has a dot or a colon in its name: this is the address of a real arm.
    if name is None or "." in name or ":" in name:
        return
    from katana450.extensions.gallery.arms_command import choose

    choose(options, name)


EXTENSION = Extension(
    "gallery",
    (CliCommand("arms", "list the robots that --arm can name", _add_options, _arms),),
    prepare=_named,
)
