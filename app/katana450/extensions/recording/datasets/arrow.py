"""The library of Parquet files, which is an extra of the package."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from katana450.errors import ConfigurationError


def arrow() -> tuple[Any, Any]:
    """Return the modules ``pyarrow`` and ``pyarrow.parquet``.

    Raises ConfigurationError if pyarrow is not installed.
    """
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise ConfigurationError(
            "Parquet and LeRobot need pyarrow, which is not installed: "
            "`pip install 'katana450[datasets]'`. CSV, MCAP, ROS 2 bags, HTML and MP4 need nothing "
            "else."
        ) from error
