"""Which messages never arrived: the gaps in the numbers that every MAVLink sender gives its frames.

A sender counts its frames from 0 to 255 and round again, whatever their kind. A number that was jumped over is
lost until it comes late after all. Some gaps are none: a frame that was overtaken lies behind, not ahead; a
sender that starts anew counts from 0; and after a silence the count may have gone round, so that the gap says
nothing.
"""

from __future__ import annotations

from drivers.mavlink.frames import Frame
from drivers.sample import SECOND

NUMBERS = 256
LARGEST_GAP = NUMBERS // 2  # a number further ahead lies behind: it was overtaken
NEAR = 16  # a 0 closer to what was due than this is its turn, missed or late; a boot comes out of place
SILENCE = 3 * SECOND  # three heartbeats, which every sender owes once a second; no autopilot boots faster


class _Sender:
    """One sender's count: the number that is due, when it spoke last, what was jumped over lately."""

    __slots__ = ("due", "heard", "missing")

    def __init__(self, sequence: int, received: int) -> None:
        self.due = (sequence + 1) % NUMBERS
        self.heard = received
        self.missing: set[int] = set()

    def lost_before(self, sequence: int) -> int:
        """Take in the next number and return how many more are lost now; -1 for one that came late."""
        gap = (sequence - self.due) % NUMBERS
        if gap == 0 and not self.missing:
            self.due = (sequence + 1) % NUMBERS
            return 0
        if gap > LARGEST_GAP and sequence in self.missing:
            self.missing.remove(sequence)
            return -1
        if sequence == 0 and NEAR <= gap <= NUMBERS - NEAR:
            self.due = 1
            return 0
        if gap > LARGEST_GAP:  # it came twice
            return 0
        self.missing.update((self.due + step) % NUMBERS for step in range(gap))
        self.due = due = (sequence + 1) % NUMBERS
        # should one of the others come now, it would be the next round's and not late
        self.missing = {number for number in self.missing if (number - due) % NUMBERS > LARGEST_GAP}
        return gap


class Sequences:
    """Counts what each sender (system, component) sent and nobody here received.

    Attributes
    ----------
    lost : int
        Messages that never arrived whole. A lower bound: a gap says how many only up to
        :data:`LARGEST_GAP`, and nothing after a silence.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._senders: dict[tuple[int, int], _Sender] = {}

    def heard(self, frame: Frame, received: int) -> None:
        """Take in a checked frame that arrived at ``received``, nanoseconds."""
        address = (frame.system, frame.component)
        sender = self._senders.get(address)
        if sender is None or received - sender.heard > SILENCE:
            self._senders[address] = _Sender(frame.sequence, received)
            return
        sender.heard = received
        self.lost += sender.lost_before(frame.sequence)

    def passed(self, frame: Frame) -> None:
        """Take in a frame that no checksum vouches for: its number counts only where it was due."""
        sender = self._senders.get((frame.system, frame.component))
        if sender is not None and frame.sequence == sender.due:
            sender.lost_before(frame.sequence)

    def forget(self) -> None:
        """Begin all counts anew, when the port was closed: what was sent meanwhile is not known."""
        self._senders.clear()
