"""Turn a run of UTIAS MRCLAM (Leung, Halpern, Barfoot, Liu, 2011) into a recording that ``beliefd replay`` reads.

    python examples/mrclam.py mrclam_D7_R1.npz out/
    beliefd replay out/mrclam_D7_R1.mcap

A robot drives among 15 landmarks and four other robots, with a camera that sees bar codes; its odometry is what it was
told to do, as the data set's page says. The input has its rows as arrays: ``odom[t, v, w]``,
``meas[t, subject, range, bearing]``, ``landmarks[id, x, y]`` and ``gt[t, x, y, th]`` (seconds, metres, radians,
counter-clockwise from x). Out come the samples, the landmarks, the truth, and the facts of the place, once with the
names on the bar codes (STEM) and once without (STEM_unknown). East is x, north is y. Robots are recorded as what was
seen, and are not in the map.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from drivers.logs.recording import write
from drivers.sample import AnyReading, MotionCommand, RangeBearing, Sample

FIRST_LANDMARK = 6
"""Subjects below are robots, or (-1) bar codes that could not be read."""

FACTS = """\
[start]
position = [{north:.4f}, {east:.4f}, 0.0]
sigma = [0.1, 0.1, 0.1]
heading = {heading:.4f}
sigma_heading = 0.1
[motion]                          # chosen with the whole run in view
{motion}[[sensor]]
kind = "range_bearing"
association = "{association}"
{sensor}[map]
landmarks = "{landmarks}"
"""
MOTION = """\
speed_noise = 0.02
yaw_rate_noise = 0.02
slip_noise = 0.07
turn_noise = 0.15
gyro_bias_sigma = 0.01            # a command has none; what the drive makes of it has
odometry_scale_sigma = 0.1
odometry_scale_walk = 0.003
"""
SENSORS = {
    "known": """\
sigma = 0.5                       # 0.13 apart, but a landmark's errors are alike for ten seconds and more
sigma_bearing = 0.03
outliers = 0.05
""",
    "unknown": """\
sigma = 0.25                      # so narrow that neighbours, and robots, are told from a landmark
sigma_bearing = 0.03
correlation_s = 2.0               # the rest of what repeats: a thing seen again within 2 s is hardly a new witness
outliers = 0.4                    # robots: a fifth of all sights, and half of those of the first 110 s
""",
}
"""Of sights with names, and of those that may be of any landmark or none: the latter chosen on the first 300 s."""


def samples_of(run: Any) -> list[Sample]:
    """Return odometry and sights in the order of their times."""
    samples: list[Sample] = []

    def say(time: float, source: str, reading: AnyReading) -> None:
        stamp = round(time * 1e9)
        samples.append(Sample(stamp, stamp, "robot", source, reading))

    for time, speed, turn in run["odom"].tolist():
        say(time, "odometry", MotionCommand((speed, 0.0, 0.0), -turn, body=True))
    for time, subject, distance, bearing in run["meas"].tolist():
        landmark = int(subject) if subject >= 0 else None
        say(time, "camera", RangeBearing(distance, -bearing, landmark))
    return sorted(samples, key=lambda sample: sample.time)


def heading_of(angle: Any) -> Any:
    """Return a direction, clockwise from north, of an angle counter-clockwise from east."""
    return np.remainder(1.5 * math.pi - angle, 2.0 * math.pi) - math.pi


def write_tables(run: Any, stem: Path) -> Path:
    """Write map and truth, the latter twice; return the map's path."""
    landmarks = stem.with_name(f"{stem.name}_landmarks.csv")
    lines = (f"{int(number)},{y:.6f},{x:.6f}\n" for number, x, y in run["landmarks"].tolist())
    landmarks.write_text("id,north,east\n" + "".join(lines))
    time, x, y, angle = run["gt"].T
    truth = np.column_stack([time, y, x, np.zeros_like(x), heading_of(angle)])
    head = "time_s,north_m,east_m,down_m,heading_rad"
    for name in (stem.name, f"{stem.name}_unknown"):
        path = stem.with_name(f"{name}_truth.csv")
        np.savetxt(path, truth, "%.6f", delimiter=",", header=head, comments="")
    return landmarks


def main() -> None:
    """Run as a program."""
    parser = argparse.ArgumentParser(description="Turn a run of MRCLAM into a recording for beliefd replay.")
    parser.add_argument("run", type=Path, help="a run as .npz")
    parser.add_argument("folder", type=Path, help="where the files go")
    options = parser.parse_args()
    run: Any = np.load(options.run)
    options.folder.mkdir(parents=True, exist_ok=True)
    stem = options.folder / options.run.stem
    samples = samples_of(run)
    landmarks = write_tables(run, stem)
    _, east, north, angle = run["gt"][0].tolist()
    for name, association in ((stem.name, "known"), (f"{stem.name}_unknown", "unknown")):
        count = write(stem.with_name(f"{name}.mcap"), samples)
        facts = FACTS.format(
            north=north,
            east=east,
            heading=float(heading_of(angle)),
            motion=MOTION,
            association=association,
            sensor=SENSORS[association],
            landmarks=landmarks.name,
        )
        stem.with_name(f"{name}.toml").write_text(facts)
        print(f"{stem.with_name(name)}.mcap: {count} samples")


if __name__ == "__main__":
    main()
