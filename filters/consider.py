"""What a lasting error has done to a belief that takes readings for independent: Schmidt's "consider" filter.

A satellite receiver's error lasts: atmosphere and reflections change over a minute or so, and ten fixes a second all
have it. A belief that averages them grows narrow about the wrong place. The error b cannot be told from the position,
so there is nothing to estimate; but what it *can* have done to the mean is known, and is added to what is published
(S. F. Schmidt, "Application of state-space methods to navigation problems", 1966). Per axis, with gain K of a reading,
c = E[e²] the variance of the error that b has brought into the mean and r = E[e b]::

    a reading that has b      c' = (1 - K)² c + 2 K (1 - K) r + K² B,   r' = (1 - K) r + K B,   K = P / (P + R)
    a reading that has it not c' = (1 - K)² c,                          r' = (1 - K) r
    time                      r' = exp(-t / T) r                        (b is a Gauss-Markov process of variance B)

P being the belief's own variance and R the reading's own, as they are weighed. A belief that lives on fixes alone comes
to c = B: it is no better than the error that they share. With odometry it moves along b slowly, and c falls below it.
"""

from __future__ import annotations

import math


class LastingError:
    """The variance that a lasting error has brought into a mean, per axis.

    Parameters
    ----------
    duration : float
        Seconds over which the error changes.

    Attributes
    ----------
    variance : float
        m²: what to add to the variance of each axis.

    Raises
    ------
    ValueError
        A duration that is not positive and finite.
    """

    def __init__(self, duration: float) -> None:
        if not 0.0 < duration < math.inf:
            raise ValueError(f"lasting error: duration must be positive and finite, got {duration} s")
        self._duration = duration
        self.variance = 0.0
        self._shared = 0.0

    def restart(self, variance: float = 0.0) -> None:
        """Begin with a mean of which the error has this share: 0, or what the fix has that it is of."""
        self.variance = self._shared = variance

    def wait(self, seconds: float) -> None:
        """Let time pass: the error becomes another one, and what it did stays."""
        self._shared *= math.exp(-seconds / self._duration)

    def corrected(self, gain: float, lasting: float) -> None:
        """Note a reading that has the error.

        Parameters
        ----------
        gain : float
            Of the mean by the reading, 0…1.
        lasting : float
            Variance of the error now, m².
        """
        kept = 1.0 - gain
        self.variance = kept * kept * self.variance + 2.0 * gain * kept * self._shared + gain * gain * lasting
        self._shared = kept * self._shared + gain * lasting

    def displaced(self, gain: float) -> None:
        """Note a reading that has it not: it corrects what the error did, too."""
        kept = 1.0 - gain
        self.variance *= kept * kept
        self._shared *= kept
