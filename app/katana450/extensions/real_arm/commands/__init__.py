"""The commands ``katana450 emulate`` and ``katana450 arm``."""
