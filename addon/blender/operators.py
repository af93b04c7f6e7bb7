"""What the panel's buttons do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy
from mathutils import Matrix

from ..domain.effects import Frame, Scene
from ..domain.blood import BLOOD, PRESSURE_CONTROL
from ..domain.facs import DEFAULT_EMOTIONS
from ..domain.people import SEXES, TONES, person
from ..domain.plan import Plan, make_plan
from ..domain.shading import Choice, choose
from .albedo import read_picture
from ..domain.vascular import reach
from .blood import blood_model, blood_sliders
from .colour import follow_working_space, images_in, strange_images
from .controls import CONTROL_BONE, DriveReport, add_controls, drive_shape_keys
from .material import MARK
from .migration import bring_up_to_date, newer
from .osl import renderer_of
from .properties import growth_of, map_ranges_of, measure_maps, quality_of, set_person, skin_of, strengths_of, switched_off
from .removal import all_or_nothing, controls_of, mark_rig, nothing_left_behind, remember_keys
from .skin import apply_skin, our_slot, skin_slot
from .surface import face_regions, find_face_regions, has_pressure, has_shape_keys


def active_face(context: bpy.types.Context) -> bpy.types.Object | None:
    """The active mesh object, or the face that hangs on the active armature."""
    obj = context.active_object
    if obj is not None and obj.type == "ARMATURE":
        return next((child for child in obj.children if child.type == "MESH" and face_regions(child)), None)
    return obj if obj is not None and obj.type == "MESH" else None


def emotion_bone(face: bpy.types.Object) -> bpy.types.PoseBone | None:
    rig = controls_of(face)
    return rig.pose.bones.get(CONTROL_BONE) if rig is not None and rig.pose is not None else None


@contextmanager
def window_progress(context: bpy.types.Context) -> Iterator[Callable[[int, int], bool]]:
    """What is done and to do, shown at the mouse; the callback never asks to stop."""
    window = context.window_manager
    window.progress_begin(0, 1000)

    def progress(done: int, total: int) -> bool:
        window.progress_update(1000 * done // max(total, 1))
        return True

    try:
        yield progress
    finally:
        window.progress_end()


def live_plan(face: bpy.types.Object) -> Plan:
    """The plan while an artist works: every emotion on the rig may still be pulled, every skin slider moved."""
    bone = emotion_bone(face)
    sliders, blood = (blood_sliders(bone.id_data), blood_model(bone.id_data)) if bone is not None else (DEFAULT_EMOTIONS, BLOOD)
    return make_plan(
        Scene(
            skin=skin_of(face),
            frames=(Frame("live", dict.fromkeys(sliders, 1.0), changes=reach(sliders, blood)),),
            strengths=strengths_of(face),
            regions=face_regions(face),
            live=True,
            maps=map_ranges_of(face),
            growth=growth_of(face),
            shape_keys=has_shape_keys(face),
            pressure=has_pressure(face),
            presses=bone is not None and PRESSURE_CONTROL in bone,
            switched_off=switched_off(face),
        ),
        quality_of(face),
    )


def shading_of(scene: bpy.types.Scene, face: bpy.types.Object) -> Choice:
    """What the face's skin is to be made of, and why. Raises InputError where it cannot be."""
    return choose(face.sanguine.shading, renderer_of(scene))


def may_change(cls: type[bpy.types.Operator], face: bpy.types.Object | None) -> bool:
    if face is None:
        cls.poll_message_set("Select a face: a mesh object")
    elif face.library or face.data.library:
        cls.poll_message_set("The face is linked: make it local, or override its library, first")
    elif why := newer(face):
        cls.poll_message_set(why)
    else:
        return True
    return False


def tell_up_to_date(operator: bpy.types.Operator, face: bpy.types.Object) -> None:
    """Brings a face from an older version up to date, and says so."""
    for line in bring_up_to_date(face):
        operator.report({"INFO"}, line)


