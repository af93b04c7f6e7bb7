"""An artist's own file without a window: its blood baked anew, its frames rendered as its scene says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy

from ..domain.errors import InputError, nearest
from .bake import RECORD, bake_blood, bake_state
from .blood import blood_properties
from .colour import follow_working_space, strange_images
from .migration import bring_up_to_date, newer
from .operators import controls_of, emotion_bone
from .osl import has_scripts, missing_osl
from .render import quiet, save_render


# How a .blend begins: plain, compressed since Blender 3.0, compressed before.
_MAGIC = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")


class SceneFile:
    """Implements `app.scene_files.Scene` with the file that is opened in its place. use_scripts stays off: a file from
    elsewhere runs nothing here."""

    version = bpy.app.version_string

    def __init__(self, path: str, scene: str = "") -> None:
        """Opens a .blend. Raises InputError for what is no such file, and for a scene that is not in it."""
        with open(path, "rb") as file:
            if not file.read(7).startswith(_MAGIC):
                raise InputError(f"{path}: not a .blend file")
        try:
            with quiet():
                bpy.ops.wm.open_mainfile(filepath=str(Path(path).resolve()), load_ui=False, use_scripts=False)
        except RuntimeError as error:
            raise InputError(f"{path}: Blender cannot open it: {' '.join(str(error).split())}") from None
        if scene and scene not in bpy.data.scenes:
            raise InputError(f"{path}: --scene: no scene '{scene}', {nearest(scene, bpy.data.scenes.keys())}")
        self.path = path
        self.scene = bpy.data.scenes[scene] if scene else bpy.context.scene
        if bpy.context.window is not None:
            bpy.context.window.scene = self.scene

    @property
    def frames(self) -> range:
        return range(self.scene.frame_start, self.scene.frame_end + 1, self.scene.frame_step)

    def prepare(self, progress: Callable[[int, int], bool] | None = None) -> list[str]:
        """Brings faces of older versions up to date and solves the tables that were made for another working space than the
        file's. Returns what was done, a line each.

        A skin stays as it was made: a farm renders what the artist saw, and a new one may look a little different.
        """
        aged = self._bring_up_to_date()
        strange = strange_images()
        notes = follow_working_space(strange, progress)
        if len(strange) > len(notes):
            notes.append(f"{len(strange) - len(notes)} skins solved for the file's working space, which has changed since")
        return aged + notes

    def _bring_up_to_date(self) -> list[str]:
        lines = []
        for face in self.scene.objects:
            if face.type != "MESH" or face.library is not None:
                continue
            if why := newer(face):
                lines.append(f"{why}; its skin stays as it is")
            elif done := bring_up_to_date(face):
                lines.append(f"{done[0]}: its settings are brought up to date, its skin stays as it was made until Apply Skin")
        return lines

    def stale(self) -> dict[str, str]:
        """Face -> why its blood is not what the animation asks for; "" where it is."""
        found = {}
        for face, rig in self._faces():
            state = bake_state(face, rig, self.scene)
            found[face.name] = state.stale if state.baked else "it is not baked"
        return found

    def bake(self, progress: Callable[[int, int], bool] | None = None) -> dict[str, tuple[int, int]]:
        """Bakes the blood of every face. Returns face -> first and last frame. Raises InputError for one that cannot be."""
        return {face.name: bake_blood(face, rig, self.scene, progress) for face, rig in self._faces()}

    def save(self, path: Path) -> None:
        path.unlink(missing_ok=True)  # else Blender keeps the empty file of this name as a backup
        with quiet():
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, relative_remap=True, check_existing=False)

    def render(self, frame: int, png: Path, exr: Path) -> None:
        if self.scene.render.engine == "CYCLES" and has_scripts() and (why := missing_osl()) and self._faces():
            raise InputError(f"{self.path}: its skin is made of OSL, and {why}: apply it with shading NODES")
        with quiet():
            self.scene.frame_set(frame)
            bpy.ops.render.render(scene=self.scene.name)
            save_render(self.scene, png, "PNG")
            save_render(self.scene, exr, "OPEN_EXR")

    def _faces(self) -> list[tuple[bpy.types.Object, bpy.types.Object]]:
        faces = []
        for face in self.scene.objects:
            if face.type != "MESH" or not (RECORD in face or blood_properties(face)):
                continue
            if face.library is not None:
                raise InputError(f"{self.path}: {face.name}: linked without an override, so its blood cannot be baked")
            if why := newer(face):
                raise InputError(f"{self.path}: {why}")
            if emotion_bone(face) is None:
                raise InputError(f"{self.path}: {face.name}: the rig that moves its blood is gone: parent it to its rig again")
            faces.append((face, controls_of(face)))
        return faces
