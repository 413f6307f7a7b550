"""Steps a second of our environments, beside an environment of MuJoCo in the same process.

    python -m benchmarks.learn

Both take random actions in turn. Pusher-v5 of gymnasium moves an arm of seven joints, whose
commands are torques, and a cylinder, without limits, prediction of contacts and grasps. What counts
is the processor time of the thread, and how much time an environment simulates in it.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import gymnasium

import katana450.learn  # noqa: F401  # registers our environments

PEER, PEER_STEP = "Pusher-v5", 0.05
OURS = tuple(f"katana450/{task}-v0" for task in ("PickPlace", "Stack", "Pour", "Drawer"))
STEP = 0.1
"""Environments, and the time [s] that a step of them simulates."""

TURNS = 5
"""Number of times that each environment is stepped for a while; the best counts."""


def rate(env: gymnasium.Env[Any, Any], steps: int) -> float:
    """Return the steps a second of processor time, of ``steps`` with random actions."""
    start = time.thread_time()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return steps / (time.thread_time() - start)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learn", description=__doc__)
    parser.add_argument("--steps", type=int, default=50, help="of each turn (default: 50)")
    steps = parser.parse_args(arguments).steps
    # The environments of MuJoCo load the program that opens windows, which none of these does.
    sys.modules.setdefault("glfw", ModuleType("glfw"))
    envs = {name: gymnasium.make(name) for name in (PEER, *OURS)}
    for seed, env in enumerate(envs.values()):
        env.reset(seed=seed)
        env.action_space.seed(seed)
    rates = dict.fromkeys(envs, 0.0)
    for _ in range(TURNS):
        for name, env in envs.items():
            rates[name] = max(rates[name], rate(env, steps))
    print(f"{TURNS} turns of {steps} steps; load average {os.getloadavg()[0]:.1f}.\n")
    print("| environment | steps a second | times real time | ratio of the latter |")
    print("|---|--:|--:|--:|")
    peer = PEER_STEP * rates[PEER]
    for name, steps_a_second in rates.items():
        times = steps_a_second * (PEER_STEP if name == PEER else STEP)
        print(f"| `{name}` | {steps_a_second:.0f} | {times:.1f} | {times / peer:.4f} |")


if __name__ == "__main__":
    main()
