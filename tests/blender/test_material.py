"""The material of a plan: what is called for is there, what is not is nowhere, and all of it is in the file."""

import bpy
import numpy as np
import pytest
import sanguine_core
from sanguine.blender.properties import SkinSettings
from sanguine.blender.material import properties_read
from sanguine.blender.skin import apply_skin
from sanguine.blender.surface import REST_ATTRIBUTE, store_regions
from sanguine.domain.effects import Frame, Scene
from sanguine.domain.effects.regions import FACE_REGIONS
from sanguine.domain.parameters import PARAMETERS, default_skin
from sanguine.domain.plan import check_strengths, make_plan


@pytest.fixture
def face():
    """A grid with UVs, every region mask and no rig."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=0.2)
    face = bpy.context.object
    masks = {}
    for i, region in enumerate(FACE_REGIONS):
        masks[region] = np.zeros(len(face.data.vertices))
        masks[region][i * 8 : i * 8 + 8] = 1.0
    store_regions(face, masks)
    return face


def scene(frames=(Frame("neutral"),), strengths=None, live=False, **skin):
    return Scene(default_skin() | skin, frames, check_strengths(strengths or {}, "test"), FACE_REGIONS, live)


def nodes(material):
    (group,) = (node for node in material.node_tree.nodes if node.type == "GROUP")
    return group.node_tree.nodes


def test_what_is_not_called_for_is_nowhere(face):
    plan = make_plan(scene(strengths={"anatomy": 0.0}, oil=0.0))
    sanguine_core.reset_counters()
    material = apply_skin(face, None, plan, shading="OSL")
    counted = sanguine_core.counters()
    assert counted["lobe_fits"] == 3, "one skin, three channels"
    assert counted["texels_rasterized"] == 0
    assert not bpy.data.images
    assert not [key for key in face.keys() if key.startswith("blood_")]
    assert REST_ATTRIBUTE not in face.data.attributes
    kinds = {node.bl_idname for node in nodes(material)}
    assert kinds == {"NodeGroupInput", "NodeGroupOutput", "ShaderNodeScript"}


def test_emotion_brings_its_maps_properties_and_axes(face):
    plan = make_plan(scene(frames=(Frame("neutral"), Frame("fear", {"fear": 1.0}))))
    sanguine_core.reset_counters()
    material = apply_skin(face, None, plan)
    assert sanguine_core.counters()["lobe_fits"] == 3 * plan.entries
    assert sanguine_core.counters()["texels_rasterized"] > 0
    assert properties_read(material) == set(plan.packed)
    assert {"blood_packed_hemoglobin_0", "blood_packed_oxygenation_0"} <= set(plan.packed)
    assert {"hemoglobin", "oxygenation"} <= {axis.id for axis in plan.axes}


def test_a_face_without_a_rig_is_keyed_by_hand(face):
    """What the material reads follows what people key, for a regions mask by mask, and nothing else moves."""
    plan = make_plan(scene(frames=(Frame("neutral"), Frame("fear", {"fear": 1.0}))))
    apply_skin(face, None, plan)
    for frame, value in ((1, 0.0), (11, 0.01)):
        face["blood_hemoglobin_cheeks"] = value
        face.keyframe_insert('["blood_hemoglobin_cheeks"]', frame=frame)
    bpy.context.scene.frame_set(11)
    held = face.evaluated_get(bpy.context.evaluated_depsgraph_get())
    moved = {(name, i): value for name in plan.packed for i, value in enumerate(held[name]) if value}
    at = next((name, parts.index("blood_hemoglobin_cheeks")) for name, parts in plan.packed.items() if "blood_hemoglobin_cheeks" in parts)
    assert moved == {at: pytest.approx(0.01)}
    paths = {(curve.data_path[2:-2], curve.array_index) for curve in face.animation_data.drivers}
    assert paths == {(name, i) for name, parts in plan.packed.items() for i, part in enumerate(parts) if part}
    assert {name for parts in plan.packed.values() for name in parts if name} == {k for k in face.keys() if k.startswith("blood_")} - set(plan.packed)


def test_every_property_is_looked_up_once(face):
    """Cycles looks up each linked output of an Attribute node by itself."""
    strengths = {"strain": 1.0, "wrinkles": 1.0}
    face.shape_key_add(name="Basis")
    face.shape_key_add(name="jawOpen").data[0].co.z += 0.01
    apply_skin(face, None, make_plan(scene(frames=(Frame("anger", {"anger": 1.0}),), strengths=strengths)))
    read = [n for n in nodes(face.material_slots[0].material) if n.bl_idname == "ShaderNodeAttribute" and n.attribute_type == "OBJECT"]
    assert len({node.attribute_name for node in read}) == len(read) >= 12
    assert [[socket.name for socket in node.outputs if socket.is_linked] for node in read] == [["Color"]] * len(read)


def test_everything_is_inside_the_file(face):
    apply_skin(face, None, make_plan(scene(live=True, frames=(Frame("all", {"anger": 1.0}),), strengths={"relief": 1.0})))
    assert bpy.data.images
    for image in bpy.data.images:
        assert image.packed_file is not None and image.colorspace_settings.is_data
    for material in bpy.data.materials:
        for node in nodes(material):
            if node.bl_idname == "ShaderNodeScript":
                assert node.mode == "INTERNAL" and node.bytecode


def test_table_survives_saving_to_half_a_thousandth(face, tmp_path):
    """Half a thousandth: images are packed as half floats at worst, and half a thousandth is not seen."""
    apply_skin(face, None, make_plan(scene(frames=(Frame("a", {"anger": 1.0}),))))

    def table():
        (image,) = (i for i in bpy.data.images if i.name.endswith("table"))
        pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        return pixels

    before = table()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    np.testing.assert_allclose(table(), before, rtol=5e-4, atol=1e-6)


def test_sliders_and_properties_are_the_schema_rows(face):
    material = apply_skin(face, None, make_plan(scene(live=True)))
    (group,) = (node for node in material.node_tree.nodes if node.type == "GROUP")
    sockets = {item.name: item for item in group.node_tree.interface.items_tree if item.in_out == "INPUT"}
    for row in PARAMETERS.values():
        prop = SkinSettings.__annotations__[row.id].keywords
        assert (prop["min"], prop["max"], prop["default"]) == (row.hard_min, row.hard_max, row.default)
        assert row.help in prop["description"] and row.source in prop["description"]
        if row.label in sockets:
            socket = sockets[row.label]
            assert socket.min_value == pytest.approx(row.hard_min)
            assert socket.max_value == pytest.approx(row.hard_max)
            assert socket.description == row.help
    assert {"Melanin", "Hemoglobin", "Oxygenation"} <= set(sockets)


def test_applying_again_replaces_and_leaves_nothing_behind(face):
    plan = make_plan(scene(frames=(Frame("a", {"anger": 1.0}),), strengths={"relief": 1.0}))
    apply_skin(face, None, plan)
    once = {kind: len(getattr(bpy.data, kind)) for kind in ("images", "materials", "node_groups", "texts")}
    apply_skin(face, None, plan)
    assert {kind: len(getattr(bpy.data, kind)) for kind in once} == once
