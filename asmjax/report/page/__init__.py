"""One HTML page of one or more folders of results: words, charts, pictures, tables, provenance.

Each kind of folder has a section of its own (`sections`); `folder` reads and checks, `markup`
escapes, `page` puts together. Nothing here loads JAX or the renderer.
"""

from asmjax.report.page.folder import Results, read_results
from asmjax.report.page.page import page_of, write_page
from asmjax.report.page.part import Part
from asmjax.report.page.sections import SECTIONS

__all__ = ["SECTIONS", "Part", "Results", "page_of", "read_results", "write_page"]
