"""The licence and the maintainer that an exported ROS package states."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from katana450.extensions.export.ros2.manifest import Maintainer
from katana450.extensions.export.urdf_package import (
    UNSTATED_LICENSE,
    UNSTATED_MAINTAINER,
    package_files,
)
from katana450.resources import URDF_PATH

OWN_LICENSE = "MIT"
"""Licence of the Katana450's description, the same as of this project."""


def licensed_package(
    path: Path, license_name: str | None, maintainer: tuple[str, str] | None
) -> Mapping[str, bytes]:
    """Return name and content of the package of the URDF file at ``path``.

    Print what its `package.xml` leaves for the user to state: the licence or the ``maintainer``
    (name, email), if they are None.
    """
    own = path.resolve() == URDF_PATH.resolve()
    license_name = license_name or (OWN_LICENSE if own else UNSTATED_LICENSE)
    person = Maintainer(*maintainer) if maintainer else UNSTATED_MAINTAINER
    unstated = [
        word
        for word, missing in (
            ("--license", license_name == UNSTATED_LICENSE),
            ("--maintainer", person == UNSTATED_MAINTAINER),
        )
        if missing
    ]
    if unstated:
        print(
            f"katana450: package.xml has a TODO for {' and '.join(unstated)}. State "
            f"{'it' if len(unstated) == 1 else 'them'} before you publish the package.",
            file=sys.stderr,
        )
    return package_files(path, license_name, person)
