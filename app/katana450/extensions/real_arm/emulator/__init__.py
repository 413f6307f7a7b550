"""An emulator of the firmware of the Katana, with simulated axes, behind the same wire."""
