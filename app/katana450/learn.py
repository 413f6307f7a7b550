"""Environments of gymnasium. Importing this module registers them (docs/learn.md)."""

from __future__ import annotations

from katana450 import extras

MAX_STEPS = {"PickPlace": 300, "Stack": 300, "Pour": 400, "Drawer": 300}
"""Maximum number of steps of an episode of each task."""

gymnasium = extras.library("gymnasium", "learn", "Environments")
for task, max_steps in MAX_STEPS.items():
    gymnasium.register(
        f"katana450/{task}-v0",
        "katana450.extensions.learn.environment:TaskEnvironment",
        max_episode_steps=max_steps,
        kwargs={"task": task},
    )
