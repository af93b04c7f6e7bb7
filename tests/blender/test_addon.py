"""The add-on as Blender sees it: registers, refuses politely, applies and takes itself away."""

import bpy
import pytest
import sanguine
from sanguine.blender import operators, panels, skin
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.errors import InputError
from sanguine.domain.quality import DEFAULT, PRESETS
from tests.blender.layouts import draw


def grid(regions=FACE_REGIONS):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6, size=0.2)
    face = bpy.context.object
    for region in regions:
        face.vertex_groups.new(name=f"sanguine_{region}").add([0, 1, 7], 1.0, "REPLACE")
    return face


def test_nothing_selected_is_refused_with_what_to_do(addon):
    assert not bpy.ops.sanguine.apply_skin.poll()
    with pytest.raises(RuntimeError, match="Select a face"):
        bpy.ops.sanguine.apply_skin()


def test_a_mesh_without_uvs_gives_one_line(addon):
    face = grid()
    while face.data.uv_layers:
        face.data.uv_layers.remove(face.data.uv_layers[0])
    with pytest.raises(RuntimeError, match="no UV map"):
        bpy.ops.sanguine.apply_skin()


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH"])
def test_apply_gives_material_sliders_and_panel(addon, engine):
    bpy.context.scene.render.engine = engine
    face = grid()
    assert draw(panels.SANGUINE_PT_main)[:2] == ["sanguine.adopt", "sanguine.apply_skin"]
    assert bpy.ops.sanguine.apply_skin() == {"FINISHED"}
    assert bpy.context.scene.render.engine == engine
    assert {'["anger"]', '["happy"]', '["sad"]', '["fear"]', '["blood"]', "hemoglobin"} <= set(draw(panels.SANGUINE_PT_blood))
    assert "melanin" in draw(panels.SANGUINE_PT_skin) and "strength_relief" in draw(panels.SANGUINE_PT_features)
    assert "use_perfusion" in draw(panels.SANGUINE_PT_plan)
    assert "sanguine" in face.material_slots[0].material
    # The controls are found from the face and from the rig.
    bpy.context.view_layer.objects.active = face.parent
    assert operators.active_face(bpy.context) == face


def test_every_unit_of_the_rig_has_its_sliders(addon):
    face = grid()
    bpy.ops.sanguine.apply_skin()
    drawn = draw(panels.SANGUINE_PT_units) + draw(panels.SANGUINE_PT_sides)
    assert {name for name in operators.emotion_bone(face).keys() if name.startswith("AU")} == {
        path[2:-2] for path in drawn if path.startswith('["AU')
    }


def test_a_blender_without_osl_makes_plain_nodes_and_refuses_osl_before_it_changes_anything(addon, monkeypatch):
    import _cycles

    bpy.context.scene.render.engine = "CYCLES"
    face = grid()
    face.sanguine.shading = "OSL"
    bpy.ops.sanguine.apply_skin()
    assert "engine" not in draw(panels.SANGUINE_PT_main)
    monkeypatch.setattr(_cycles, "with_osl", False)
    assert any("is OSL" in line for line in draw(panels.SANGUINE_PT_main))
    before = {name: len(getattr(bpy.data, name)) for name in ("objects", "materials", "node_groups", "texts", "images")}
    with pytest.raises(RuntimeError, match="built without OSL"):
        bpy.ops.sanguine.apply_skin()
    with pytest.raises(InputError, match="built without OSL"):
        skin.apply_skin(face, None, operators.live_plan(face), shading="OSL")
    assert before == {name: len(getattr(bpy.data, name)) for name in before}
    face.sanguine.shading = "AUTO"
    bpy.ops.sanguine.apply_skin()
    assert face.material_slots[0].material["sanguine"]["shading"] == "NODES"
    assert not bpy.data.texts, "the scripts went with the skin before"
    bpy.context.scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"
    assert "engine" not in draw(panels.SANGUINE_PT_main)


def test_the_panel_says_when_the_engine_does_not_show_the_skin(addon):
    grid()
    bpy.ops.sanguine.apply_skin()
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    assert "engine" in draw(panels.SANGUINE_PT_main)
    bpy.context.scene.render.engine = "CYCLES"
    assert "engine" not in draw(panels.SANGUINE_PT_main)


def test_quality_is_shown_with_its_numbers_and_acts(addon):
    face = grid()
    assert face.sanguine.quality == DEFAULT
    for name, point in PRESETS.items():
        face.sanguine.quality = name
        assert bpy.context.scene.cycles.samples == point.samples
        drawn = draw(panels.SANGUINE_PT_main)
        assert "quality" in drawn and point.measured in drawn
        assert operators.live_plan(face).settings == point.settings
    face.sanguine.quality = "draft"
    bpy.ops.sanguine.apply_skin()
    group = face.material_slots[0].material.node_tree.nodes[0].node_tree
    read = {node.label for node in group.nodes if node.bl_idname == "ShaderNodeTexImage" and node.label.startswith("d_mm_")}
    assert len(read) == PRESETS["draft"].lobes
    assert {image.size[0] for image in bpy.data.images if image.name.endswith(" anatomy")} == {PRESETS["draft"].map_size}


def test_face_keeps_its_place_when_it_gets_a_rig(addon):
    face = grid()
    face.location = (1.0, 2.0, 3.0)
    face.rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    before = face.matrix_world.copy()
    bpy.ops.sanguine.apply_skin()
    bpy.context.view_layer.update()
    for a, b in zip(before, face.matrix_world):
        assert list(a) == pytest.approx(list(b), abs=1e-6)


def test_face_keeps_the_parent_it_had(addon):
    face = grid()
    holder = bpy.data.objects.new("holder", None)
    bpy.context.scene.collection.objects.link(holder)
    face.parent = holder
    holder.location = (1.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    bpy.ops.sanguine.apply_skin()
    holder.location = (3.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert list(face.matrix_world.translation) == pytest.approx([3.0, 0.0, 0.0], abs=1e-6)


def test_two_faces_share_no_state(addon):
    first = grid()
    first.sanguine.melanin = 0.02
    bpy.ops.sanguine.apply_skin()
    second = grid()
    second.sanguine.melanin = 0.2
    bpy.ops.sanguine.apply_skin()
    assert first.material_slots[0].material != second.material_slots[0].material
    assert first.parent != second.parent

    def melanin(face):
        group = face.material_slots[0].material.node_tree.nodes[0]
        return group.inputs["Melanin"].default_value

    assert melanin(first) == pytest.approx(0.02) and melanin(second) == pytest.approx(0.2)


def test_unregistering_leaves_nothing(addon):
    sanguine.unregister()
    assert not hasattr(bpy.types.Object, "sanguine")
    assert not hasattr(bpy.types, "SANGUINE_PT_main")
    sanguine.register()
