"""The velocity ellipsoid of the tool."""
