"""The motion mode: still, moving or slipping.

A discrete Bayes filter (Table 4.1) over the three, with rates at which one turns into another. Every stretch of the
odometry and of the gyro is evidence between still and moving. That wheels begin or cease to slip shows in a jump of
their speed that no accelerometer felt (:class:`~service.estimator.grip.Grip`): evidence of a change, not of a mode.
How far they slip only shows in what is measured from outside: two Gaussians that interact
(:mod:`filters.linearised.interacting`), one taking the wheels at their word and one doubting them by :data:`SLIP`, say
of each measurement how well they expected it.

What follows from it: a vehicle that certainly stands is neither moved nor resampled, and its gyro's reading is its
bias; the wheels of one that slips are doubted, so that neither the pose nor the odometry's scale is led away.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.discrete import DiscreteBayesFilter
from filters.kalman import Matrix
from filters.linearised.bank import BATCHED, GaussianBank
from filters.linearised.interacting import mix
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.transition import Drift
from service.config import Configuration
from service.estimate import MotionMode
from service.estimator.gaussian import gaussian_of, is_one_place
from service.estimator.grip import NOTHING, Grip, Said
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.vehicle import Vehicle

GENERATOR = np.array(((-0.2, 0.2, 0.0), (0.05, -0.06, 0.01), (0.05, 0.2, -0.25)))
"""Per second: how often still, moving, slipping (rows) turn into each other; a slip lasts some 5 s, each 100 s."""

BEGINNING = (0.5, 0.45, 0.05)
"""Probabilities of still, moving and slipping while nothing was heard."""

SLIP = 0.2
"""How far wheels that slip are off, as a share of the speed (one standard deviation)."""

JUMPY, SUDDEN = 0.005, 0.5
"""Which share of the :data:`TELLING` stretches of slipping wheels have a jump, and of the slips begin or end with one:
ice is left gently."""

GRIP = 1.0
"""Seconds for which a slip goes on in one way: it adds up faster than noise."""

CREEP = 0.01
"""m/s below which wheels do not turn."""

SPIN = 0.02
"""rad/s below which a gyro does not turn, its bias taken off."""

WHEELS_STAND = np.log((0.99, 0.03, 0.0001))
WHEELS_TURN = np.log((0.0001, 0.97, 0.9999))
GYRO_STANDS = np.log((0.99, 0.4, 0.4))
GYRO_TURNS = np.log((0.01, 0.6, 0.6))
"""Log probability of what a :data:`STRETCH` of wheels and gyro looks like in each mode. The wheels of a vehicle that
creeps may stand; the gyro of one that drives straight does."""

TELLING = SECOND // 10
"""Nanoseconds of wheels and gyro that are taken together."""

STRETCH = 0.2
"""Seconds of odometry that count as one independent reading."""

SLIPPERY, GRIPPING = 0.4, 0.1
"""Probability of slipping from which wheels are doubted, and below which those that slipped are believed again."""

CERTAIN = 0.9
"""Probability from which the vehicle is treated as standing."""

NARROW = 3.0
"""Metres: the spread of a belief that two Gaussians can stand for."""

CHECKING = SECOND
"""Nanoseconds after which they are compared with the belief again."""

FAR = 16.0
"""Squared distance from the belief, in standard deviations, at which they begin anew as it is."""

_MODES = tuple(MotionMode)
_WHEELED = np.array((0, 0, 1))
"""Which of the Gaussians each mode goes by."""

_SLIPS, _GRIPS = float(GENERATOR[1, 2]), float(GENERATOR[2, 1])


class Mode:
    """Follows the motion mode; a :class:`~service.estimator.companion.Companion` that is also told before each move.

    Parameters
    ----------
    motion : Unicycle
        How the vehicle moves.
    slow : list of SlowState
        Slow states beside it.
    belief : ParticleFilter
        What the two Gaussians begin as.
    rolled : callable
        What odometer and gyro said between two times, undoubted.
    grip : Grip, optional
        Who compares wheels and accelerometer.

    Attributes
    ----------
    stands : bool
        Whether the vehicle is certain to stand still over the stretch of the last :meth:`approach`.
    """

    def __init__(
        self,
        motion: Unicycle,
        slow: list[SlowState],
        belief: ParticleFilter[Any],
        rolled: Callable[[int, int], UnicycleControl],
        grip: Grip | None = None,
    ) -> None:
        self._motion = motion
        self._belief = belief
        self._rolled = rolled
        self._grip = grip
        self._bank = GaussianBank(motion, slow, 2)
        self._modes = DiscreteBayesFilter[MotionMode](_MODES, np.eye(3), BEGINNING)
        self.stands = False
        self._slips = False
        self._told: int | None = None
        self._bias = 0.0
        self._checked = 0

    @property
    def mode(self) -> MotionMode:
        """The most likely one; slipping, until that has become unlikely."""
        return MotionMode.SLIPPING if self._slips else self._modes.most_likely

    @property
    def still(self) -> float:
        """Probability of standing still."""
        return self._modes.probability(MotionMode.STILL)

    def doubt(self, distance: float, duration: float) -> float:
        """Return the variance (m²) by which a distance is to be doubted, over so many seconds."""
        return _slip_variance(distance, duration) if self._slips and duration > 0.0 else 0.0

    # --- before a move --------------------------------------------------------------------------------------------

    def approach(self, start: int, end: int) -> None:
        """Take what odometer and gyro say of the stretch that the belief is about to be moved over.

        A stretch in which anything turns is moved over, whatever the mode: not even the beginning of a drive is lost.
        """
        if end <= start:
            return
        if self._told is None:
            self._told = start
        if end - self._told >= TELLING:
            said = NOTHING if self._grip is None else self._grip.ask(self._told, end)
            self._tell((end - self._told) / SECOND, self._rolled(self._told, end), said)
            self._told = end
        rolls, turns = self._looks((end - start) / SECOND, self._rolled(start, end))
        self.stands = not rolls and not turns and self.still >= CERTAIN

    def _looks(self, duration: float, control: UnicycleControl) -> tuple[bool, bool]:
        """Say whether the wheels roll, and whether the gyro turns."""
        return (
            abs(control.distance) > CREEP * duration,
            abs(control.turn - self._bias * duration) > SPIN * duration,
        )

    def _tell(self, duration: float, control: UnicycleControl, said: Said) -> None:
        """Let the modes change, and weigh them by wheels and gyro, and by wheels and accelerometer."""
        stretch = min(duration, 1.0)  # the filter is told ten times a second
        if self._bank.live[0]:
            mix(self._bank, _among_wheeled(stretch), self._modes.belief[1:] + 1e-12)
        if said is NOTHING:
            self._modes.propagate(Drift(GENERATOR, stretch))
        else:
            self._change(stretch, said)
        rolls, turns = self._looks(duration, control)
        logs = np.zeros(3)
        if control.distance_sigma == 0.0:
            logs += WHEELS_TURN if rolls else WHEELS_STAND
        if control.turn_sigma == 0.0:
            logs += GYRO_TURNS if turns else GYRO_STANDS
        self._modes.update_log(min(1.0, duration / STRETCH) * logs)
        slipping = self._modes.probability(MotionMode.SLIPPING)
        self._slips = slipping >= (GRIPPING if self._slips else SLIPPERY)

    def _change(self, stretch: float, said: Said) -> None:
        """Let the modes change, p(j | i) p(z | i, j): what is measured, a jump, is a matter of both i and j."""
        change = (np.eye(3) + stretch * GENERATOR) * _likely(said)
        leaving = change.sum(axis=1)
        self._modes.update_log(np.log(leaving))
        self._modes.propagate(change / leaving[:, None])

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Let the Gaussians begin anew as the belief does, and trust the wheels again."""
        self._bank.live[:] = False
        self._modes.reset(BEGINNING)
        self._slips = False
        self._checked = time - CHECKING
        self._told = None

    def moved(self, start: int, end: int) -> None:
        """Move both Gaussians, one of them in doubt of the wheels."""
        duration = (end - start) / SECOND
        control = self._rolled(start, end)
        if not self.stands:
            doubt = np.array([0.0, _slip_variance(control.distance, duration)])
            self._bank.predict(control, duration, doubt)
        if end - self._checked >= CHECKING:
            self._checked = end
            self._check()

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Weigh both Gaussians, and the modes by how well they expected the measurement."""
        if type(measured.model) not in BATCHED or not self._bank.live[0]:
            return
        expectations = self._bank.expect(measured.model, measured.value)
        said = self._bank.correct(expectations, self._bank.live, 0.9999)
        logs = np.logaddexp(said.log_evidence, measured.log_outlier)
        self._modes.update_log(logs[_WHEELED])

    def _check(self) -> None:
        """Begin anew as the belief where the Gaussians are not live or have lost it."""
        moments = self._belief.moments()
        self._bias = float(moments.mean[3])
        if not is_one_place(moments, NARROW):
            self._bank.live[:] = False
            return
        if self._bank.live[0]:
            away = moments.mean[:2] - self._bank.mean[:, :2]
            spread = self._bank.covariance[:, :2, :2] + moments.pose_covariance[:2, :2] + 0.01 * np.eye(2)
            distances = np.einsum("mi,mij,mj->m", away, np.linalg.inv(spread), away)
            if (distances < FAR).all():
                return
        mean, covariance = gaussian_of(self._belief, self._motion.conditional_variances)
        self._bank.set_all(mean, covariance)


def _likely(said: Said) -> Matrix:
    """Return the likelihood of what was said for each change of mode, from row to column; 1 where the wheels hold."""
    changes = (1.0 - SUDDEN) * said.slip + SUDDEN * said.change
    slips = (1.0 - JUMPY) * said.slip + JUMPY * said.change
    return np.array(((1.0, 1.0, changes), (1.0, 1.0, changes), (changes, changes, slips)))


def _slip_variance(distance: float, duration: float) -> float:
    """Return the variance of the distance that slipping wheels count over a stretch."""
    return 2.0 * GRIP * (SLIP * distance) ** 2 / duration


def _among_wheeled(duration: float) -> Matrix:
    """Return the transition between moving and slipping alone: of a vehicle that stands neither Gaussian moves."""
    slips, grips = duration * _SLIPS, duration * _GRIPS
    return np.array(((1.0 - slips, slips), (grips, 1.0 - grips)))


def mode_of(configuration: Configuration, vehicle: Vehicle, belief: ParticleFilter[Any]) -> Mode | None:
    """Return who follows the mode of a vehicle, and have the vehicle heed it; ``None`` where it is switched off."""
    if not (configuration.honesty.motion_mode and isinstance(vehicle, GroundVehicle)):
        return None
    grip = Grip(vehicle.controls, SLIP)
    mode = Mode(vehicle.motion, vehicle.slow_states, belief, vehicle.rolled, grip)
    vehicle.heed(mode)
    return mode
