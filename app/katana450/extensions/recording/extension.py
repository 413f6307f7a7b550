"""The extension ``recording``: files of what an arm did, and the command about them."""

from __future__ import annotations

from argparse import Namespace

from katana450.extension import CliCommand, Extension
from katana450.extensions.recording.record_options import add_record_options


def _record(options: Namespace) -> int:
    from katana450.extensions.recording.files.record_command import record

    return record(options)


EXTENSION = Extension(
    "recording",
    (CliCommand("record", "verify, repair and cut recordings", add_record_options, _record),),
)
