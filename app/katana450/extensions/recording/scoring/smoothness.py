"""Smoothness of the motion of a point, by two measures that do not depend on its size or time."""

from __future__ import annotations

import numpy as np

from katana450.maths.geometry.arrays import FloatArray

RATE = 100.0
"""[Hz] Rate of the samples."""

WINDOW, DEGREE = 7, 3
"""Samples and degree of the polynomials that are fitted for derivatives of the velocity."""

CUTOFF, AMPLITUDE, PADDING = 10.0, 0.05, 4
"""Highest frequency [Hz], smallest amplitude [1] and padding [powers of 2] of the spectrum."""


def sparc(speed: FloatArray) -> float:
    """Return the spectral arc length of ``speed`` (N,) [m/s], sampled at RATE; 0 is perfect.

    It is the negative length of the normalised magnitude spectrum of the speed, up to CUTOFF and
    to the last frequency with at least AMPLITUDE of the largest one. A motion with one bell-shaped
    rise and fall of its speed has about -1.41; every stop in between makes it more negative.

    Source: Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, On the analysis of movement
    smoothness, Journal of NeuroEngineering and Rehabilitation 12:112 (2015).
    """
    count = 2 ** (int(np.ceil(np.log2(max(len(speed), 2)))) + PADDING)
    magnitude = np.abs(np.fft.fft(speed, count))
    magnitude = magnitude / magnitude.max()
    frequency = np.arange(count) * RATE / count
    low = frequency <= CUTOFF
    frequency, magnitude = frequency[low], magnitude[low]
    last = int(np.flatnonzero(magnitude >= AMPLITUDE)[-1])
    if last == 0:
        return 0.0
    across = np.diff(frequency[: last + 1]) / frequency[last]
    return -float(np.hypot(across, np.diff(magnitude[: last + 1])).sum())


def dimensionless_jerk(velocity: FloatArray) -> float:
    """Return the mean squared jerk of ``velocity`` (N, 3) [m/s], sampled at RATE, as a number.

    It is the integral of the squared jerk times T^5 / L^2, with the time T and the length L of the
    path. The smoothest motion from rest to rest on a line, of minimum jerk, has 720; each stop in
    between and each tremor increases it. Derivatives are those of polynomials fitted to WINDOW
    samples (Savitzky and Golay, Analytical Chemistry 36:1627, 1964), at both ends those of the
    first and the last polynomial, so that a part that begins in motion has no step there.

    Args:
        velocity: at least WINDOW samples.

    Source: Hogan and Sternad, Sensitivity of smoothness measures to movement duration, amplitude,
    and arrests, Journal of Motor Behavior 41:529 (2009).
    """
    half = WINDOW // 2
    times = np.arange(-half, half + 1) / RATE
    fit = np.linalg.pinv(times[:, None] ** np.arange(DEGREE + 1))
    inner = [np.convolve(column, 2.0 * fit[2][::-1], "valid") for column in velocity.T]
    second = 2.0 * fit[2] + 6.0 * times[:, None] * fit[3]
    begin, end = second[:half] @ velocity[:WINDOW], second[-half:] @ velocity[-WINDOW:]
    jerk = np.concatenate((begin, np.stack(inner, axis=1), end))
    duration = (len(velocity) - 1) / RATE
    length = float(np.linalg.norm(velocity, axis=1).sum()) / RATE
    return float((jerk * jerk).sum()) / RATE * duration**5 / length**2
