"""Kernels of what is seen from the nose: the distance and direction of a landmark, known or any of a map.

With δ the bearing's error and q the scaled error of the distance, a landmark's log likelihood is, less a constant,
``κ (cos δ - 1) - q²``: von Mises by the direction, normal by the distance. The cosine is the product of two unit
vectors, the way to the landmark and the direction measured, so no arc tangent is needed.
"""

from __future__ import annotations

import math

from numpy import float32

from filters.kernels.compile import Float32Array, kernel
from filters.kernels.elementary import exp_bounded, log, log_mixture, sincos


@kernel(
    "void(float32[:, ::1], float32[::1], int64, int64, float32, float32, float32, float32, float32, float32,"
    "float32, float32)"
)
def sighted(
    columns: Float32Array,
    log_weights: Float32Array,
    first: int,
    last: int,
    landmark_north: float,
    landmark_east: float,
    distance: float,
    distance_gain: float,
    bearing: float,
    concentration: float,
    log_inlier: float,
    log_outlier: float,
) -> None:
    """Add the log of the mixture for one landmark; a distance that was not measured has gain 0."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    heading = columns[2, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        n = float32(landmark_north - north[i])
        e = float32(landmark_east - east[i])
        s, c = sincos(float32(heading[i] + bearing))
        away = float32(math.sqrt(float32(n * n + e * e + float32(1e-12))))  # never zero
        q = float32(distance_gain * float32(distance - away))
        turned = float32(float32(1.0) - float32(float32(n * c + e * s) / away))
        log_weight[i] += log_mixture(float32(q * q + concentration * turned), log_inlier, log_outlier)


@kernel("void(float32[:, ::1], int64, int64, float32, float32[:, ::1])")
def face(columns: Float32Array, first: int, last: int, bearing: float, scratch: Float32Array) -> None:
    """Put sine and cosine of the measured direction into the first two rows of ``scratch``, 0 into the third."""
    heading = columns[2, first:last]
    sine = scratch[0, first:last]
    cosine = scratch[1, first:last]
    total = scratch[2, first:last]
    for i in range(last - first):
        s, c = sincos(float32(heading[i] + bearing))
        sine[i] = s
        cosine[i] = c
        total[i] = float32(0.0)


@kernel("void(float32[:, ::1], int64, int64, float32[:, ::1], float32, float32, float32, float32[:, ::1])")
def among(
    columns: Float32Array,
    first: int,
    last: int,
    landmarks: Float32Array,
    distance: float,
    distance_gain: float,
    concentration: float,
    scratch: Float32Array,
) -> None:
    """Add up, in the third row of ``scratch``, the likelihoods of all landmarks (rows of north and east)."""
    north = columns[0, first:last]
    east = columns[1, first:last]
    sine = scratch[0, first:last]
    cosine = scratch[1, first:last]
    total = scratch[2, first:last]
    for landmark in range(landmarks.shape[0]):
        landmark_north = landmarks[landmark, 0]
        landmark_east = landmarks[landmark, 1]
        for i in range(last - first):
            n = float32(landmark_north - north[i])
            e = float32(landmark_east - east[i])
            away = float32(math.sqrt(float32(n * n + e * e + float32(1e-12))))
            q = float32(distance_gain * float32(distance - away))
            turned = float32(float32(1.0) - float32(float32(n * cosine[i] + e * sine[i]) / away))
            surprise = float32(q * q + concentration * turned)
            total[i] += exp_bounded(float32(-min(surprise, float32(80.0))))


@kernel("void(float32[::1], int64, int64, float32[:, ::1], float32, float32)")
def gather(
    log_weights: Float32Array, first: int, last: int, scratch: Float32Array, inlier: float, outlier: float
) -> None:
    """Add the log of the mixture of the summed likelihoods and the outlier part."""
    total = scratch[2, first:last]
    log_weight = log_weights[first:last]
    for i in range(last - first):
        log_weight[i] += log(float32(inlier * total[i] + outlier))
