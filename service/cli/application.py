"""The commands under their names."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli import bench, check, demo, listen, replay, run, scenario, send, sim, textbook, unit, warm

_HELP = """
A belief daemon: where a vehicle is when satellite navigation is gone, on time and honest about it.

It listens to sensors over MAVLink, CAN and Zenoh, holds the belief in a particle filter,
and publishes it on Zenoh.
"""

_EPILOG = """
[bold]Start here[/bold]

beliefd demo [dim]· a simulated rover, the daemon and a live view, for a minute[/dim]

beliefd check robot.toml [dim]· what would run, or everything that is wrong[/dim]

beliefd run robot.toml [dim]· the daemon, in the foreground[/dim]

Exit status: 0 done, 1 failed, 2 wrong use or configuration.
"""

application = typer.Typer(
    name="beliefd",
    help=_HELP,
    epilog=_EPILOG,
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"beliefd {version('beliefd')}")
        raise typer.Exit


@application.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    """Take the options that stand before every command."""


_COMMANDS = (demo, run, check, sim, listen, send, replay, scenario, textbook, bench, warm)
for _module in _COMMANDS:
    application.command(
        _module.NAME,
        epilog=_module.EPILOG,
        hidden=_module is warm,
        context_settings=sim.SETTINGS if _module is sim else None,
    )(_module.command)
application.add_typer(unit.application, name="service")
