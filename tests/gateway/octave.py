"""Find GNU Octave, and install it if this is possible without a password.

``python tests/gateway/octave.py`` does this. Without Octave its tests are skipped.
"""

from __future__ import annotations

import os
import shutil
import subprocess

PACKAGES = ("octave", "octave-instrument-control")
"""Names of the Debian packages. The second provides TCP connections."""

MISSING = (
    "GNU Octave with its package instrument-control is not here; on Debian and Ubuntu: "
    f"apt-get install {' '.join(PACKAGES)}"
)


def find() -> str | None:
    """Return the path of Octave's command line; None unless it can open TCP connections."""
    path = shutil.which("octave-cli")
    if path is None:
        return None
    load = [path, "--quiet", "--eval", "pkg load instrument-control"]
    return path if subprocess.run(load, capture_output=True, check=False).returncode == 0 else None


def main() -> None:
    """Print the Octave that the tests use; install it first if the user is root."""
    if find() is None and shutil.which("apt-get") and os.geteuid() == 0:
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        install = ["apt-get", "install", "--yes", "--quiet=2", "--no-install-recommends", *PACKAGES]
        for command in (["apt-get", "update", "--quiet=2"], install):
            print("Running:", *command, flush=True)
            subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False)
    path = find()
    print(MISSING if path is None else f"Octave for the tests: {path}")


if __name__ == "__main__":
    main()
