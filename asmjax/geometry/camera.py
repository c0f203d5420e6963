"""The eye: a pinhole camera and its pixel grid."""

import equinox as eqx
import numpy as np

from asmjax.errors import require
from asmjax.geometry.basis import unit
from asmjax.numerics import scalar


class Camera(eqx.Module):
    """A pinhole camera; see `asmjax.geometry` for the axes.

    Attributes:
        origin: (3,) float64, world, scene units.
        rotation: (3, 3) float64, rows are the world directions image right, image down, forward.
        focal: (2,) float64, pixels: distance of the image plane in pixel widths and heights.
        principal: (2,) float64, pixels: where the forward axis meets the image.
        near, far: () float64, axial distances, scene units; nothing outside them is seen.
        width, height: pixels.
    """

    origin: np.ndarray
    rotation: np.ndarray
    focal: np.ndarray
    principal: np.ndarray
    near: np.ndarray = eqx.field(converter=scalar)
    far: np.ndarray = eqx.field(converter=scalar)
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)

    def directions(self, columns, rows) -> np.ndarray:
        """World ray directions (3, n) through pixel coordinates, with an axial component of 1.

        A hit at ray parameter t is at axial depth t. Pixel centres are at +0.5.
        """
        x = (np.asarray(columns, np.float64) - self.principal[0]) / self.focal[0]
        y = (np.asarray(rows, np.float64) - self.principal[1]) / self.focal[1]
        right, down, forward = self.rotation
        return right[:, None] * x + down[:, None] * y + forward[:, None]

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """Column and row coordinates (n,) of all pixel centres, row by row from the top."""
        columns = np.tile(np.arange(self.width) + 0.5, self.height)
        rows = np.repeat(np.arange(self.height) + 0.5, self.width)
        return columns, rows


def look_at(
    origin,
    target,
    up=(0.0, 0.0, 1.0),
    *,
    fov_x_deg: float,
    width: int,
    height: int,
    near: float = 1e-4,
    far: float = float("inf"),
    principal_point: tuple[float, float] = (0.0, 0.0),
    mirrored: bool = False,
) -> Camera:
    """A camera at `origin` that looks at `target` with square pixels.

    `fov_x_deg` spans the image width. `principal_point` shifts the axis as a fraction of the
    image size. `mirrored` flips left and right. Raises `UseError` where `up` is parallel to the
    view direction or the view has no direction.
    """
    origin = np.asarray(origin, np.float64)
    forward = unit(np.asarray(target, np.float64) - origin)
    sideways = np.cross(forward, unit(up))
    require(
        bool(np.linalg.norm(sideways) > 1e-9),
        f"the up vector {tuple(up)} is parallel to the view direction; choose another one.",
    )
    right = unit(sideways)
    down = np.cross(forward, right)
    focal = 0.5 * width / np.tan(np.radians(fov_x_deg) / 2)
    principal = np.array([width * (0.5 + principal_point[0]), height * (0.5 + principal_point[1])])
    rotation = np.stack([-right if mirrored else right, down, forward])
    return Camera(
        origin=origin,
        rotation=rotation,
        focal=np.array([focal, focal]),
        principal=principal,
        near=near,
        far=far,
        width=width,
        height=height,
    )