class SANGUINE_OT_apply_skin(bpy.types.Operator):
    bl_idname = "sanguine.apply_skin"
    bl_label = "Apply Skin"
    bl_description = "Give the active face a skin of blood and pigment, and sliders for its emotions"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave to object mode first")
            return False
        face = active_face(context)
        if not may_change(cls, face):
            return False
        if face.override_library:
            cls.poll_message_set("The face is a library override, which keeps no new skin: apply it in the file of the face")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        face = active_face(context)
        tell_up_to_date(self, face)
        context.view_layer.update()  # scales that a script has just set count too
        slot = skin_slot(face)
        try:
            with all_or_nothing(face, slot):
                rig = controls_of(face) or new_rig(context, face)
                driven = put_controls(rig, face)
                measure_maps(face)
                regions = find_face_regions(face)
                plan = live_plan(face)
                chosen = shading_of(context.scene, face)
                material = apply_skin(face, rig, plan, slot, shading=chosen.shading)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for line in driven.lines:
            self.report({"INFO"}, line)
        running = ", ".join(effect.label for effect in plan.active)
        done = f"{running}; {material[MARK]['entries']} skins solved; {len(driven.driven)} shape keys driven"
        self.report({"INFO"}, f"{done}; {regions}" if regions else done)
        self.report({"INFO"}, chosen.line)
        return {"FINISHED"}


def albedo_of(face: bpy.types.Object) -> bpy.types.Image | None:
    """The picture that colours the skin of a face: what leads to Base Color, else the only one in its material."""
    if not face.material_slots or (material := face.material_slots[skin_slot(face)].material) is None:
        return None
    nodes = material.node_tree.nodes if material.node_tree else ()
    shader = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    if shader is not None and (image := _image_behind(shader.inputs["Base Color"])) is not None:
        return image
    images = {node.image for node in nodes if node.type == "TEX_IMAGE" and node.image and not node.image.colorspace_settings.is_data}
    return images.pop() if len(images) == 1 else None


def _image_behind(socket: bpy.types.NodeSocket, depth: int = 8) -> bpy.types.Image | None:
    for link in socket.links if depth else ():
        if link.from_node.type == "TEX_IMAGE" and link.from_node.image:
            return link.from_node.image
        for behind in link.from_node.inputs:
            if (image := _image_behind(behind, depth - 1)) is not None:
                return image
    return None


SHADING = [
    ("auto", "Find Out", "Split off as much as pigment cannot explain"),
    ("off", "None", "The picture is an albedo: all that is dark in it is pigment or blood"),
    ("on", "Split Off", "The picture is a photograph: all slow changes of lightness are light"),
]
"""What to do about light that is baked into a picture."""


