"""Options of ``katana450 arms``, and ``--arm NAME`` of every command."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace


def add_arms_options(parser: ArgumentParser) -> None:
    """Add the options of ``katana450 arms`` to ``parser``."""
    parser.description = (
        "List the robots that --arm NAME can name, with the licence of each description. With "
        "NAME, download that one if it is not here yet, and print its file and licence."
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="one robot, such as ur5e")


def choose_named(options: Namespace) -> None:
    """Let ``options`` name the file of the robot that ``--arm`` names. Raises KatanaError."""
    name = getattr(options, "arm", None)
    if name is None:
        return
    from katana450.extensions.gallery.arms_command import choose

    choose(options, name)
