"""Tests of recordings; a package, so that their server can have its scope."""
