"""The section of `asmjax sweep` on the page of `asmjax report`: what the folder holds, in words,
charts and tables. Nothing here loads JAX."""

from asmjax.sweep.page.section import sweep_part

__all__ = ["sweep_part"]
