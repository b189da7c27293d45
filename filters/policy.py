"""When to resample: small rules, with one question for the family, ``due(wear) -> bool``.

Resampling forgets: what is not drawn is gone, and where the state does not move nothing brings it back. So the book
resamples less often than it weighs, and multiplies the weights up in between (equation 4.36); it never resamples a
state that stands still. A rule sees what is in :class:`Wear`, holds no state, and composes with others::

    WhenStill(still=Never(), moving=EffectiveShare(0.5))
"""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Wear(NamedTuple):
    """How worn a weighted set is.

    Attributes
    ----------
    particles : int
        How many there are *now*: their number varies, so a threshold in particles would soon be wrong.
    effective_sample_size : float
        (Σ w)² / Σ w², from 1 (one particle has it all) to ``particles`` (equal weights).
    still : float
        Probability that the state has not moved since the last resampling, as a motion-mode filter knows it; 0
        where nobody knows.
    """

    particles: int
    effective_sample_size: float
    still: float = 0.0


class Policy(Protocol):
    """The named requirement of a rule."""

    def due(self, wear: Wear) -> bool:
        """Whether to resample now."""
        ...


class Never:
    """Weights multiply up for ever (equation 4.36, second case): right for a state that is known not to move."""

    def due(self, wear: Wear) -> bool:
        """Return False."""
        return False


class Always:
    """After every measurement, as Table 4.3 has it (equation 4.36, first case)."""

    def due(self, wear: Wear) -> bool:
        """Return True."""
        return True


class EffectiveShare:
    """When the effective sample size is below a share of the particles there are.

    Parameters
    ----------
    below : float
        The share, in (0, 1].

    Raises
    ------
    ValueError
        A share outside (0, 1].
    """

    def __init__(self, below: float = 0.5) -> None:
        if not 0.0 < below <= 1.0:
            raise ValueError(f"effective share: below must lie in (0, 1], got {below}")
        self.below = below

    def due(self, wear: Wear) -> bool:
        """Whether 1 / Σ w² has fallen below the share of the current count."""
        return wear.effective_sample_size < self.below * wear.particles


class WhenStill:
    """One rule while the state moves, another (never, or a far smaller share) while it stands still.

    Parameters
    ----------
    still : Policy
        The rule from ``certainty`` on.
    moving : Policy
        The rule otherwise.
    certainty : float
        Probability of standing still from which ``still`` rules, in (0, 1].

    Raises
    ------
    ValueError
        A certainty outside (0, 1].
    """

    def __init__(self, still: Policy, moving: Policy, certainty: float = 0.9) -> None:
        if not 0.0 < certainty <= 1.0:
            raise ValueError(f"when still: certainty must lie in (0, 1], got {certainty}")
        self.still = still
        self.moving = moving
        self.certainty = certainty

    def due(self, wear: Wear) -> bool:
        """Ask the rule that fits."""
        return (self.still if wear.still >= self.certainty else self.moving).due(wear)
