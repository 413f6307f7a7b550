"""Environments of gymnasium obey its rules, repeat bit by bit, and measure success."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import katana450.learn  # noqa: F401 (it registers them)
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.learn.environment import (
    FILLED,
    TASKS,
    WANTED,
    Numbers,
    TaskEnvironment,
)
from tests.general_arms.test_published_hands import KINDS
from tests.learn.policy import CLOSED, GRASP, OPEN, Policy, pour, pull, put
from tests.robot.public_arms import J, urdf

Env = gymnasium.Env[Numbers, Numbers]

SEEDS = range(20)


def made(task: str, **options: Any) -> Env:
    env: Env = gymnasium.make(f"katana450/{task}-v0", **options)
    return env


def run(env: Env, seed: int, steps: int) -> list[bytes]:
    """Return the bits of what ``env`` answers to random actions of ``seed``, and of its state."""
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    answers = [observation.tobytes()]
    for _ in range(steps):
        observation, reward, *ends = env.step(env.action_space.sample())
        answers.append(observation.tobytes() + repr((reward, ends)).encode())
    return answers


@pytest.mark.parametrize("task", TASKS)
def test_environment_obeys_the_rules_of_gymnasium(task: str) -> None:
    check_env(made(task).unwrapped)


@pytest.mark.parametrize("task", ["PickPlace", "Stack"])
def test_arm_of_another_file_has_an_environment(task: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(KINDS["SO-101"].urdf, encoding="utf-8")
    check_env(made(task, urdf=path).unwrapped)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_equal_seeds_and_actions_give_equal_bits(seed: int) -> None:
    task = list(TASKS)[seed % len(TASKS)]
    env = made(task)
    answers = run(env, seed, 10)
    assert run(made(task), seed, 10) == answers
    # Nothing is left of the episode before.
    assert run(env, seed, 10) == answers
    assert run(env, seed + 1, 10) != answers


def test_environments_in_a_vector_are_independent() -> None:
    envs = gymnasium.make_vec("katana450/PickPlace-v0", 2, "sync")
    # Its environments get the seeds 3 and 4.
    first, _ = envs.reset(seed=3)
    actions = np.zeros((2, 6), dtype=np.float32)
    actions[1, 2] = -1.0
    last, *_ = envs.step(actions)
    single = made("PickPlace")
    for seed, before, action, after in zip((3, 4), first, actions, last, strict=True):
        assert single.reset(seed=seed)[0].tobytes() == before.tobytes()
        assert single.step(action)[0].tobytes() == after.tobytes()
    envs.close()


@pytest.mark.parametrize(
    ("task", "seed", "perform"),
    [
        ("PickPlace", 238, lambda policy: put(policy, "cube")),
        pytest.param("Stack", 0, lambda policy: put(policy, "upper"), marks=pytest.mark.long),
        pytest.param("Pour", 0, pour, marks=pytest.mark.long),
        pytest.param("Drawer", 1, pull, marks=pytest.mark.long),
    ],
)
def test_scripted_policy_has_success(
    task: str, seed: int, perform: Callable[[Policy], None]
) -> None:
    policy = Policy(made(task), seed=seed)
    assert not policy.info["is_success"]
    perform(policy)
    assert policy.over
    assert policy.info["is_success"]
    # The reward of the last step is that of success, and no earlier one is as great.
    assert policy.rewards[-1] > 0.98
    assert max(policy.rewards[:-1]) < 0.0
    if task == "PickPlace":
        assert np.linalg.norm(policy.place("cube") - policy.place("goal")) <= 0.01
    if task == "Stack":
        upper, lower = policy.place("upper"), policy.place("lower")
        assert np.abs(upper - lower - (0.0, 0.0, 0.04)).max() <= 0.01
    if task == "Pour":
        cup, basin = policy.place("water")[:2]
        assert basin >= WANTED
        assert cup + basin <= FILLED


def test_no_success_while_the_cube_is_held_at_its_goal() -> None:
    policy = Policy(made("PickPlace"), seed=0)
    up = np.array((0.0, 0.0, 1.0))
    middle = policy.place("cube") + GRASP * up
    for height, fingers, steps in ((0.1, OPEN, 18), (0.0, OPEN, 17), (0.0, CLOSED, 8)):
        for _ in range(steps):
            policy.move("tool", middle + height * up, fingers)
    env = policy.env
    env._goal = policy.place("cube")
    policy.move("tool", middle, CLOSED)
    assert env._state.held is not None
    assert np.linalg.norm(policy.place("cube") - env._goal) < 0.01
    assert not policy.info["is_success"]
    # Let go, it is a success once it rests.
    for _ in range(16):
        if not policy.over:
            policy.move("tool", policy.place("tool"), OPEN)
    assert policy.info["is_success"]


def test_limits_of_the_app_hold_and_are_named() -> None:
    env = made("PickPlace")
    env.reset(seed=0)
    action = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 1.0], dtype=np.float32)
    assert isinstance(env.unwrapped, TaskEnvironment)
    tool, heights, reasons = env.unwrapped.parts["tool"], [], set[str]()
    for _ in range(15):
        observation, *_, info = env.step(action)
        heights.append(float(observation[tool][2]))
        reasons.add(info["limited_by"])
        assert env.observation_space.contains(observation)
    # The tool, driven down for 0.37 m from a height of 0.28 m, stays above the table.
    assert min(heights) > 0.0
    assert any("contact" in reason for reason in reasons)


def test_bad_options_are_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no task 'Sort'\. Choose from PickPlace, Stack, Pour"):
        TaskEnvironment("Sort")
    with pytest.raises(InputError, match="Pour is for the Katana450 alone"):
        made("Pour", urdf="arm.urdf")
    with pytest.raises(RobotDescriptionError, match=r"missing\.urdf"):
        made("Stack", urdf=tmp_path / "missing.urdf")
    path = tmp_path / "bare.urdf"
    axes = [(0.0, 0.0, 1.0), *[(0.0, 1.0, 0.0)] * 3, (1.0, 0.0, 0.0)]
    joints = [
        J(f"j{n}", "revolute", f"l{n}", f"l{n + 1}", (0.0, 0.0, 0.2), (0.0, 0.0, 0.0), axis)
        for n, axis in enumerate(axes)
    ]
    path.write_text(urdf("bare", joints), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=r"bare\.urdf: .* no hand"):
        made("PickPlace", urdf=path)
    env = made("PickPlace").unwrapped
    with pytest.raises(InputError, match=r"no options\. Leave out goal"):
        env.reset(options={"goal": (0.3, 0.0)})
    env.reset(seed=0)
    with pytest.raises(InputError, match="An action is 6 finite numbers"):
        env.step(np.zeros(5, dtype=np.float32))
    with pytest.raises(InputError, match="An action is 6 finite numbers"):
        env.step(np.full(6, np.nan, dtype=np.float32))
