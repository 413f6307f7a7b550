"""Build the documentation site in ``build/site``, offline, with every warning as an error.

``python -m docs.site.build``

The Markdown files are copied to the same relative paths in ``build/docs``, so that their links need
no change. The pages of the reference are written beside them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import katana450

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "build" / "docs"
# Files that are copied to the root of the site.
ASSETS = (
    ROOT / "docs" / "site" / "style.css",
    ROOT / "docs" / "site" / "iframe-worker.js",
    ROOT / "static" / "icon.svg",
)

PAGES = (
    "*.md",
    "CITATION.cff",
    "LICENSE",
    "docs/*.md",
    "docs/decisions/*.md",
    "docs/images/*",
    "examples/*",
    "examples/octave/*",
    "tests/exchange/foreign/README.md",
)

# Titles of the pages of the reference, with the public names on each.
REFERENCE = {
    "Arms": ("load", "Arm"),
    "Kinematics": ("IKSolutions", "SE3", "Solution", "Branch", "NearestPose"),
    "Plans": ("MotionPlan", "Trajectory", "Viewer"),
    "Reachability": ("ReachabilityMap",),
    "Recordings": ("open", "Recording"),
    "Scripts": ("program", "ScriptWriter"),
    "Client": ("connect", "Client"),
    "Errors": (
        "KatanaError",
        "InputError",
        "BlockedError",
        "RobotDescriptionError",
        "ConfigurationError",
    ),
}


def reference_page(title: str, names: tuple[str, ...]) -> str:
    """Return the Markdown of a page of the reference that documents public ``names``."""
    return "\n\n".join([f"# {title}", *(f"::: katana450.{name}" for name in names)]) + "\n"


def assemble(folder: Path) -> None:
    """Empty ``folder``, copy every page into it, and write the reference there."""
    shutil.rmtree(folder, ignore_errors=True)
    for pattern in PAGES:
        for file in filter(Path.is_file, ROOT.glob(pattern)):
            copy = folder / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    for asset in ASSETS:
        shutil.copyfile(asset, folder / asset.name)
    reference = folder / "reference"
    reference.mkdir()
    for title, names in REFERENCE.items():
        text = reference_page(title, names)
        (reference / f"{title.lower()}.md").write_text(text, encoding="utf-8")


def main() -> int:
    """Build the site and return the exit status of the site generator."""
    unlisted = set(katana450.__all__) - {name for names in REFERENCE.values() for name in names}
    if unlisted:
        raise SystemExit(f"Add {sorted(unlisted)} to REFERENCE in {__file__}.")
    assemble(SOURCE)
    # The search for garbage takes a fifth of the time.
    words = "import gc; gc.disable(); from mkdocs.__main__ import cli; cli()"
    command = [sys.executable, "-c", words, "build", "--strict", "--quiet"]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
