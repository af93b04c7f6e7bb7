"""Undo and redo through every button and slider of Sanguine, one step each; nothing runs by itself.

A new operator needs a row in BUTTONS, which says how it is pressed.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
import sanguine
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from sanguine.blender import adopt
from sanguine.blender.colour import TABLE
from sanguine.blender.controls import CONTROLS
from sanguine.domain.parameters import PARAMETERS
from support.captures import add, noisy, showing, write_live_link
from support.inventory import inventory
from tests.blender.test_addon import draw
from tests.blender.test_adopt import make_face, registered, same, select, solve_once, solved_once, with_picture  # noqa: F401
from tests.blender.test_animation import PROFILE
from tests.blender.test_panels import scripts  # noqa: F401

OURS = "sanguine"


def settle():
    """What is animated has the value of its curve, as after every redraw."""
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)


def bare():
    make_face()


def pictured():
    with_picture(make_face())


def skinned():
    make_face()
    bpy.ops.sanguine.apply_skin()


def scripted():
    """A skin of OSL, as it is where Cycles renders."""
    bpy.context.scene.render.engine = "CYCLES"
    skinned()


def keyed():
    skinned()
    bone = bpy.data.objects["face"].parent.pose.bones["sanguine"]
    for frame, value in ((1, 0.0), (5, 1.0)):
        bone["anger"] = value
        bone.keyframe_insert('["anger"]', frame=frame)
    bpy.context.scene.frame_end = 10
    settle()


def baked():
    keyed()
    bpy.ops.sanguine.bake_blood()


def elsewhere():
    """A skin whose table was solved for another working space."""
    skinned()
    (table,) = (image for image in bpy.data.images if TABLE in image)
    table[TABLE] = json.dumps(json.loads(table[TABLE]) | {"space": "acescg"})


def skin_file(folder):
    path = folder / "skin.json"
    bpy.data.objects["face"].sanguine.melanin = 0.1
    bpy.ops.sanguine.export_preset(filepath=str(path))
    bpy.data.objects["face"].sanguine.melanin = 0.2
    return path


def profile(folder):
    path = folder / "profile.toml"
    path.write_text(PROFILE.format(sha="0" * 64))
    return path


def take(folder):
    seconds = np.arange(60) / 60
    rng = np.random.default_rng(1)
    keys = noisy(add(showing("anger", 1.0, seconds, rng, 0, 1)), seconds, rng)
    return write_live_link(folder / "take.csv", np.arange(60), keys)


class Button:
    """before: makes the file that it is pressed in. options: its properties, of a folder for files. changes: what a
    press changes is the file, and one undo takes it back; False for what only writes elsewhere."""

    def __init__(self, before, options=lambda folder: {}, changes=True):
        self.before, self.options, self.changes = before, options, changes


BUTTONS = {
    "add_feeling": Button(skinned, lambda _: {"feeling": "shame"}),
    "add_head": Button(bare),
    "add_poses": Button(skinned),
    "adopt": Button(pictured),
    "apply_skin": Button(bare),
    "bake_blood": Button(keyed),
    "bake_plain": Button(scripted),
    "clear_blood": Button(baked),
    "export_preset": Button(skinned, lambda folder: {"filepath": str(folder / "out.json")}, changes=False),
    "draw_person": Button(bare, lambda _: {"tone": "dark"}),
    "follow_working_space": Button(elsewhere),
    "import_capture": Button(keyed, lambda folder: {"filepath": str(take(folder))}),
    "import_preset": Button(skinned, lambda folder: {"filepath": str(skin_file(folder))}),
    "keep_preset": Button(skinned, lambda _: {"name": "kept"}, changes=False),
    "load_profile": Button(skinned, lambda folder: {"filepath": str(profile(folder))}),
    "read_picture": Button(pictured, lambda _: {"image": "albedo"}),
    "remove_feeling": Button(baked, lambda _: {"feeling": "anger"}),
    "remove_skin": Button(baked),
    "use_preset": Button(skinned, lambda folder: {"filepath": str(skin_file(folder))}),
}


def operators():
    return sorted(name for name in dir(bpy.ops.sanguine) if not name.startswith("_"))


def press(name, /, **options):
    """As a click does it: the operator itself makes the undo step, if it says that it wants one."""
    return getattr(bpy.ops.sanguine, name)("EXEC_DEFAULT", True, **options)


def nothing_runs():
    """No handler of ours, no function in the namespace of drivers, no driver that needs Python."""
    for name in dir(bpy.app.handlers):
        held = getattr(bpy.app.handlers, name)
        for function in held if isinstance(held, list) else ():
            assert OURS not in getattr(function, "__module__", ""), f"{name}: {function}"
    named = {name: value for name, value in bpy.app.driver_namespace.items() if OURS in getattr(value, "__module__", "") or ""}
    assert not named
    for kind in ("objects", "shape_keys", "armatures", "materials", "node_groups", "meshes", "scenes"):
        for item in getattr(bpy.data, kind):
            for curve in item.animation_data.drivers if item.animation_data else ():
                assert curve.driver.type != "SCRIPTED" or curve.driver.is_simple_expression, curve.data_path


def test_every_operator_has_a_row():
    missing = set(operators()) - set(BUTTONS)
    assert not missing, f"say in BUTTONS of {Path(__file__).name} how these are pressed: {sorted(missing)}"
    assert not set(BUTTONS) - set(operators())


@pytest.mark.parametrize("name", sorted(BUTTONS))
def test_one_press_is_one_step_back_and_forth(name, tmp_path, scripts):  # noqa: F811
    button = BUTTONS[name]
    button.before()
    options = button.options(tmp_path)
    settle()
    bpy.ops.ed.undo_push(message="before")
    before = inventory()
    assert press(name, **options) == {"FINISHED"}
    settle()
    after = inventory()
    if not button.changes:
        return same(before, after)
    assert before != after
    assert "UNDO" in getattr(bpy.ops.sanguine, name).bl_options
    nothing_runs()
    for _ in range(2):
        bpy.ops.ed.undo()
        same(before)
        bpy.ops.ed.redo()
        same(after)


STATES = []
"""Of each press, how deep it was."""


class Artist(RuleBasedStateMachine):
    """Presses buttons, pulls sliders, saves, changes his mind. `states` is what a step back or forth has to give."""

    folder: Path

    def __init__(self):
        super().__init__()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        face = make_face()
        face.data.shape_keys.key_blocks["browDown_R"].value = 0.125
        with_picture(face)
        select(face)
        bpy.context.scene.frame_end = 10
        bpy.ops.ed.undo_push(message="start")
        self.states, self.at, self.buttons_alone = [inventory()], 0, True
        self.start = self.states[0]

    def bone(self):
        rig = adopt.controls_of(bpy.data.objects["face"])
        return rig.pose.bones["sanguine"] if rig else None

    def step(self):
        settle()
        STATES.append(self.at)
        self.at += 1
        self.states[self.at :] = [inventory()]

    @initialize(skin=st.booleans())
    def begin(self, skin):
        if skin:
            self.press("apply_skin")

    def press(self, name, **options):
        assert press(name, **options) == {"FINISHED"}
        self.buttons_alone &= name not in ("draw_person", "read_picture", "use_preset", "import_preset")  # settings stay
        self.step()

    @rule(pick=st.integers(0, 1000))
    def button(self, pick):
        """One of those that are not grey."""
        names = [n for n, b in BUTTONS.items() if b.changes and n not in ("add_head", "draw_person") and getattr(bpy.ops.sanguine, n).poll()]
        bone = self.bone()
        feelings = [n for n in ("shame", "blush", "pulse", "anger") if bone is not None and n not in bone]
        there = [n for n in ("anger", "happy", "shame", "blush", "pulse") if bone is not None and n in bone]
        names = [n for n in names if (n != "add_feeling" or feelings) and (n != "remove_feeling" or there)]
        name = names[pick % len(names)]
        if name in ("add_feeling", "remove_feeling"):
            choices = feelings if name == "add_feeling" else there
            self.press(name, feeling=choices[pick // len(names) % len(choices)])
        else:
            options = {} if name in ("apply_skin", "adopt", "remove_skin") else BUTTONS[name].options(self.folder)
            self.press(name, **options)

    @precondition(lambda self: self.bone() is not None)
    @rule(pick=st.integers(0, 1000), value=st.floats(0.0, 1.0))
    def slider(self, pick, value):
        bone = self.bone()
        names = [name for name in CONTROLS if name in bone]
        bone[names[pick % len(names)]] = value
        bone.id_data.update_tag()
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="slider")
        self.step()

    @rule(name=st.sampled_from(sorted(PARAMETERS)), share=st.floats(0.0, 1.0))
    def setting(self, name, share):
        row = PARAMETERS[name]
        setattr(bpy.data.objects["face"].sanguine, name, row.soft_min + share * (row.soft_max - row.soft_min))
        bpy.ops.ed.undo_push(message=name)
        self.buttons_alone = False
        self.step()

    @precondition(lambda self: self.at)
    @rule()
    def undo(self):
        bpy.ops.ed.undo()
        settle()
        self.at -= 1
        same(self.states[self.at])

    @precondition(lambda self: self.at < len(self.states) - 1)
    @rule()
    def redo(self):
        bpy.ops.ed.redo()
        settle()
        self.at += 1
        same(self.states[self.at])

    @precondition(lambda self: self.at > 2)
    @rule()
    def save_and_open(self):
        path = str(self.folder / "a.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        bpy.ops.wm.open_mainfile(filepath=path)
        bpy.ops.ed.undo_push(message="opened")
        self.states, self.at = [inventory()], 0

    def teardown(self):
        nothing_runs()
        while self.at:
            self.undo()
        while self.at < len(self.states) - 1:
            self.redo()
        if bpy.ops.sanguine.remove_skin.poll():
            self.press("remove_skin")
        assert not any(name.startswith(("texts/", "node_groups/", "armatures/")) for name in inventory())
        if self.buttons_alone:
            same(self.start)


def play(folder):
    """50 sequences, in a process of their own: after so many undone states `bpy` hangs when the interpreter ends it."""
    sanguine.register()
    Artist.folder = Path(folder)
    checks = [HealthCheck.too_slow, HealthCheck.filter_too_much]
    with pytest.MonkeyPatch.context() as patch:
        solve_once(patch)
        run_state_machine_as_test(
            Artist,
            settings=settings(
                max_examples=50, stateful_step_count=10, deadline=None, derandomize=True, database=None, suppress_health_check=checks
            ),
        )
    print(len(STATES), "states")
    sys.stdout.flush()
    os._exit(0)


def test_any_order_of_buttons_and_sliders_is_undone_and_done_again(tmp_path):
    root = Path(__file__).resolve().parents[2]
    script = (
        f"import sys; sys.path[:0] = [{str(root / 'tests')!r}, {str(root)!r}]\n"
        f"from tests.blender.test_undo import play; play({str(tmp_path)!r})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-8000:]
    assert int(done.stdout.split()[-2]) > 100, "hardly anything was pressed"


def test_panels_draw_in_every_state():
    """What a panel shows must not change the file: Blender lets no panel write."""
    from sanguine.blender import panels

    for before in (bare, skinned, baked, elsewhere):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        before()
        there = inventory()
        for panel in panels.CLASSES:
            if not hasattr(panel, "poll") or panel.poll(bpy.context):
                draw(panel)
        same(there)
