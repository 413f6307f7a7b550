"""Tests of films, decoded by ffmpeg, and of failures while they are written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from imageio_ffmpeg import get_ffmpeg_exe

from katana450.errors import InputError
from katana450.extensions.media.film import ffmpeg, write_film
from katana450.extras import MissingExtraError

Pixels = npt.NDArray[np.uint8]

COUNT, WIDTH, HEIGHT = 12, 96, 64


def frames(count: int = COUNT) -> Iterator[Pixels]:
    """Yield pictures of a bright bar that moves across."""
    for number in range(count):
        picture = np.full((HEIGHT, WIDTH, 3), 30, dtype=np.uint8)
        picture[:, 8 * number : 8 * number + 8] = (230, 60, 60)
        yield picture


def decoded(path: Path, size: tuple[int, int] = (WIDTH, HEIGHT)) -> tuple[Pixels, str]:
    """Return the pictures (n, height, width, 3) of a film, and ffmpeg's description of it."""
    done = subprocess.run(
        [get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        timeout=60,
        check=True,
    )
    pictures = np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, size[1], size[0], 3)
    return pictures, done.stderr.decode()


def test_a_film_has_its_frames_size_and_length(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    assert write_film(path, frames(), (WIDTH, HEIGHT), 25.0) == COUNT
    shown, report = decoded(path)
    assert "Duration: 00:00:00.48" in report
    assert "h264 (High) (avc1 / 0x31637661), yuv420p" in report
    assert f"{WIDTH}x{HEIGHT}" in report
    assert "25 fps" in report
    assert shown.shape == (COUNT, HEIGHT, WIDTH, 3)
    for number, picture in enumerate(shown):
        red = picture[:, :, 0].mean(axis=0)
        assert 8 * number <= int(red.argmax()) < 8 * number + 8
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]


def test_an_unfinished_film_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(b"an older one")

    def interrupted() -> Iterator[Pixels]:
        yield from frames(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(path, interrupted(), (WIDTH, HEIGHT), 25.0)
    assert path.read_bytes() == b"an older one"
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(InputError, match="at least one picture"):
        write_film(path, iter(()), (WIDTH, HEIGHT), 25.0)
    assert path.read_bytes() == b"an older one"


@pytest.mark.parametrize(
    ("size", "fps", "said"),
    [
        ((95, 64), 25.0, "even"),
        ((96, 64), 0.0, "per second"),
        ((96, 64), float("nan"), "per second"),
    ],
)
def test_invalid_film_is_refused(
    tmp_path: Path, size: tuple[int, int], fps: float, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        write_film(tmp_path / "film.mp4", frames(), size, fps)


@pytest.fixture
def on_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the path of a program ``ffmpeg`` that would be found first."""
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    ffmpeg.cache_clear()
    yield tmp_path / "ffmpeg"
    ffmpeg.cache_clear()


def script(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_ffmpeg_of_the_system_is_used_if_it_has_the_codec(
    on_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script(on_path, "echo ' V....D libx264'")
    assert ffmpeg() == str(on_path)
    ffmpeg.cache_clear()
    script(on_path, "echo ' V....D mpeg4'")
    assert ffmpeg() == get_ffmpeg_exe()
    ffmpeg.cache_clear()
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match="pip install imageio-ffmpeg"):
        ffmpeg()


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_failure_of_ffmpeg_is_reported(on_path: Path, tmp_path: Path) -> None:
    script(on_path, "echo libx264; cat > /dev/null; exit 1")
    with pytest.raises(InputError, match="cannot be written: ffmpeg has failed"):
        write_film(tmp_path / "film.mp4", frames(2), (WIDTH, HEIGHT), 25.0)
    assert [file.name for file in tmp_path.iterdir()] == ["ffmpeg"]
