"""Tests of what servers answer; a package, so that their server can have its scope."""
