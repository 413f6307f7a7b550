"""Other distributions in the environments of subprocesses."""

from __future__ import annotations

from pathlib import Path


def distribution(folder: Path, entry: str, module: str) -> Path:
    """Write another distribution into ``folder``, with ``module`` and its entry point."""
    information = folder / "weather-1.0.dist-info"
    information.mkdir(parents=True)
    lines = ("Metadata-Version: 2.1", "Name: weather", "Version: 1.0", "")
    (information / "METADATA").write_text("\n".join(lines), encoding="utf-8")
    points = f"[katana450.extensions]\nweather = {entry}\n"
    (information / "entry_points.txt").write_text(points, encoding="utf-8")
    (folder / "station.py").write_text(module, encoding="utf-8")
    return folder
