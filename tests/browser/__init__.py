"""Tests that drive a real browser; a package, so that fixtures can last as long as this folder."""
