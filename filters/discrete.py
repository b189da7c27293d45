"""The discrete Bayes filter: an exact belief over finitely many states.

Table 4.1, Discrete_Bayes_filter, section 4.1.1 of *Probabilistic Robotics*; elsewhere the forward pass of a
hidden Markov model. Line 3 predicts with the transition that belongs to the control, line 4 multiplies by the
likelihood of the measurement and normalises. Nothing is approximated: the belief equals the sum over all
paths of states.

The belief is kept as logarithms, so that a thousand measurements may speak against a state and a thousand
others bring it back. A prediction passes through probabilities; a state less likely than 1e-308 is given up
there, unless a transition leads to it.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Generic, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from filters.kernels import discrete as kernels
from filters.transition import Transition, Vector, require_probabilities, transition

State = TypeVar("State", bound=Hashable)


class DiscreteBayesFilter(Generic[State]):
    """A belief over labelled states: Table 4.1.

    Parameters
    ----------
    states : sequence
        A label for each state, all different: strings, numbers, members of an ``Enum``.
    transitions : mapping of control to matrix, or one matrix
        p(x_k | u, x_i) for each control u, from row i to column k, dense or sparse; see
        :func:`filters.transition.transition`. One matrix alone belongs to the control ``None``.
    belief : (n,) array, optional
        Probabilities at the start, up to a common factor; uniform if not given.

    Raises
    ------
    ValueError
        No states or labels that occur twice, transitions that do not fit the states, or probabilities that
        are negative, not finite or all zero.
    """

    def __init__(
        self,
        states: Sequence[State],
        transitions: Mapping[Any, object] | object,
        belief: ArrayLike | None = None,
    ) -> None:
        self.states: tuple[State, ...] = tuple(states)
        self._places = {state: place for place, state in enumerate(self.states)}
        if not self.states or len(self._places) < len(self.states):
            raise ValueError(f"discrete filter: at least one state, all different, got {self.states}")
        table = cast(
            Mapping[Any, object], transitions if isinstance(transitions, Mapping) else {None: transitions}
        )
        self._transitions = {control: self._fitting(control, given) for control, given in table.items()}
        self._log_belief: Vector = np.zeros(0)
        self.reset(np.ones(len(self.states)) if belief is None else belief)

    @property
    def belief(self) -> Vector:
        """Probability of each state, (n,) float64, in the order of ``states``; sums to one."""
        return np.exp(self._log_belief)

    @property
    def log_belief(self) -> Vector:
        """Its logarithm, (n,) float64; minus infinity for a state that cannot be."""
        return self._log_belief.copy()

    @property
    def most_likely(self) -> State:
        """The state of the largest probability; the first of them if several are equal."""
        return self.states[int(np.argmax(self._log_belief))]

    def probability(self, state: State) -> float:
        """Probability of one state.

        Raises
        ------
        ValueError
            There is no state of that label.
        """
        try:
            return math.exp(self._log_belief[self._places[state]])
        except KeyError:
            raise ValueError(f"discrete filter: no state {state!r} among {self.states}") from None

    def reset(self, belief: ArrayLike) -> None:
        """Start again from given probabilities, which are normalised.

        Raises
        ------
        ValueError
            As for the class; the belief is unchanged then.
        """
        self._log_belief = _normalised(_log(self._vector("belief", belief)), "belief")

    def predict(self, control: Hashable = None) -> None:
        """Line 3 of Table 4.1: move the belief as the control's transition says.

        Raises
        ------
        ValueError
            There is no transition for this control; the belief is unchanged then.
        """
        if control not in self._transitions:
            known = ", ".join(repr(known) for known in self._transitions)
            raise ValueError(f"discrete filter: no transition for control {control!r}; there are {known}")
        self._move(self._transitions[control])

    def propagate(self, given: object) -> None:
        """Line 3 with a transition of this moment, such as ``transition_over`` the time that has passed.

        Raises
        ------
        ValueError
            A transition that makes no sense or does not fit; the belief is unchanged then.
        """
        self._move(self._fitting("given", given))

    def update(self, likelihoods: ArrayLike) -> float:
        """Line 4 of Table 4.1: weigh every state by p(z | x_k), and normalise.

        A measurement that no possible state explains changes nothing: the belief is kept, and the evidence
        says that it was impossible.

        Parameters
        ----------
        likelihoods : (n,) array
            p(z | x_k), not negative and finite; a density is as good as a probability.

        Returns
        -------
        float
            Logarithm of the evidence p(z | what was before), 1 / eta of line 4; minus infinity if impossible.

        Raises
        ------
        ValueError
            A likelihood negative or not finite, or not one per state; the belief is unchanged then.
        """
        return self._weigh(_log(self._vector("likelihoods", likelihoods)))

    def update_log(self, log_likelihoods: ArrayLike) -> float:
        """Line 4 with log p(z | x_k), which may be any finite number or minus infinity; see :meth:`update`.

        Raises
        ------
        ValueError
            NaN or plus infinity, or not one per state; the belief is unchanged then.
        """
        logs = np.array(log_likelihoods, np.float64, ndmin=1)
        self._require_one_each("log likelihoods", logs)
        evidence = self._weigh(logs)
        if math.isnan(evidence):
            raise ValueError(f"discrete filter: log likelihoods must be below infinity, got {logs.tolist()}")
        return evidence

    def _weigh(self, logs: Vector) -> float:
        """Weigh the belief, unless no state is left; NaN for what is no logarithm of a likelihood."""
        weighed = np.empty(logs.size)
        evidence = kernels.weigh.direct(self._log_belief, logs, weighed)
        if evidence > -math.inf:
            self._log_belief = weighed
        return evidence

    def _move(self, moving: Transition) -> None:
        moved = moving.predict(self.belief)
        self._log_belief = _normalised(_log(moved), "prediction")

    def _fitting(self, control: object, given: object) -> Transition:
        try:
            made = transition(given)
        except ValueError as error:
            raise ValueError(f"discrete filter: control {control!r}: {error}") from error
        if made.size != len(self.states):
            raise ValueError(
                f"discrete filter: control {control!r}: the transition has {made.size} states, "
                f"{len(self.states)} are needed"
            )
        return made

    def _vector(self, what: str, values: ArrayLike) -> Vector:
        vector = np.array(values, np.float64, ndmin=1)
        self._require_one_each(what, vector)
        require_probabilities(f"discrete filter: {what}", vector)
        return vector

    def _require_one_each(self, what: str, vector: Vector) -> None:
        if vector.shape != (len(self.states),):
            raise ValueError(
                f"discrete filter: {what} must have one number for each of {len(self.states)} states, got "
                f"shape {vector.shape}"
            )


def _log(values: Vector) -> Vector:
    with np.errstate(divide="ignore"):
        return np.log(values)


def _log_sum(logs: Vector) -> float:
    top = float(logs.max())
    return top + math.log(float(np.exp(logs - top).sum())) if top > -math.inf else -math.inf


def _normalised(logs: Vector, what: str) -> Vector:
    total = _log_sum(logs)
    if total == -math.inf:
        raise ValueError(f"discrete filter: {what}: at least one probability must be positive")
    return logs - total
