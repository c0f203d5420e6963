"""Looking at a light, no closer than its decision needs.

A light below the tolerance gets no ray, a light without size no search for blockers, and an opaque
scene no rays through casters.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from asmjax.buffers import LightRays
from asmjax.effects import probe, widths
from asmjax.effects.asked import LightAsked, SceneAsked
from asmjax.effects.decide import left_out
from asmjax.effects.plan import LightSeen
from asmjax.effects.records import LightNumbers
from asmjax.geometry import SUN_DEG, AreaLight, LightFrame, sun_light


def look_at_light(
    asked: SceneAsked,
    light: LightAsked,
    paths: probe.Paths | None,
    part: np.ndarray,
    tolerance: float,
    force: str | None,
) -> tuple[LightNumbers, LightSeen]:
    """What is known of a light.

    Args:
        paths: from the light to the probe's pixels; None where it has no frame.
        part: (n,) of the light at each pixel that comes from here, where nothing shades it.
        tolerance, force: as of `asmjax.effects.decide.decide_light`.
    """
    frame, spec = light.frame, light.spec
    valid, size = asked.eye.valid, asked.eye.size
    pixels = round(float(valid.mean()) * asked.view.width * asked.view.height)
    if paths is None or frame is None or not paths.reached.any():
        nothing = np.zeros(size)
        known = LightNumbers(spec.name, spec.kind, share=0.0, facing=0.0, faces=0, pixels=pixels)
        return known, LightSeen(spec.name, nothing > 0, nothing)
    known = LightNumbers(
        name=spec.name,
        kind=spec.kind,
        shape=None if frame.area is None else frame.area.shape,
        share=min(float(part[valid].mean()), 1.0),
        facing=float(paths.reached[valid].mean()),
        straddled=float(paths.straddled[valid].mean()),
        faces=frame.faces,
        fov_deg=_field_of_view(frame) if frame.perspective else None,
        pixels=pixels,
        solid_angle=probe.solid_angle(frame, paths),
        lone_convex=asked.lone_convex,
        point_for_lamp=light.stand_in is not None,
        spread=light.spread,
    )
    seen = LightSeen(spec.name, paths.facing.reshape(size), paths.cosine.reshape(size))
    # Where its centre shines on nothing there is no hard shadow to look at.
    if left_out(known, tolerance, force) is not None or not paths.facing.any():
        return known, seen
    stand_in = light.stand_in
    if not frame.perspective:
        stand_in = sun_light(frame.rotation[0, 2], math.radians(SUN_DEG))
    return _Closer(asked, frame, paths, part, light.rays(), stand_in).look(known, seen)


@dataclass(frozen=True, eq=False)
class _Closer:
    """A light that gets a shadow, and what casts its rays."""

    asked: SceneAsked
    frame: LightFrame
    paths: probe.Paths
    part: np.ndarray
    rays: LightRays
    stand_in: AreaLight | None

    def look(self, known: LightNumbers, seen: LightSeen) -> tuple[LightNumbers, LightSeen]:
        """The same with what rays tell."""
        asked, paths = self.asked, self.paths
        hard = probe.hard_look(paths, self.rays)
        shadowed = float((~hard.lit)[paths.facing].mean())
        known = replace(known, shadowed=shadowed, rays=hard.rays)
        seen = replace(seen, lit=hard.lit.reshape(asked.eye.size))
        if not asked.materials.opaque:
            known = self._through(known, hard)
        if self.frame.area is not None:
            return self._penumbra(known, seen, hard)
        return (known if self.stand_in is None else self._as_if(known, hard, self.stand_in)), seen

    def _through(self, known: LightNumbers, hard: probe.HardLook) -> LightNumbers:
        """With what passes through casters."""
        asked, valid = self.asked, self.asked.eye.valid
        through = probe.transmission(self.paths, hard, self.rays, asked.materials, asked.first_prim)
        return replace(
            known,
            transmitted=float((self.part * through.part)[valid].mean()),
            refracted=float((self.part * through.refracted)[valid].mean()),
            rays=known.rays + through.rays,
        )

    def _penumbra(
        self, known: LightNumbers, seen: LightSeen, hard: probe.HardLook
    ) -> tuple[LightNumbers, LightSeen]:
        """With how wide penumbrae are."""
        eye, frame, area = self.asked.eye, self.frame, self.frame.area
        assert area is not None
        ellipse = widths.light_ellipse(eye, area, self.paths, self.scale)
        blockers = widths.find_blockers(frame, self.rays)
        gaps = widths.widest_gaps(eye, frame, area, self.paths, blockers)
        bound = 2 * gaps * widths.widest(ellipse)
        edges = widths.shadow_edges(eye, self.paths, hard, self.scale)
        k = widths.gap_ratio(area, self.paths, hard.stop)
        if edges.dark.size:
            known = self._measured(known, widths.at_edges(ellipse, k, edges), edges)
            known = self._in_map(known, k, edges.dark)
        elif (bound > 0).any():
            # Nothing that the probe resolves: what may be there, as if all of it were penumbra.
            some = np.flatnonzero(bound)
            length = self.scale**2 * some.size / float(bound[some].mean())
            maybe = widths.Edges(some, some, np.zeros((2, some.size)), length)
            known = self._in_map(self._measured(known, bound[some], maybe), gaps, some)
        dark = self.paths.facing & ~hard.lit
        umbra = widths.umbra_share(eye, dark, edges, ellipse, k, self.scale)
        known = replace(known, rays=known.rays + blockers.rays, umbra=umbra)
        return known, replace(seen, widest=bound.reshape(eye.size))

    def _as_if(self, known: LightNumbers, hard: probe.HardLook, area: AreaLight) -> LightNumbers:
        """With the widths that penumbrae had if the light had that size: no ray more."""
        ellipse = widths.light_ellipse(self.asked.eye, area, self.paths, self.scale)
        edges = widths.shadow_edges(self.asked.eye, self.paths, hard, self.scale)
        k = widths.gap_ratio(area, self.paths, hard.stop)
        return self._measured(known, widths.at_edges(ellipse, k, edges), edges)

    def _measured(
        self, known: LightNumbers, found: np.ndarray, edges: widths.Edges
    ) -> LightNumbers:
        """With the widths `found` at the dark pixels beside `edges`."""
        if not found.size:
            return known
        p50, p95 = np.percentile(found, [50, 95])
        return replace(
            known,
            edge_px=edges.length,
            contrast=min(float(self.part[edges.dark].mean()), 1.0),
            width_p50=float(p50),
            width_p95=float(p95),
            width_mean=float(found.mean()),
        )

    def _in_map(self, known: LightNumbers, k: np.ndarray, beside: np.ndarray) -> LightNumbers:
        """With the width of the penumbrae at the pixels `beside` edges in the light's image."""
        assert self.frame.area is not None
        found = widths.width_in_map(self.frame, self.frame.area, self.paths, k)[beside]
        return replace(known, width_map=float(np.median(found)))

    @property
    def scale(self) -> float:
        """Pixels of the picture per pixel of the probe."""
        return self.asked.view.width / self.asked.eye.camera.width


def _field_of_view(frame: LightFrame) -> float:
    """Of the widest face, along its wider side, degrees."""
    ends = np.arctan(frame.corner + frame.extent) - np.arctan(frame.corner)
    return float(np.degrees(ends.max()))
