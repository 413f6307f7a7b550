"""The command ``katana450``."""

from katana450.cli.main import main

__all__ = ["main"]
