"""Interacting models: Gaussians that differ in their motion's noise, and a belief over which of them is right.

Which model moves the vehicle changes from time to time. Keeping every history of models is impossible, so before each
step the Gaussians are mixed: member j begins the step as the mixture of all, each weighted by how likely it is that its
model has just turned into j, replaced by the Gaussian of the same mean and covariance (Blom and Bar-Shalom, "The
interacting multiple model algorithm", IEEE Transactions on Automatic Control 33, 1988, eqs. 3 to 6)::

    c_j = sum_i p_ij mu_i,   w_i|j = p_ij mu_i / c_j
    x_j = sum_i w_i|j x_i,   C_j = sum_i w_i|j (C_i + (x_i - x_j) (x_i - x_j)ᵀ)

The belief mu itself is a discrete Bayes filter (Table 4.1), which is kept outside: other evidence comes into it, too.
"""

from __future__ import annotations

import numpy as np

from filters.kalman import Matrix
from filters.kernels.mixing import mix_gaussians
from filters.linearised.bank import GaussianBank

_HEADING = 2


def mix(bank: GaussianBank, transition: Matrix, belief: Matrix) -> None:
    """Mix the members of a bank before a step.

    Parameters
    ----------
    bank : GaussianBank
        One member for each model, all live.
    transition : (B, B) float64
        p_ij, from row to column: each row a distribution.
    belief : (B,) float64
        mu before the step; not all zero.

    Raises
    ------
    ValueError
        Shapes that do not fit, or a belief that is not positive anywhere.
    """
    members = len(bank.mean)
    if transition.shape != (members, members) or belief.shape != (members,) or not belief.sum() > 0.0:
        raise ValueError(
            f"mix: a transition of {members} models and a belief over them are needed, got {transition.shape} and "
            f"{belief.tolist()}"
        )
    mix_gaussians.direct(
        bank.mean,
        bank.covariance,
        np.ascontiguousarray(transition, np.float64),
        np.ascontiguousarray(belief, np.float64),
        _HEADING,
    )
