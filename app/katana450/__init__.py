"""Browser teleoperation and interactive simulation of the Katana450 arm."""
