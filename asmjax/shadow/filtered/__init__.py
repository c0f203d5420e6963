"""Percentage-closer filtering of any shadow map: tests are averaged, never depths."""

from asmjax.shadow.filtered.pcf import KERNELS, FilteredShadowMap, FilteredState, Kernel

__all__ = ["KERNELS", "FilteredShadowMap", "FilteredState", "Kernel"]
