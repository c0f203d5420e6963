"""Light rays that count what they cast."""

from asmjax.buffers import ChartBuffer, LightBuffer, LightRays, TexelWindows
from asmjax.geometry import Charts, LightFrame


class CountingRays(LightRays):
    """Passes everything on to `inner`; counts launches and texels of light buffers."""

    def __init__(self, inner: LightRays):
        self.inner = inner
        self.launches = 0
        self.texels = 0
        self.windows: list[TexelWindows] = []

    def closest(self, origins, directions, t_min=0.0):
        return self.inner.closest(origins, directions, t_min)

    def occluded(self, origins, directions, t_max):
        return self.inner.occluded(origins, directions, t_max)

    def light_buffer(self, frame: LightFrame, windows: TexelWindows) -> LightBuffer:
        self.launches += 1
        self.texels += windows.texels
        self.windows.append(windows)
        return self.inner.light_buffer(frame, windows)

    def chart_buffer(self, frame: LightFrame, charts: Charts) -> ChartBuffer:
        self.launches += 1
        self.texels += charts.texels
        return self.inner.chart_buffer(frame, charts)
