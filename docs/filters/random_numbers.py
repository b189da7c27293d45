"""The figure of random-numbers.md, drawn from the project's own code: python docs/figures.py random_numbers."""

from __future__ import annotations

import math
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.kernels import random
from service.textbook.style import BLUE, GREY, RED


def normals() -> Figure:
    """Frequency of the normals against the Gaussian, down to the tails."""
    block, blocks = 1 << 17, 64
    noise = np.zeros((2, block), np.float32)
    edges = np.arange(-6.0, 6.01, 0.1)
    counts = np.zeros(edges.size - 1)
    key = random.key(5, 0)
    for step in range(blocks):
        random.normal_pairs(0, block, step, key, noise, 0)
        counts += np.histogram(noise, edges)[0]
    total = 2 * block * blocks
    middles = 0.5 * (edges[1:] + edges[:-1])
    share = np.array(
        [0.5 * (math.erf(b / math.sqrt(2)) - math.erf(a / math.sqrt(2))) for a, b in pairwise(edges)]
    )
    expected = total * share
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    seen = counts > 0
    above.semilogy(middles, expected, color=RED, linewidth=1.2, label="Gaussian")
    above.semilogy(middles[seen], counts[seen], ".", color=BLUE, markersize=4, label=f"{total:,} normals")
    above.set_ylim(0.3, None)
    above.set_ylabel("count in a bin of 0.1")
    above.legend(loc="upper right")
    enough = expected > 5
    below.axhspan(-2, 2, color=GREY, alpha=0.15, linewidth=0)
    below.plot(
        middles[enough],
        (counts - expected)[enough] / np.sqrt(expected[enough]),
        ".",
        color=BLUE,
        markersize=4,
    )
    below.set_ylabel("(count - expected)\n/ √expected")
    below.set_xlabel("value, sigma")
    below.set_ylim(-4.5, 4.5)
    return figure


FIGURES = {"normals": normals}
