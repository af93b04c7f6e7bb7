"""The batch's port to Blender: a subject's scene in an empty file, posed and rendered with Cycles."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import bpy

from ..app.skin_maps import Tiles
from ..domain.blood import BLOOD_CONTROL
from ..domain.errors import InputError, nearest
from ..domain.effects.regions import FACE_REGIONS
from ..domain.plan import Plan
from ..domain.shot import Image, Pose, Shot, Subject
from .controls import CONTROLS, set_controls
from .face import add_face
from .skin import apply_skin
from .stage import LIGHTS, set_stage


class BlenderRenderer:
    """Implements `app.batch.Renderer`."""

    _rig: bpy.types.Object

    def regions(self, subject: Subject) -> tuple[str, ...]:
        return FACE_REGIONS

    def prepare(self, shot: Shot, subject: Subject, plan: Plan, images: Mapping[str, Tiles]) -> None:
        with quiet():
            # Not the factory's preferences: inside Blender they would switch off the add-on that is running.
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            scene = bpy.context.scene
            face = add_face(subject.rig.head)
            set_stage(
                scene,
                **face.stage_landmarks,
                size=(shot.image.width, shot.image.height),
                lens_mm=shot.camera.focal_mm,
                turn_deg=shot.camera.yaw_degrees,
                lights=tuple(replace(light, power=light.power * shot.light.strength) for light in LIGHTS),
            )
            set_image(scene, shot.image, plan.settings.samples)
            apply_skin(face.skin, face.rig, plan, given=images)
        self._rig = face.rig

    def render(self, pose: Pose, frame: int, png: Path, exr: Path) -> None:
        scene = bpy.context.scene
        scene.frame_set(frame)
        values = dict.fromkeys(CONTROLS, 0.0)
        values |= pose.emotions | pose.action_units | {BLOOD_CONTROL: pose.blood}
        set_controls(self._rig, values)
        with quiet():
            bpy.ops.render.render()
            save_render(scene, png, "PNG")
            save_render(scene, exr, "OPEN_EXR")


def set_image(scene: bpy.types.Scene, image: Image, samples: int) -> None:
    """Size, samples and view of a shot. Raises InputError for a view transform that this Blender has not."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = image.width, image.height, 100
    cycles.device = "CPU"
    cycles.shading_system = True  # OSL
    cycles.samples = samples
    cycles.seed = image.seed
    cycles.use_denoising = image.denoise
    # Fixed samples: the same frame is the same picture on every machine of a farm.
    cycles.use_adaptive_sampling = False
    render.use_persistent_data = True  # one subject, many poses
    if image.view_transform:
        try:
            scene.view_settings.view_transform = image.view_transform
        except TypeError as error:
            # The list depends on the colour configuration; only this message has it.
            known = re.findall(r"'([^']+)'", str(error).partition(" in ")[2])
            raise InputError(
                f"image.view_transform: {image.view_transform!r} is not in this Blender, "
                f"{nearest(image.view_transform, known)}"
            ) from None


def save_render(scene: bpy.types.Scene, path: Path, file_format: str) -> None:
    """The last render as a file: PNG as it is displayed, OPEN_EXR linear 32-bit."""
    settings = scene.render.image_settings
    settings.file_format = file_format
    settings.color_mode = "RGB"
    settings.color_depth = "32" if file_format == "OPEN_EXR" else "8"
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keeps Blender's chatter, which is printed by C code, off standard output; shows it when something fails."""
    sys.stdout.flush()
    stdout = os.dup(1)
    with tempfile.TemporaryFile() as log:
        os.dup2(log.fileno(), 1)
        try:
            yield
        except InputError:
            raise  # one line says it all
        except BaseException:
            sys.stdout.flush()
            log.seek(0)
            sys.stderr.buffer.write(log.read())
            raise
        finally:
            sys.stdout.flush()
            os.dup2(stdout, 1)
            os.close(stdout)
