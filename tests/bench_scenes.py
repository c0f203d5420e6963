"""Benchmarks of built-in scenes; `make bench` runs them.

Listing them answers a command line at once, building one is no wait beside rendering it, and twelve
million triangles take seconds: a loop over triangles would take minutes.
"""

import pytest

from asmjax.scene import builtin, paper_room, plant, surface

TWELVE_MILLION = 12_000_000


def test_listing(benchmark):
    items = benchmark(builtin.list_scenes)
    assert [item.name for item in items] == list(builtin.BUILTIN)


def test_paper_room(benchmark):
    assert benchmark(paper_room.make_paper_room).triangles > 0


@pytest.mark.parametrize("make", [plant.make_plant, surface.make_surface])
def test_twelve_million_triangles(benchmark, make):
    scene = benchmark.pedantic(make, args=(TWELVE_MILLION,), rounds=3)
    assert scene.triangles == pytest.approx(TWELVE_MILLION, rel=1e-3)
