"""The native module and Blender in one process: two sets of image libraries that must not see each other."""

import subprocess
import sys

import pytest

SCRIPT = """
import sys
for name in {order!r}:
    __import__(name)
import bpy, numpy, sanguine_core
pixels = numpy.linspace(0, 1, 48, dtype=numpy.float32).reshape(4, 4, 3)
path = {folder!r} + "/map.exr"
sanguine_core.write_exr_map(path, pixels, ["B", "G", "R"], {{}}, half=False)
numpy.testing.assert_array_equal(sanguine_core.read_exr_map(path)[0], pixels)
numpy.testing.assert_array_equal(sanguine_core.read_image(path), pixels[..., ::-1])

# Blender reads what we wrote, rows in the same order.
image = bpy.data.images.load(path)
image.colorspace_settings.is_data = True
seen = numpy.array(image.pixels[:], dtype=numpy.float32).reshape(4, 4, 4)[..., :3]
numpy.testing.assert_allclose(seen, pixels[..., ::-1], atol=1e-6)

# Blender's own modules are still the ones that are found; none of ours is in their way. (4.2 carries none.)
if bpy.app.version >= (4, 5, 0):
    python = "python%d.%d" % sys.version_info[:2]
    sys.path.append(bpy.utils.resource_path("LOCAL") + "/python/lib/" + python + "/site-packages")
    import OpenImageIO, oslquery
    assert "bpy" in OpenImageIO.__file__, OpenImageIO.__file__
print("whole")
"""


@pytest.mark.parametrize("order", [("sanguine_core", "bpy"), ("bpy", "sanguine_core")], ids="-then-".join)
def test_either_import_order_works(tmp_path, order):
    script = SCRIPT.format(order=order, folder=str(tmp_path))
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert result.stdout.rstrip().endswith("whole"), result.stderr
    assert result.returncode == 0
