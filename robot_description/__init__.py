"""The robot as data: one URDF holds every number of the arm, and its meshes lie beside it."""

from __future__ import annotations

from pathlib import Path

URDF_PATH: Path = Path(__file__).resolve().parent / "katana450.urdf"

PROPS_PATH: Path = URDF_PATH.parent / "props" / "props.json"
