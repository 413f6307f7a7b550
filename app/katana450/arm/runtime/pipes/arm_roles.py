"""Roles of the connections to the arm's process."""

from __future__ import annotations

FRONT = "front"
"""Role of the front end. There is one at a time: a new one replaces the one before."""

STOP = "stop"
"""Role of the process of STOP, of which there is one at a time too."""

RECORD = "record"
"""Role of the process that records, of which there is one at a time too."""
