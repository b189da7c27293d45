"""The command line of the simulated vehicle."""

from __future__ import annotations

import contextlib
import signal
from pathlib import Path
from typing import IO, Annotated, NoReturn

import typer

from sim_vehicle import configuration, realtime, recording, scenarios
from sim_vehicle.configuration import Listening
from sim_vehicle.ports import CanPort, PortError, bus_of, open_can, open_mavlink
from sim_vehicle.scenario import Scenario
from sim_vehicle.vehicle import Vehicle, prepare

WRONG_USE = 2

application = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@application.command(
    epilog="Examples: python -m sim_vehicle beacons --seed 1 --write out/b1  ·  "
    "python -m sim_vehicle demo --realtime --mavlink udpout:127.0.0.1:14550 --can slcan:/tmp/can0"
)
def drive(
    scenario: Annotated[
        str, typer.Argument(help="Its name; without one: the list of them.", show_default=False)
    ] = "",
    seed: Annotated[
        int, typer.Option(min=0, help="Of everything that is random: course, biases, noise.")
    ] = 1,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, help="How long to drive.  [default: the scenario's own]", show_default=False),
    ] = None,
    mavlink: Annotated[
        str, typer.Option(help="udpout:HOST:PORT, udpin:HOST:PORT or tcpin:HOST:PORT.", show_default=False)
    ] = "",
    can: Annotated[
        str,
        typer.Option(
            help="vcan0, or INTERFACE:CHANNEL of python-can; slcan:PATH makes an adapter there.",
            show_default=False,
        ),
    ] = "",
    real_time: Annotated[
        bool,
        typer.Option(
            "--realtime", help="Drive by the host's clock, on the links; so it does with --mavlink anyway."
        ),
    ] = False,
    write: Annotated[
        Path | None,
        typer.Option(
            help="Write STEM.tlog, STEM.candump.log, STEM_truth.csv, STEM.toml, faster than real time.",
            metavar="STEM",
            show_default=False,
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help="With --realtime: write the truth there, line by line.", show_default=False),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            help="With --realtime: write the daemon's configuration for these links.", show_default=False
        ),
    ] = None,
) -> None:
    """A simulated rover that speaks MAVLink and DroneCAN, on its links in real time or into log files."""
    if not scenario:
        for name in scenarios.names():
            typer.echo(f"{name:12} {scenarios.description(name)}")
        return
    try:
        drawn = scenarios.draw(scenario, seed)
    except ValueError as error:
        _refuse(str(error))
    duration = drawn.seconds if seconds is None else seconds
    if write is not None and not (real_time or mavlink or can or truth or config):
        _write(drawn, seed, duration, write)
    elif mavlink and write is None:
        _drive(drawn, seed, duration, mavlink, can, truth, config)
    else:
        _refuse(
            "needs either --mavlink URL (and --realtime, --can, --truth, --config), or --write STEM alone"
        )


def _refuse(reason: str) -> NoReturn:
    typer.echo(f"sim_vehicle: {reason}", err=True)
    raise typer.Exit(WRONG_USE)


def _write(scenario: Scenario, seed: int, seconds: float, stem: Path) -> None:
    try:
        recorded = recording.write(scenario, seed, seconds, stem)
    except OSError as error:
        typer.echo(f"sim_vehicle: --write {stem}: {error}", err=True)
        raise typer.Exit(1) from error
    for path in recorded.files:
        typer.echo(path)
    typer.echo(
        f"{recorded.mavlink_frames} MAVLink frames, {recorded.can_frames} CAN frames, "
        f"{recorded.truth_rows} truth rows"
    )


def _drive(
    scenario: Scenario, seed: int, seconds: float, url: str, bus: str, truth: Path | None, config: Path | None
) -> None:
    stopping: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: stopping.append(received))
    with contextlib.ExitStack() as open_things:
        try:
            mavlink = open_mavlink(url)
            open_things.callback(mavlink.close)
            can_port: CanPort | None = open_can(bus) if bus else None
            rows: IO[str] | None = open_things.enter_context(truth.open("w", newline="")) if truth else None
        except (PortError, OSError) as error:
            _refuse(str(error))
        if can_port is not None:
            open_things.callback(can_port.close)
        listening = Listening(_other_side(mavlink.address), _channel(bus))
        if config is not None:
            config.write_text(configuration.text(scenario, listening))
        typer.echo(
            f"{scenario.name}, seed {seed}: MAVLink at {mavlink.address}" + (f", CAN at {bus}" if bus else "")
        )
        prepare(scenario)
        start = realtime.now()
        vehicle = Vehicle(scenario, seed, start.unix)
        driven = realtime.RealTime(vehicle, start, mavlink, can_port, rows).run(
            seconds, lambda: bool(stopping)
        )
    typer.echo(
        f"{driven.seconds:.1f} s: "
        f"{driven.mavlink_frames} MAVLink frames ({driven.mavlink_dropped} to nobody), "
        f"{driven.can_frames} CAN frames ({driven.can_dropped} to nobody)"
    )


def _other_side(address: str) -> str:
    """Return the URL that a listener opens to meet an address of ours."""
    kind, _, place = address.partition(":")
    return {"udpout": "udpin", "udpin": "udpout", "tcpin": "tcp"}[kind] + ":" + place


def _channel(bus: str) -> tuple[str, str] | None:
    return bus_of(bus) if bus else None


def main() -> None:
    """Run the command line."""
    application()
