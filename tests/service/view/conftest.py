"""The publishing process that the tests of publishing start, for those who look at it."""

from tests.service.publish.conftest import client, endpoint, port, start

__all__ = ["client", "endpoint", "port", "start"]