class SANGUINE_OT_read_picture(bpy.types.Operator):
    bl_idname = "sanguine.read_picture"
    bl_label = "Read Picture"
    bl_description = (
        "Read melanin, hemoglobin and oxygenation from a colour map of the active face, painted or photographed, saved or "
        "not. What is no skin in it (brows, make-up, shade) is kept as it looks"
    )
    bl_options = {"REGISTER", "UNDO"}

    image: bpy.props.StringProperty(
        name="Picture", description="The colour map; left empty, the one of the face's material"
    )
    shading: bpy.props.EnumProperty(
        name="Light in it",
        description="Light that is baked into the picture",
        items=SHADING,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return may_change(cls, active_face(context))

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self.image and (image := albedo_of(active_face(context))) is not None:
            self.image = image.name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop_search(self, "image", bpy.data, "images")
        self.layout.prop(self, "shading")

    def execute(self, context: bpy.types.Context) -> set[str]:
        face = active_face(context)
        tell_up_to_date(self, face)
        image = bpy.data.images.get(self.image) if self.image else albedo_of(face)
        if image is None:
            self.report({"ERROR"}, f"no picture '{self.image}'" if self.image else "the face's material has no picture: name one")
            return {"CANCELLED"}
        try:
            with nothing_left_behind():
                report = read_picture(face, image, self.shading)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{image.name}: {report}. Apply the skin to see it")
        return {"FINISHED"}


class SANGUINE_OT_draw_person(bpy.types.Operator):
    bl_idname = "sanguine.draw_person"
    bl_label = "Draw a Person"
    bl_description = (
        "Set the skin and what grows on it to those of an individual, drawn from measured faces of a tone. The panel's "
        "individual, age and sun are taken"
    )
    bl_options = {"REGISTER", "UNDO"}

    tone: bpy.props.EnumProperty(
        name="Tone",
        description="How light the face is; everything else is measured",
        items=[(tone.id, tone.label, tone.help) for tone in TONES.values()],
        default="intermediate",
    )
    sex: bpy.props.EnumProperty(
        name="Sex", description="Of the measured people", items=[(name, name.capitalize(), "") for name in SEXES]
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return may_change(cls, active_face(context))

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context: bpy.types.Context) -> set[str]:
        face = active_face(context)
        tell_up_to_date(self, face)
        growth = growth_of(face)
        drawn = person(self.tone, self.sex, growth.age_years, growth.seed, growth.sun)
        set_person(face, drawn)
        self.report({"INFO"}, f"ITA {drawn.ita:.0f} degrees, {len(drawn.strengths)} effects. Apply the skin to see it")
        return {"FINISHED"}


def put_controls(rig: bpy.types.Object, face: bpy.types.Object) -> DriveReport:
    """Sliders on the rig, and the shape keys of its meshes listening to them."""
    add_controls(rig)
    meshes = [mesh for mesh in dict.fromkeys((face, *rig.children)) if mesh.type == "MESH"]
    for mesh in meshes:
        remember_keys(mesh, rig)
    return drive_shape_keys(rig, meshes)


def new_rig(context: bpy.types.Context, face: bpy.types.Object) -> bpy.types.Object:
    """An armature for the controls of a face that has none; it does not deform anything.

    It stands between the face and its parent. The face's own location, rotation and scale stay as they are: they may
    be animated.
    """
    rig = bpy.data.objects.new(f"{face.name} controls", bpy.data.armatures.new(f"{face.name} controls"))
    mark_rig(rig)
    face.users_collection[0].objects.link(rig)
    context.view_layer.update()
    own, above = face.matrix_world.copy(), Matrix()
    if face.parent is not None:
        shown = face.evaluated_get(context.evaluated_depsgraph_get())  # a vertex that is a parent has a place there alone
        own = face.matrix_parent_inverse.inverted_safe() @ shown.matrix_local
        above = face.matrix_world @ own.inverted_safe()
        rig.parent, rig.parent_type = face.parent, face.parent_type
        rig.parent_bone, rig.parent_vertices = face.parent_bone, face.parent_vertices
        rig.matrix_parent_inverse = face.matrix_parent_inverse
    rig.matrix_basis = own
    context.view_layer.update()
    face.parent, face.parent_type = rig, "OBJECT"
    face.matrix_parent_inverse = rig.matrix_world.inverted_safe() @ above
    context.view_layer.update()
    return rig


def strange_colours(face: bpy.types.Object) -> list[bpy.types.Image]:
    """Images of the face's skin that belong to another working space than the file has now."""
    slot = our_slot(face)
    return strange_images(images_in(face.material_slots[slot].material)) if slot is not None else []


class SANGUINE_OT_follow_working_space(bpy.types.Operator):
    bl_idname = "sanguine.follow_working_space"
    bl_label = "Follow the Working Space"
    bl_description = (
        "The file's working space is another than the one that the skins were solved for: solve their tables again, so that "
        "their colour stays what it was. Nothing else is touched"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        strange = strange_images()
        if not strange:
            cls.poll_message_set("Every skin was solved for the file's working space")
        elif all(image.library for image in strange):
            cls.poll_message_set("The skins are linked: open their own file and change its working space there")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        own = [image for image in strange_images() if image.library is None]
        try:
            with window_progress(context) as progress, nothing_left_behind():
                notes = follow_working_space(own, progress)
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, f"{len(own) - len(notes)} tables solved for the file's working space")
        return {"FINISHED"}


CLASSES = (SANGUINE_OT_apply_skin, SANGUINE_OT_read_picture, SANGUINE_OT_draw_person, SANGUINE_OT_follow_working_space)
