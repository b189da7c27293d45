"""The desk: where a query that asks the belief for something is checked, and sent on to the loop."""

from __future__ import annotations

import json

from service.channels import Outlet
from service.config import Configuration, ConfigurationError, Site, Start, validated
from service.orders import LARGEST
from service.publish.outlet import RefusedError

EXAMPLE = '{"position": [north, east, down], "heading": radians}'


class Desk:
    """Takes what is asked for.

    Parameters
    ----------
    configuration : Configuration
        Says whether there is an area for a start anywhere in it.
    orders : Outlet or None
        Queue to the loop, if there is one.
    """

    def __init__(self, configuration: Configuration, orders: Outlet | None) -> None:
        self._configuration = configuration
        self._orders = orders

    def reinitialize(self, asked: bytes) -> bytes:
        """Send a new start on, and answer that it was taken.

        Parameters
        ----------
        asked : bytes
            JSON as ``[start]`` has it: position, heading, sigma, sigma_heading, mode.

        Raises
        ------
        RefusedError
            It is no start, or nobody takes it now.
        """
        start = self._start_of(asked)
        if self._orders is None or not self._orders.send(start.model_dump_json().encode()):
            raise RefusedError("the loop takes no orders now; try again")
        return b'{"accepted":true}'

    def _start_of(self, asked: bytes) -> Start:
        if not asked or len(asked) > LARGEST:
            raise RefusedError(f"the payload should be a start such as {EXAMPLE}, and has {len(asked)} bytes")
        area = self._configuration.area
        try:
            file = {"start": json.loads(asked)} | ({} if area is None else {"area": area.model_dump()})
            return validated(file, Site, "reinitialize").start
        except ConfigurationError as error:
            raise RefusedError("; ".join(error.errors)) from error
        except (ValueError, RecursionError) as error:
            raise RefusedError(f"the payload should be JSON such as {EXAMPLE}: {error}") from error
