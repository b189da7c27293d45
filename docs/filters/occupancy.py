"""The figures of occupancy.md, drawn from the project's own code: python docs/figures.py occupancy."""

from __future__ import annotations

import math
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.geometry import GridGeometry
from filters.occupancy import InverseRangeModel, OccupancyGrid, Pose
from filters.particle_set import ParticleSet
from filters.sectors import RangeSectors
from filters.sensing.scan import Scan, ScanMeasurement
from service.textbook.style import RED

GEOMETRY = GridGeometry(0.1, 0.0, 0.0, 80, 120)
EXTENT = (0.0, 12.0, 0.0, 8.0)
LONGEST = 6.0


def building() -> OccupancyGrid:
    """Four rooms along a corridor."""
    walls = np.zeros(GEOMETRY.shape)
    walls[:2], walls[-2:], walls[:, :2], walls[:, -2:] = 1, 1, 1, 1
    walls[32:34] = walls[48:50] = 1
    walls[:34, 60:62] = walls[48:, 45:47] = 1
    for row, column in ((32, 28), (32, 88), (48, 20), (48, 78)):
        walls[row : row + 2, column : column + 10] = 0
    walls[10:16, 90:98] = walls[62:66, 12:22] = 1
    return OccupancyGrid.from_probability(GEOMETRY.resolution, 0.0, 0.0, walls)


def track() -> list[Pose]:
    """Along the corridor, and a look into each room."""
    corner = [(4.1, 0.8), (4.1, 2.5), (6.2, 2.6), (4.1, 2.6), (4.1, 3.3), (2.0, 3.3), (4.1, 3.3), (4.1, 8.3)]
    corner += [(6.5, 8.3), (4.1, 8.3), (4.1, 9.3), (2.2, 9.3), (4.1, 9.3), (4.1, 11.2)]
    poses = []
    for (north, east), (to_north, to_east) in pairwise(corner):
        steps = max(2, round(math.hypot(to_north - north, to_east - east) / 0.25))
        heading = math.atan2(to_east - east, to_north - north)
        for share in np.linspace(0.0, 1.0, steps, endpoint=False):
            poses.append(Pose(north + share * (to_north - north), east + share * (to_east - east), heading))
    return poses


def measured(
    truth: OccupancyGrid, pose: Pose, bearings: np.ndarray, rng: np.random.Generator
) -> RangeSectors:
    """A scan with 3 cm of noise, in which one sector in fifty lies."""
    ranges = truth.expected_ranges(pose, bearings, LONGEST) + rng.normal(0.05, 0.03, bearings.size)
    lies = rng.random(bearings.size) < 0.02
    ranges[lies] = rng.uniform(0.3, LONGEST, int(lies.sum()))
    return RangeSectors.of(bearings, ranges, LONGEST, width=2 * math.pi / bearings.size, shortest=0.2)


def panel(axis: plt.Axes, grid: OccupancyGrid, title: str) -> None:
    axis.imshow(1.0 - grid.occupancy, cmap="gray", vmin=0, vmax=1, origin="lower", extent=EXTENT)
    axis.set_title(title, fontsize=9)
    axis.set_xlabel("east, m")


def mapped() -> Figure:
    """The building, and what is believed of it after one, ten and all scans."""
    rng = np.random.default_rng(3)
    truth, poses = building(), track()
    bearings = np.linspace(-math.pi, math.pi, 120, endpoint=False)
    grid, model = OccupancyGrid(GEOMETRY), InverseRangeModel(thickness=0.1)
    figure, axes = plt.subplots(2, 2, figsize=(8.2, 5.9), layout="constrained", sharex=True, sharey=True)
    panel(axes[0, 0], truth, "the building, and the way through it")
    axes[0, 0].plot([pose.east for pose in poses], [pose.north for pose in poses], color=RED, linewidth=1)
    shown = dict(zip((1, 10, len(poses)), axes.flat[1:], strict=True))
    for count, pose in enumerate(poses, start=1):
        grid.integrate(pose, measured(truth, pose, bearings, rng), model)
        if count in shown:
            words = "1 scan" if count == 1 else f"{count} scans"
            panel(shown[count], grid, f"believed after {words}")
            shown[count].plot(pose.east, pose.north, "o", color=RED, markersize=4)
    for axis in axes[:, 0]:
        axis.set_ylabel("north, m")
    for axis in axes[0]:
        axis.set_xlabel("")
    return figure


def field() -> Figure:
    """The distance field, and how likely a scan is from every place."""
    rng = np.random.default_rng(5)
    truth, pose = building(), Pose(4.1, 8.6, 0.4)
    sensor = Scan(GEOMETRY, truth.blocked(), sigma=0.15, outliers=0.1, span=LONGEST, trust=0.25)
    bearings = np.linspace(-math.pi, math.pi, 36, endpoint=False)
    scan = measured(truth, pose, bearings, rng)
    north, east = (axis.ravel() for axis in np.meshgrid(*GEOMETRY.centres(), indexing="ij"))
    particles = ParticleSet(("north", "east", "heading"), north.size)
    particles.count = north.size
    particles.columns[:] = north, east, np.full(north.size, pose.heading)
    sensor.weigh(particles, 0, particles.count, ScanMeasurement.of(scan))
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.5), layout="constrained", sharey=True)
    distance = sensor.field[1:-1, 1:-1]
    image = left.imshow(distance, cmap="cividis", origin="lower", extent=EXTENT, vmax=2.0)
    figure.colorbar(image, ax=left, location="bottom", label="distance to the nearest obstacle, m")
    hits = scan.hits
    angle = pose.heading + scan.bearings[hits]
    left.plot(
        pose.east + scan.ranges[hits] * np.sin(angle),
        pose.north + scan.ranges[hits] * np.cos(angle),
        ".",
        color="white",
        markersize=4,
    )
    log_weights = particles.log_weights.reshape(GEOMETRY.shape)
    image = right.imshow(
        log_weights - log_weights.max(), cmap="cividis", origin="lower", extent=EXTENT, vmin=-15
    )
    figure.colorbar(
        image, ax=right, location="bottom", label="log likelihood of the scan, relative to the best"
    )
    for axis, title in ((left, "field; white: the scan's hits"), (right, "places, with the right heading")):
        axis.plot(pose.east, pose.north, "x", color=RED, markersize=7, markeredgewidth=2)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("east, m")
    left.set_ylabel("north, m")
    return figure


FIGURES = {"building": mapped, "field": field}
STYLE = {
    "axes.grid": False,
    "axes.spines.top": True,
    "axes.spines.right": True,
    "axes.axisbelow": "line",
    "grid.color": "#b0b0b0",
    "image.interpolation": "nearest",
}
