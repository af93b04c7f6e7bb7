"""The batch's port to Blender: a subject's scene in an empty file, posed and rendered with Cycles."""

from __future__ import annotations

import contextlib
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import bpy

from ..app.skin_maps import Tiles
from ..domain.blood import blood_property
from ..domain.errors import InputError, nearest
from ..domain.effects.regions import FACE_REGIONS
from ..domain.plan import Plan
from ..domain.shot import Image, Performance, Pose, Shot, Subject, Timeline, feelings_of, performance, pose_at
from .bake import write_blood
from .blood import set_profile
from .controls import CONTROL_BONE, CONTROLS, set_controls
from .curves import action_curve, ensure_action, set_keys
from .face import Face, add_face
from .skin import apply_skin
from .stage import LIGHTS, set_stage


class BlenderRenderer:
    """Implements `app.batch.Renderer`."""

    version = bpy.app.version_string
    _rig: bpy.types.Object
    # Whether the scene is animated, or posed anew for each picture.
    _plays: bool

    def regions(self, subject: Subject) -> tuple[str, ...]:
        return FACE_REGIONS

    def prepare(self, shot: Shot, subject: Subject, plan: Plan, images: Mapping[str, Tiles]) -> None:
        with quiet():
            # Not the factory's preferences: inside Blender they would switch off the add-on that is running.
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            scene = bpy.context.scene
            face = add_face(subject.rig.head, *feelings_of(shot))
            set_stage(
                scene,
                **face.stage_landmarks,
                size=(shot.image.width, shot.image.height),
                lens_mm=shot.camera.focal_mm,
                turn_deg=shot.camera.yaw_degrees,
                lights=tuple(replace(light, power=light.power * shot.light.strength) for light in LIGHTS),
            )
            set_image(scene, shot.image, plan.settings.samples)
            set_profile(face.rig, shot.profile)
            apply_skin(face.skin, face.rig, plan, given=images, shading=shot.image.material.upper())
            played = performance(shot)
            if played is not None:
                scene.frame_start, scene.frame_end = shot.timeline.first, shot.timeline.last
                scene.render.fps, scene.render.fps_base = _rate(shot.timeline.fps)
                _play(face, shot.timeline, played)
        self._rig, self._plays = face.rig, played is not None

    def render(self, pose: Pose, frame: int, png: Path, exr: Path) -> None:
        scene = bpy.context.scene
        if self._plays:
            scene.frame_set(frame)
        else:
            bone = self._rig.pose.bones[CONTROL_BONE]
            set_controls(self._rig, {name: pose.controls.get(name, 0.0) for name in CONTROLS if name in bone})
        with quiet():
            bpy.ops.render.render()
            save_render(scene, png, "PNG")
            save_render(scene, exr, "OPEN_EXR")


    def save(self, blend: Path) -> None:
        with quiet():
            bpy.context.scene.frame_set(bpy.context.scene.frame_start)
            blend.unlink(missing_ok=True)  # else Blender keeps the empty file of this name as a backup
            bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True, compress=True, check_existing=False)


def _play(face: Face, timeline: Timeline, played: Performance) -> None:
    """Keys the sliders as the timeline does and the blood frame by frame: the scene then plays, and renders, by itself."""
    ensure_action(face.rig, "timeline")
    keys = {key.frame: pose_at(timeline, key.frame).controls for key in timeline.sorted_keys}
    for name in (name for name in played.controls if name in CONTROLS):
        curve = action_curve(face.rig, f'pose.bones["{CONTROL_BONE}"]["{name}"]', group="Sanguine")
        set_keys(curve, list(keys), [controls.get(name, 0.0) for controls in keys.values()])
    write_blood(face.skin, played.frames, {blood_property(q, region): c for (region, q), c in played.changes.items()})


def _rate(fps: float) -> tuple[int, float]:
    """Blender's frame rate: a whole number over a base."""
    whole = max(1, math.ceil(fps))
    return whole, whole / fps


def set_image(scene: bpy.types.Scene, image: Image, samples: int) -> None:
    """Size, samples and view of a shot. Raises InputError for a view transform that this Blender has not."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = image.width, image.height, 100
    cycles.device = "CPU"
    cycles.shading_system = False  # a skin of OSL sets it
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
