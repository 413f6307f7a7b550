"""The extension ``leader``: a leader arm of servos that the arm follows."""

from __future__ import annotations

from argparse import Namespace

from katana450.extension import CliCommand, Extension
from katana450.extensions.leader.leader_options import add_leader_options


def _leader(options: Namespace) -> int:
    from katana450.extensions.leader.leader_command import lead

    return lead(options)


EXTENSION = Extension(
    "leader",
    (
        CliCommand(
            "leader", "drive the arm by a leader arm, joint to joint", add_leader_options, _leader
        ),
    ),
)
