"""Tests that drive a real browser; a package, so that fixtures can have its scope."""
