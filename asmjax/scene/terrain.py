"""Real terrain under a low sun: the elevation model that ships with matplotlib's sample data.

`jacksboro_fault_dem.npz` holds 344 x 403 elevations in whole metres (236 to 1076) around the
Jacksboro fault, Tennessee, on a grid of 3 arc seconds; its first row is the north edge. Here x is
east, y north, z up, all in metres, with the origin at sea level below the middle of the map.
"""

import math

import numpy as np

from asmjax.scene.shapes import grid
from asmjax.scene.spec import LightSpec, SceneSpec, Vector, ViewSpec

TRIANGLES = 2 * 343 * 402
SUN_HEIGHT_DEG = 12.0
SUN_AZIMUTH_DEG = 292.0
"""Where the sun stands, clockwise from north: a late afternoon, across the ridges."""


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """Length in metres of one degree of longitude and of latitude (radians in, WGS 84 series)."""
    east = 111_412.84 * math.cos(latitude) - 93.5 * math.cos(3 * latitude)
    north = 111_132.92 - 559.82 * math.cos(2 * latitude) + 1.175 * math.cos(4 * latitude)
    return east, north


def elevation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eastings (columns,), northings (rows,), heights (rows, columns); metres, south row first."""
    # Only this scene needs matplotlib, and its import takes as long as the scene itself.
    from matplotlib.cbook import get_sample_data

    with np.load(str(get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))) as data:
        height = data["elevation"].astype(np.float64)[::-1]
        edges = [float(data[key]) for key in ("xmin", "xmax", "ymin", "ymax")]
    west, east = sorted(edges[:2])
    south, north = sorted(edges[2:])
    per_east, per_north = metres_per_degree(math.radians(0.5 * (south + north)))
    rows, columns = height.shape
    # Cells are centred half a cell inside the edges, and the map is centred on the origin.
    x = (np.arange(columns) + 0.5 - 0.5 * columns) * (east - west) / columns * per_east
    y = (np.arange(rows) + 0.5 - 0.5 * rows) * (north - south) / rows * per_north
    return x, y, height


def sun_direction(azimuth_deg: float, height_deg: float) -> Vector:
    """Unit direction in which the light of a sun at that place in the sky travels."""
    azimuth, height = math.radians(azimuth_deg), math.radians(height_deg)
    flat = math.cos(height)
    return (-math.sin(azimuth) * flat, -math.cos(azimuth) * flat, -math.sin(height))


def make_terrain() -> SceneSpec:
    """The height field with a low sun, one eye near the ground and one in the air."""
    x, y, height = elevation()
    views = (
        ViewSpec(
            "ground",
            origin=(7420.0, 7015.0, 642.0),
            target=(5360.0, 9195.0, 150.0),
            fov_x_deg=50.0,
            near=1.0,
        ),
        ViewSpec(
            "aerial",
            origin=(-3500.0, -14500.0, 4200.0),
            target=(-3500.0, -3500.0, 300.0),
            fov_x_deg=48.0,
            near=1.0,
        ),
    )
    sun = LightSpec("sun", "directional", direction=sun_direction(SUN_AZIMUTH_DEG, SUN_HEIGHT_DEG))
    return SceneSpec(
        "terrain",
        "real mountains (Jacksboro fault, Tennessee) under a low sun, seen from near the ground",
        (grid("ground", x, y, height, (0.52, 0.56, 0.36)),),
        {view.name: view for view in views},
        {sun.name: sun},
    )
