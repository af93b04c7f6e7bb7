"""nanobind counts what is still alive when the interpreter ends, and says so: it must have nothing to say."""

import subprocess
import sys

SCRIPT = """
import numpy, sanguine_core
pixels = sanguine_core.rasterize_uv(
    numpy.array([[0, 0], [1, 0], [0, 1]], numpy.float32), numpy.array([[0, 1, 2]], numpy.int32),
    numpy.ones((3, 1), numpy.float32), 8, 8, 0, numpy.zeros(1, numpy.float32))
view = pixels[2:, 2:]
del pixels
assert view.max() == 1
surface = sanguine_core.SkinSurface(
    numpy.array([[0, 0, 0], [9, 0, 0], [0, 0, 9]], numpy.float32), numpy.array([[0, 0], [1, 0], [0, 1]], numpy.float32),
    numpy.array([[0, 1, 2]], numpy.int32), numpy.arange(3, dtype=numpy.int32), [], numpy.zeros((3, 0), numpy.float32))
texels = surface.texels(8, 8, 0)
layer = sanguine_core.grow("pores", surface, texels, 1, 30.0, 0.5, 0.0, progress=lambda done, total: True)
place = texels.place_mm
del texels
assert place.max() <= 9 and len(layer) == len(place)
try:
    sanguine_core.grow("absent", surface, surface.texels(8, 8, 0), 1, 30.0, 0.5, 0.0)
except ValueError:
    pass
with sanguine_core.MapWriter("a.exr", 4, 2, ["melanin"], {}) as writer:
    writer.write_rows(numpy.zeros((2, 4, 1), numpy.float32))
reader = sanguine_core.RowReader("a.exr")
rows = reader.read_rows(0, 1)
unfinished = sanguine_core.MapWriter("b.exr", 4, 2, ["melanin"], {})
try:
    sanguine_core.read_image("absent.png")
except sanguine_core.ImageError:
    pass
"""


def test_nothing_leaks(tmp_path):
    result = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, cwd=tmp_path)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
