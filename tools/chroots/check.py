"""One check of `make chroots`, inside Blender or its module: check.py STAGE. Its last line, SAID …, is what it found."""

import json
import math
import sys
import time
from pathlib import Path

import bpy

HERE = Path(__file__).resolve().parent
OUT = HERE / "out"
ADDON = "bl_ext.user_default.sanguine"
ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
SIZE, SAMPLES = 64, 16
# The same wheel, with another C library's exp and log: a few units in the last place, and sums of hundreds of them.
SAME = 1e-9

OSL = """
shader check(float amount = 0.25, color tint = color(0.5), output color shown = color(0.0)) { shown = amount * tint; }
"""


def blender_packages() -> None:
    """Makes `import oslquery` mean Blender's own: a full Blender has it on its path, the module beside it."""
    folder = Path(bpy.utils.resource_path("LOCAL")) / "python/lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    if folder.is_dir() and str(folder) not in sys.path:
        sys.path.append(str(folder))


def factory() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert "sanguine_core" not in sys.modules


def enable() -> None:
    assert bpy.ops.preferences.addon_enable(module=ADDON) == {"FINISHED"}
    assert ADDON in bpy.context.preferences.addons


def solve() -> str:
    """The verb `skin`, from the installed zip, against the same verb outside."""
    from bl_ext.user_default.sanguine.cli.main import main

    assert main(["skin", str(HERE / "skins.json"), "--out", str(OUT / "skins.json")]) == 0
    here, outside = (json.loads(path.read_text())["results"] for path in (OUT / "skins.json", HERE / "expected.json"))
    worst = 0.0
    for mine, other in zip(here, outside, strict=True):
        for a, b in zip(mine["reflectance"], other["reflectance"], strict=True):
            assert 0.0 < a < 1.0
            worst = max(worst, abs(a - b))
    assert worst <= SAME, worst
    return "bit for bit" if worst == 0.0 else f"to {worst:.0e}"


def libraries() -> str:
    """Every shared library that came with the native module is the wheel's own, in the user's folder."""
    factory()
    before = mapped()
    enable()
    solve()
    import sanguine_core

    folder = str(Path(sanguine_core.__file__).parents[1])
    assert folder.startswith(str(Path.home())), folder
    new = mapped() - before
    ours = {path for path in new if path.startswith(folder)}
    images = {path for path in new if any(word in path.lower() for word in ("openimageio", "openexr", "imath"))}
    assert images and images <= ours, sorted(images - ours)
    return f"{len(ours)} of the wheels', {len(new - ours)} of the system's"


def mapped() -> set[str]:
    lines = Path("/proc/self/maps").read_text().splitlines()
    return {line.split(maxsplit=5)[-1] for line in lines if ".so" in line}


def blender_own() -> str:
    """Blender's OpenImageIO writes and reads a picture, its oslquery reads a compiled shader, a script node gets sockets."""
    import importlib.util

    blender_packages()
    import _cycles

    if importlib.util.find_spec("OpenImageIO") is None and importlib.util.find_spec("oslquery") is None:
        assert not _cycles.with_osl
        return "this Blender has neither"
    import OpenImageIO as oiio
    import oslquery

    assert Path(oiio.__file__).is_relative_to(Path(bpy.utils.resource_path("LOCAL"))), oiio.__file__
    path = str(OUT / "blenders.exr")
    spec = oiio.ImageSpec(4, 2, 3, "float")
    writer = oiio.ImageOutput.create(path)
    assert writer.open(path, spec) and writer.write_image(__import__("numpy").full((2, 4, 3), 0.25, "f4"))
    writer.close()
    assert float(oiio.ImageInput.open(path).read_image(format="float")[1, 2, 0]) == 0.25
    source, compiled = OUT / "check.osl", OUT / "check.oso"
    source.write_text(OSL)
    assert _cycles.osl_compile(str(source), str(compiled))
    assert [parameter.name for parameter in oslquery.OSLQuery(str(compiled))] == ["amount", "tint", "shown"]
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.shading_system = True
    material = bpy.data.materials.new("check")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeScript")
    text = bpy.data.texts.new("check")
    text.from_string(OSL)
    node.mode, node.script = "INTERNAL", text
    assert [socket.name for socket in node.inputs] == ["amount", "tint"], [socket.name for socket in node.inputs]
    return f"OpenImageIO {oiio.VERSION_STRING}"


