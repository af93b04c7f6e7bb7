"""The example head as a whole: its objects, its region masks as vertex groups, its sliders and their drivers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy

from ..app.faces import example_head
from ..domain.facs import DEFAULT_EMOTIONS
from ..domain.head import load_presets
from ..domain.resources import rigs_path
from .controls import add_controls, drive_head, drive_shape_keys
from .head import build_face
from .surface import store_regions


@dataclass(frozen=True)
class Face:
    """skin: the mesh that takes the material. rig: the armature with the controls."""

    skin: bpy.types.Object
    rig: bpy.types.Object
    landmarks: dict[str, tuple[float, float, float]]

    @property
    def stage_landmarks(self) -> dict[str, tuple[float, float, float]]:
        """What `stage.set_stage` frames the head by."""
        return {name: self.landmarks[name] for name in ("eyes", "chin", "crown")}


def add_face(head_id: str, emotions: Iterable[str] = DEFAULT_EMOTIONS, states: Iterable[str] = ()) -> Face:
    """Builds a head of `rigs/heads.toml` in the open scene, with sliders for these emotions and states of the body.

    Raises HeadError when its package is not installed.
    """
    head = example_head(head_id)
    objects = build_face(head, load_presets(rigs_path("heads.toml"))[head_id], bpy.data.materials.new("skin"))
    store_regions(objects.skin, head.regions)
    add_controls(objects.rig, emotions, states)
    drive_shape_keys(objects.rig, objects.parts.values())
    drive_head(objects.rig)
    landmarks = {name: tuple(float(x) for x in place) for name, place in head.landmarks.items()}
    return Face(objects.skin, objects.rig, landmarks)
