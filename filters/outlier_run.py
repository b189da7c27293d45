"""Whether a run of outliers still says that the belief is right: how many there are varies from place to place.

A reading z has the evidence q u + (1 - q) f if the belief is right, with q the share of outliers, u their density and f
the evidence of the part that is no outlier; if the belief is wrong, it comes from anywhere, with u. Their ratio

    wrong : right = 1 / (q + (1 - q) f / u)

is large for one outlier where outliers are rare, and near 1 where they are frequent. Outliers do not come one by one as
coins fall: what hides a beacon, or moves where no landmark stands, stays for a while. So q is not the share that was
stated, but drawn for each run of readings from a Beta distribution about it, with the weight of one reading, and
learned in the run (the Beta-Bernoulli model; Gelman et al., *Bayesian Data Analysis*, 2.1). Ten outliers in a row
speak for many outliers as well as against the belief; how well depends on what was stated.

A run begins when nothing speaks against the belief (the cumulative sum of Page, 1954: the likelihood ratio since the
moment that speaks most against it).
"""

from __future__ import annotations

import math

WEIGHT = 1.0
"""Readings that the stated share of outliers is worth when a run begins."""

LEAST = 1e-6
"""Probabilities below are taken for it: no reading proves anything by itself."""


class OutlierRun:
    """What the readings since the beginning of a run say against the belief.

    Attributes
    ----------
    log_odds : float
        Logarithm of the ratio of the evidence for "wrong" to that for "right", 0 or more.
    """

    def __init__(self) -> None:
        self.log_odds: float = 0.0
        self._outliers: float = 0.0
        self._inliers: float = 0.0

    def observe(self, surprise: float, stated: float, worth: float = 1.0) -> None:
        """Take one reading.

        Parameters
        ----------
        surprise : float
            Probability, 0 to 1, that it is an outlier, with the stated share of them.
        stated : float
            That share, in (0, 1).
        worth : float
            What it is worth of an independent reading, 0 to 1.

        Raises
        ------
        ValueError
            A number out of its range.
        """
        if not (0.0 <= surprise <= 1.0 and 0.0 < stated < 1.0 and 0.0 <= worth <= 1.0):
            raise ValueError(
                f"outlier run: surprise and worth lie in 0 to 1, the stated share between, got {surprise}, "
                f"{worth} and {stated}"
            )
        surprise = max(surprise, LEAST)
        relative = stated * (1.0 - surprise) / (surprise * (1.0 - stated))
        share = (WEIGHT * stated + self._outliers) / (WEIGHT + self._outliers + self._inliers)
        evidence = share + (1.0 - share) * relative
        self.log_odds -= worth * math.log(evidence)
        if self.log_odds <= 0.0:
            self.log_odds = self._outliers = self._inliers = 0.0
            return
        outlier = share / evidence
        self._outliers += worth * outlier
        self._inliers += worth * (1.0 - outlier)
