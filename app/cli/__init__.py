"""The command ``katana450``."""

from app.cli.main import main

__all__ = ["main"]
