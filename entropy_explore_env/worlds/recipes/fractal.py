"""Fractal noise by spectral synthesis (Saupe 1988, "Algorithms for random fractals")."""

from __future__ import annotations

import numpy as np


def fractal_noise(shape: tuple[int, ...], hurst: float, rng: np.random.Generator) -> np.ndarray:
    """Return a self-affine random field: white noise whose spectrum is made to fall with the frequency.

    Amplitudes fall as 1/f^(H + n/2) in n dimensions, which gives a surface the fractal dimension n + 1 − H.
    The field is cut from a periodic one twice as large, so that opposite edges do not match.

    Args:
        shape: Of the field, n axes.
        hurst: H in (0, 1): the higher, the smoother.
        rng: Draws the white noise.

    Returns:
        (shape) float64, mean 0 and standard deviation 1; zeros where the field has one value.
    """
    padded = tuple(2 * n if n > 1 else 1 for n in shape)
    spectrum = np.fft.rfftn(rng.standard_normal(padded))
    squares = np.zeros(spectrum.shape)
    for axis, n in enumerate(padded):
        frequencies = np.fft.rfftfreq(n) if axis == len(padded) - 1 else np.fft.fftfreq(n)
        squares += (frequencies**2).reshape([-1 if other == axis else 1 for other in range(len(padded))])
    squares.flat[0] = np.inf  # no mean
    dimensions = sum(n > 1 for n in shape)
    field = np.fft.irfftn(
        spectrum * squares ** (-0.5 * (hurst + 0.5 * dimensions)), padded, range(len(padded))
    )
    field = field[tuple(slice(n) for n in shape)]
    field = field - field.mean()
    spread = field.std()
    return field / spread if spread > 0.0 else field
