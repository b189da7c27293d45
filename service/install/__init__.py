"""The daemon as a systemd service: its unit, its account, its folders."""

from service.install.installation import install, purge, start, uninstall
from service.install.system import InstallError
from service.install.unit import Names, render

__all__ = ["InstallError", "Names", "install", "purge", "render", "start", "uninstall"]