def install() -> str:
    done = bpy.ops.extensions.package_install_files(filepath=ARGUMENTS[1], repo="user_default", enable_on_install=True)
    assert done == {"FINISHED"} and ADDON in bpy.context.preferences.addons
    return "installed"


def after() -> str:
    factory()
    enable()
    solve()
    return blender_own()


def before() -> str:
    factory()
    said = blender_own()
    enable()
    solve()
    assert blender_own() == said
    return said


def head() -> str:
    factory()
    enable()
    started = time.monotonic()
    assert bpy.ops.sanguine.add_head(head="male") == {"FINISHED"}
    keys = bpy.context.object.data.shape_keys.key_blocks
    assert len(keys) > 52
    return f"{len(keys) - 1} keys, {time.monotonic() - started:.1f} s"


def face() -> str:
    """A character that has nothing of ours: adopted, and rendered calm and angry."""
    factory()
    bpy.ops.wm.open_mainfile(filepath=str(HERE / "character.blend"))
    enable()
    blender_packages()  # Cycles asks oslquery for the sockets of a script
    started = time.monotonic()
    assert bpy.ops.sanguine.adopt() == {"FINISHED"}
    adopted = time.monotonic() - started
    obj, scene = bpy.context.object, bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.cycles.samples = SAMPLES
    (red, green, blue), calm_s = render("calm")
    assert 0.05 < blue < red and green < red < 1.0, (red, green, blue)
    obj.parent.pose.bones["sanguine"]["anger"] = 1.0
    obj.parent.update_tag()
    bpy.context.view_layer.update()
    (hot_red, hot_green, _), hot_s = render("angry")
    assert math.isfinite(hot_red) and hot_green / hot_red < 0.97 * green / red, "more blood takes green before red"
    return f"{adopted:.1f} s, {calm_s:.1f} s; green/red {green / red:.2f}, angry {hot_green / hot_red:.2f}"


def render(name: str) -> tuple[tuple[float, float, float], float]:
    """Mean linear colour of the cheeks' height, and the seconds."""
    import numpy as np

    scene, path = bpy.context.scene, OUT / f"{name}.exr"
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path)
    started = time.monotonic()
    bpy.ops.render.render(write_still=True)
    seconds = time.monotonic() - started
    settings.file_format, settings.color_depth = "PNG", "8"
    bpy.data.images["Render Result"].save_render(str(path.with_suffix(".png")), scene=scene)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(SIZE * SIZE * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    rows = slice(SIZE * 5 // 16, SIZE // 2)
    red, green, blue = (float(x) for x in pixels.reshape(SIZE, SIZE, 4)[rows, SIZE * 5 // 16 : SIZE * 11 // 16, :3].mean((0, 1)))
    return (red, green, blue), seconds


def again() -> str:
    factory()
    enable()
    assert bpy.ops.preferences.addon_disable(module=ADDON) == {"FINISHED"}
    assert not hasattr(bpy.types.Object, "sanguine") and "adopt" not in dir(bpy.ops.sanguine)
    enable()
    assert hasattr(bpy.types.Object, "sanguine") and "adopt" in dir(bpy.ops.sanguine)
    return "nothing stays registered"


STAGES = {function.__name__: function for function in (install, libraries, after, before, head, face, again)}


def main() -> None:
    stage = ARGUMENTS[0]
    if stage == "solve":
        factory()
        enable()
        said = solve()
    else:
        said = STAGES[stage]()
    if stage != "install":
        bpy.ops.preferences.addon_disable(module=ADDON)  # left registered, its classes crash `bpy` on the way out
    print(f"SAID {said}", flush=True)


main()
