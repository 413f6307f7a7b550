"""The real Katana450: its protocol, its driver, and what is needed to try both without an arm."""
