"""The front door: one origin, our page, and a firewall in front of viser."""
