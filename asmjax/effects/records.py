"""What is known of a light, and what is decided about it: plain numbers and words."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["none", "hard", "soft", "transmittance"]


@dataclass(frozen=True)
class LightNumbers:
    """What a probe saw of one light. Parts "of the light" are of what all lights bring to a pixel
    where nothing shades them, mean over the pixels of the picture.

    Attributes:
        name: of the light.
        kind: "point", "spot" or "directional".
        shape: of its area, "rectangle", "disk", "sphere" or "sun"; None for a light without size.
        point_for_lamp: whether it is a point in place of a lamp of another shape, whose penumbrae
            are estimated as those of a sphere.
        spread: of its radiance over it, standard deviation in parts of the mean; None where its
            brightness is not known and taken for 1.
        share: part of the light that comes from here.
        facing: part of the pixels that it, or a part of it, shines on.
        straddled: part of the pixels in whose plane the light stands: a part of it is behind.
        faces: of its map.
        fov_deg: of the widest face, degrees; None for parallel light.
        pixels: of the picture that see a surface.
        shadowed: part of the pixels that its centre shines on that are in its hard shadow; None
            where nobody looked.
        edge_px: length of the hard shadow's edges, pixels.
        contrast: part of the light that comes from here, mean beside those edges.
        width_p50, width_p95, width_mean: of penumbrae across those edges, pixels; of parallel light
            those that it had if it were the sun's.
        width_map: of the same penumbrae in the light's image, parts of its side, median.
        umbra: part of the hard shadow's pixels that stay dark.
        solid_angle: steradians, median over what it shines on.
        transmitted: part of the light that comes from here through transmissive surfaces and media.
        refracted: part of the light that refractive surfaces keep from where it would go.
        lone_convex: whether one convex object is all there is.
        rays: that the probe cast for this light.
    """

    name: str
    kind: str
    shape: str | None = None
    point_for_lamp: bool = False
    spread: float | None = 0.0
    share: float = 1.0
    facing: float = 1.0
    straddled: float = 0.0
    faces: int = 1
    fov_deg: float | None = None
    pixels: int = 512 * 512
    shadowed: float | None = None
    edge_px: float = 0.0
    contrast: float = 1.0
    width_p50: float = 0.0
    width_p95: float = 0.0
    width_mean: float = 0.0
    width_map: float = 0.0
    umbra: float = 1.0
    solid_angle: float = 0.0
    transmitted: float = 0.0
    refracted: float = 0.0
    lone_convex: bool = False
    rays: int = 0

    @property
    def soft_error(self) -> float:
        """What hard edges in place of penumbrae would change, part of the light.

        A hard edge is off by 1/4 within a penumbra, mean, where that is a straight ramp, which a
        rectangle makes, and by 2 / (3 pi) where the light is round (A5 of docs/theory.md).
        """
        off = 0.25 if self.shape == "rectangle" else 2 / (3 * math.pi)
        return off * self.contrast * self.edge_px * self.width_mean / max(self.pixels, 1)

    @property
    def texture_error(self) -> float:
        """What an even radiance in place of its own changes in penumbrae, part of the light, at
        most: all of them where that is not known."""
        if self.shape is None:
            return 0.0
        return self.soft_error * (1.0 if self.spread is None else min(self.spread, 1.0))

    @property
    def large_error(self) -> float:
        """What visibility by area changes of a light that is very large, part of the light: both
        ways agree where a penumbra begins and ends, and differ by the cosines between (A3)."""
        return self.soft_error * min(1.0, self.solid_angle / (2 * math.pi))

    @property
    def shade(self) -> float:
        """What its hard shadow takes away, part of the light."""
        return self.share * (self.shadowed or 0.0)


@dataclass(frozen=True)
class Decision:
    """What is done about one effect of one light.

    Attributes:
        light: its name.
        kind: "none", "hard", "soft" or "transmittance".
        geometry: of the map, in words.
        faces: of the map, 0 where there is none.
        fov_deg: of its widest face, degrees; None for parallel light or no map.
        methods: families of the registry: the map, and what filters it.
        settings: of the methods: widths in parts of the map's side, numbers of samples and taps.
        samples: of the light, K; 1 is its centre.
        sample_error: largest error of visibility that so many leave, of sampling alone: texels come
            on top; 0 for other methods.
        quantity, number, threshold: what decided, in words, its value, and where the decision
            would become another.
        reason: in words.
        width_p50, width_p95: of penumbrae, pixels.
        error: what ignoring the effect would change, part of the light, mean over the picture.
        rays: that the methods cast, estimated.
        seconds: that they take, estimated.
        forced: whether somebody asked for it, and it is what was asked for.
        simulated: whether there is a method for it.
    """

    light: str
    kind: Kind
    geometry: str = "no map"
    faces: int = 0
    fov_deg: float | None = None
    methods: tuple[str, ...] = ()
    settings: Mapping[str, float] = field(default_factory=dict)
    samples: int = 1
    sample_error: float = 0.0
    quantity: str = ""
    number: float = 0.0
    threshold: float = 0.0
    reason: str = ""
    width_p50: float = 0.0
    width_p95: float = 0.0
    error: float = 0.0
    rays: int = 0
    seconds: float = 0.0
    forced: bool = False
    simulated: bool = True


@dataclass(frozen=True)
class Skipped:
    """An effect that is left out as it is not there or too small.

    Attributes:
        light: None for all of them.
        effect: in a word or two.
        reason: in words.
        error: what that changes, part of the light, mean over the picture.
    """

    light: str | None
    effect: str
    reason: str
    error: float = 0.0


@dataclass(frozen=True)
class NotSimulated:
    """An effect that the scene calls for and that is not simulated; attributes as `Skipped`."""

    light: str | None
    effect: str
    reason: str
    error: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """All about one light."""

    decisions: tuple[Decision, ...]
    skipped: tuple[Skipped, ...] = ()
    not_simulated: tuple[NotSimulated, ...] = ()


@dataclass(frozen=True)
class Rates:
    """What things take, seconds; by default as measured on two cores (docs/effects.md).

    Attributes:
        texel: of a map, cast.
        look_up: a pixel's place in a map, and whether it is lit by what stands there.
        tap: a further texel that a pixel reads beside its place.
        measured: whether `texel` is of this machine and scene.
    """

    texel: float = 1.2e-8
    look_up: float = 5e-8
    tap: float = 1.8e-8
    measured: bool = False

    def seconds(self, texels: int, pixels: int, look_ups: int, taps: int = 0) -> float:
        """What maps of `texels` in all take that each of `pixels` asks so often."""
        return texels * self.texel + pixels * (look_ups * self.look_up + taps * self.tap)


def percent(part: float) -> str:
    """0.25 as "25 %", with three digits."""
    value = 100 * part
    return f"{value:.3g} %" if value >= 0.001 or value == 0 else "less than 0.001 %"


def pixels(width: float) -> str:
    """3.25 as "3.2 px", 1234 as "1,234 px"."""
    return f"{width:.2g} px" if width < 10 else f"{width:,.0f} px"
