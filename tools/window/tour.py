#!/usr/bin/env python3
"""The tour of `make window`, inside the Debian 13 folder: installs the zip, clicks through the panel, keeps pictures.

    tour.py [PART ...]      the parts to run, all without one: install (always), panel, blood, poses, states

Every click is a mouse's, on the word that a user would look for; what came of it is asked of Blender itself. A
traceback in Blender's log is a failure, whatever else happened.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from screen import HEIGHT, Box, Failed, Screen, tried

HERE = Path(__file__).resolve().parent
TAB_WIDTH = 26
FIRST_POSE = (40, 40)  # in the asset shelf, which shows no names of its own accord
FACE = 'bpy.data.objects["female_skin"]'
RIG = 'bpy.data.objects["female_rig"]'
BONE = f'{RIG}.pose.bones["sanguine"]'
PANELS = ("Blood in Time", "Action Units", "Skin", "Features", "From a Picture", "Plan")


def blender(*arguments: str, status: int = 0) -> str:
    done = subprocess.run(["blender", *arguments], capture_output=True, text=True, cwd=HERE)
    if done.returncode != status or "Traceback" in done.stdout + done.stderr:
        raise Failed(f"blender {' '.join(arguments)}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def has(text: str, part: str) -> None:
    if part not in text:
        raise Failed(f"no '{part}' in: {text[-500:]}")


class Install:
    """The zip by Blender's own extension tool, and the command line of what it installed."""

    def steps(self):
        (zip_file,) = HERE.glob("sanguine-*.zip")
        (HERE / "skin.json").write_text('{"skins": [{"id": "a", "melanin": 0.1}]}')
        (HERE / "keys.txt").write_text("jawOpen\nbrowDownLeft\n")
        command = ("--command", "sanguine")
        return [
            ("validate", lambda: blender("--command", "extension", "validate", zip_file.name)),
            ("install", lambda: blender("--command", "extension", "install-file", "-r", "user_default", "-e", zip_file.name)),
            ("sanguine --help", lambda: has(blender(*command, "--help"), "usage: sanguine")),
            ("sanguine skin", lambda: has(blender(*command, "skin", "skin.json"), '"reflectance"')),
            ("sanguine names", lambda: has(blender(*command, "names", "keys.txt"), '"jawOpen"')),
            ("sanguine blood", lambda: has(blender(*command, "blood", "--tone", "monk-9"), '"anger"')),
            ("no such file", lambda: has(blender(*command, "skin", "none.json", status=2), "none.json: no such file")),
            ("render without OSL", lambda: has(
                blender(*command, "render", "scene.blend", "--out", "out", status=2), "built without OSL")),
        ]  # fmt: skip


class Window:
    """What the parts in the window share: the scene, open, with the tab Sanguine in front and the view all over."""

    opened = ""

    def __init__(self) -> None:
        self.s = Screen(HERE, "scene.blend")
        s = self.s
        s.settle()
        s.move(*s.region("WINDOW").middle)
        for _ in range(3):
            s.key("ctrl+space")  # the view all over
            if s.ask("bpy.context.window.screen.show_fullscreen"):
                break
            s.move(*s.region("WINDOW").middle)
        s.do("bpy.ops.view3d.view_axis(type='FRONT'); bpy.ops.view3d.view_selected()")
        s.do("bpy.context.space_data.overlay.show_overlays = False")
        for _ in range(3):  # a key that comes while Blender is still busy is lost
            s.key("n")
            if s.ask("bpy.context.space_data.show_region_ui"):
                break
        ui = s.region()
        s.click(*s.find("Sanguine", Box(ui.x + ui.width - TAB_WIDTH, ui.y, TAB_WIDTH, ui.height), turned=True).middle)

    def open(self, panel: str) -> None:
        """This sub-panel and none of the others."""
        if self.opened == panel:
            return
        if self.opened:
            self.s.click(*self.header(self.opened))
        self.s.click(*self.header(panel))
        self.opened = panel
        self.s.move(*self.s.region("WINDOW").middle)

    def header(self, panel: str) -> tuple[int, int]:
        # "Skin" is on a button above too: headers are the last that say so.
        ui = self.s.region()
        below = self.s.find("Import Capture", ui)
        return self.s.find(panel, Box(ui.x, below.y + below.height, ui.width - TAB_WIDTH, HEIGHT - below.y - below.height)).middle

    def click(self, text: str) -> None:
        self.s.click(*self.s.find(text, self.s.region()).middle)

    def pull(self, text: str, pixels: int) -> None:
        """The slider that says so, by as much to the right."""
        ui, y = self.s.region(), self.s.find(text, self.s.region()).middle[1]
        self.s.drag((ui.x + 60, y), (ui.x + 60 + pixels, y))

    def undo(self) -> None:
        self.s.move(*self.s.region("WINDOW").middle)
        self.s.key("ctrl+z")

    def redo(self) -> None:
        self.s.move(*self.s.region("WINDOW").middle)
        self.s.key("ctrl+shift+z")


class Panel(Window):
    def steps(self):
        return [
            ("the panel is there", lambda: self.s.shot("panel")),
            ("pull Anger", self.anger),
            ("undo and redo of a slider", self.back),
            ("Add: a search", self.add),
            ("Remove", self.remove),
            *((f"open {name}", lambda name=name: self.look(name)) for name in PANELS),
            ("an action unit", self.unit),
            ("a dialogue: Draw a Person", self.person),
            ("Remove Sanguine", self.take_off),
        ]

    def anger(self) -> None:
        self.pull("Anger", 130)
        self.s.check("anger rose", f'{BONE}["anger"] > 0.3')
        self.s.check("the brows followed", f'{FACE}.data.shape_keys.key_blocks["browDownLeft"].value > 0.1')
        self.s.shot("anger")

    def back(self) -> None:
        self.undo()
        self.s.check("anger is back", f'{BONE}["anger"] == 0.0')
        self.redo()
        self.s.check("anger is there again", f'{BONE}["anger"] > 0.3')
        self.undo()

    def add(self) -> None:
        self.click("Add")
        self.s.shot("add_search")
        self.s.type("surp")
        self.s.shot("add_search_typed")
        self.s.key("Return")
        self.s.check("surprise is on the rig", f'"surprise" in {BONE}')
        self.s.shot("surprise")
        self.undo()
        self.s.check("undone", f'"surprise" not in {BONE}')
        self.redo()
        self.s.check("done again", f'"surprise" in {BONE}')

    def remove(self) -> None:
        ui, above = self.s.region(), self.s.find("Blood pace", self.s.region())  # not the button Remove Sanguine
        self.s.click(*self.s.find("Remove", Box(ui.x, above.y, ui.width - TAB_WIDTH, 80)).middle)
        self.s.type("surp")
        self.s.key("Return")
        self.s.check("surprise is off the rig", f'"surprise" not in {BONE}')

    def look(self, name: str) -> None:
        self.open(name)
        self.s.shot(name.lower().replace(" ", "_"))

    def unit(self) -> None:
        self.open("Action Units")
        self.pull("12 Lip corner puller", 100)
        self.s.check("the unit moved", f'{BONE}["AU12"] > 0.2')
        self.s.check("and the mouth", f'{FACE}.data.shape_keys.key_blocks["mouthSmileLeft"].value > 0.1')
        self.s.shot("unit_12")
        self.undo()
        self.s.check("undone", f'{BONE}["AU12"] == 0.0')

    def person(self) -> None:
        self.open("Features")
        before = self.s.ask(f"{FACE}.sanguine.melanin")
        self.click("Draw a Person")
        self.s.shot("draw_a_person")
        self.s.key("Return")
        self.s.check("the skin is another", f"abs({FACE}.sanguine.melanin - {before}) > 1e-6")
        self.undo()
        self.s.check("and is back", f"abs({FACE}.sanguine.melanin - {before}) < 1e-6")


    def take_off(self) -> None:
        self.click("Remove Sanguine")
        # The example head came with its sliders: they are what was there before the skin.
        self.s.check("no blood", f'"blood_hemoglobin_cheeks" not in {FACE}')
        self.s.check("no skin", f'not any(m and "sanguine" in m for m in {FACE}.data.materials)')
        self.s.shot("removed")
        self.undo()
        self.s.check("all is back", f'any(m and "sanguine" in m for m in {FACE}.data.materials) and "blood_hemoglobin_cheeks" in {FACE}')


class Blood(Window):
    def steps(self):
        return [("Bake Blood", self.bake), ("undo and redo of a bake", self.back), ("stale", self.stale), ("Clear", self.clear)]

    baked = f'"sanguine_bake" in {FACE}'

    def bake(self) -> None:
        self.open("Blood in Time")
        self.click("Bake Blood")
        self.s.wait(self.baked)
        self.s.do("bpy.context.scene.frame_set(60)")  # blood is late: at 24 there is none yet
        self.s.check("blood rose", f'{FACE}["blood_hemoglobin_cheeks"] > 1e-4')
        self.s.shot("baked")

    def back(self) -> None:
        self.undo()
        if self.s.ask(self.baked):  # the frame is a step of its own
            self.undo()
        self.s.check("not baked", f"not ({self.baked})")
        self.redo()
        self.s.check("baked again", self.baked)

    def stale(self) -> None:
        self.s.do(f'{BONE}["anger"] = 0.5; {BONE}.keyframe_insert(\'["anger"]\', frame=12)')
        self.s.do("for area in bpy.context.screen.areas: area.tag_redraw()")
        self.s.shot("stale")
        self.s.find("Stale", self.s.region())

    def clear(self) -> None:
        self.click("Clear Baked Blood")
        self.s.check("cleared", f"not ({self.baked})")
        self.undo()
        self.s.check("baked again", self.baked)


class Poses(Window):
    """The pose library: what Add Poses of Emotions made, applied as an animator does it, from the asset shelf."""

    def steps(self):
        return [("Add Poses of Emotions", self.add), ("a click on a pose in the asset shelf", self.apply), ("undo", self.back)]

    def add(self) -> None:
        self.s.do(f"bpy.context.view_layer.objects.active = {RIG}; bpy.ops.object.mode_set(mode='POSE')")
        self.s.do(f'{RIG}.data.bones.active = {RIG}.data.bones["sanguine"]')
        self.open("Blood in Time")
        self.click("Add Poses of Emotions")
        self.s.check("poses are assets", "sum(action.asset_data is not None for action in bpy.data.actions) == 13")

    def apply(self) -> None:
        self.s.do("bpy.context.space_data.show_region_asset_shelf = True")
        self.s.shot("poses")
        shelf = self.s.region("ASSET_SHELF")
        self.s.do(f"{BONE}.id_data.animation_data.action = None")  # else its keys win at the next frame
        self.s.move(*shelf.middle)
        self.s.key("ctrl+f")
        self.s.type("happy, extreme")
        self.s.key("Return")
        self.s.shot("poses_found")
        self.s.click(shelf.x + FIRST_POSE[0], shelf.y + FIRST_POSE[1])
        self.s.shot("pose_applied")
        self.s.check("the slider is the pose's", f'{BONE}["happy"] == 1.5')
        self.s.check("the mouth followed", f'{FACE}.data.shape_keys.key_blocks["mouthSmileLeft"].value > 0.1')

    def back(self) -> None:
        self.s.check("still posed", f'{BONE}["happy"] == 1.5')
        self.undo()
        self.s.check("undone", f'{BONE}["happy"] == 0.0')


class States(Window):
    """Every operator of ours from states that it is not for: greyed with its reason, or a report; never a traceback."""

    STATES = {
        "nothing active": "bpy.context.view_layer.objects.active = None",
        "a camera": "bpy.context.view_layer.objects.active = next(o for o in bpy.data.objects if o.type == 'CAMERA')",
        "another mesh": "bpy.ops.mesh.primitive_cube_add()",
        "a mesh without faces": "bpy.context.view_layer.objects.active.data = bpy.data.meshes.new('empty')",
        "an armature without a face": "bpy.ops.object.armature_add()",
        "edit mode": f"bpy.context.view_layer.objects.active = {FACE}; bpy.ops.object.mode_set(mode='EDIT')",
        "sculpt mode": "bpy.ops.object.mode_set(mode='OBJECT'); bpy.ops.object.mode_set(mode='SCULPT')",
        "a linked face": "bpy.ops.object.mode_set(mode='OBJECT'); link()",
        "a face whose rig is gone": f"bpy.context.view_layer.objects.active = {FACE}; bpy.data.objects.remove({RIG})",
    }

    def steps(self):
        shutil.copy(HERE / "scene.blend", HERE / "linked.blend")  # a file that links itself crashes Blender
        self.s.do(ASK)
        return [(state, lambda state=state: self.refused(state)) for state in self.STATES]

    def refused(self, state: str) -> None:
        self.s.do(self.STATES[state])
        if wrong := self.s.ask("ask_all()"):
            raise Failed("; ".join(f"{name}: {what}" for name, what in wrong.items()))
        self.s.shot("state_" + state.replace(" ", "_"))


ASK = """
def link():
    with bpy.data.libraries.load(bpy.path.abspath("//linked.blend"), link=True) as (there, here):
        here.objects = ["female_skin", "female_rig"]
    for obj in here.objects:
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = here.objects[0]


def ask_all():
    wrong = {}
    for name in dir(bpy.ops.sanguine):
        try:
            getattr(bpy.ops.sanguine, name)()
        except (RuntimeError, TypeError) as error:
            if "Traceback" in str(error) or "context is incorrect" in str(error):
                wrong[name] = str(error)
    return wrong
"""

PARTS = {"install": Install, "panel": Panel, "blood": Blood, "poses": Poses, "states": States}


def main(parts: list[str]) -> int:
    os.environ.setdefault("HOME", str(HERE))
    failures = []
    for name in ["install", *(part for part in parts or PARTS if part != "install")]:
        print(f"== {name}", flush=True)
        part = PARTS[name]()
        failures += [f"{name}: {line}" for line in tried(part.steps(), getattr(part, "s", None))]
        if isinstance(part, Window):
            part.s.close()
    log = HERE / "blender.log"
    if log.exists() and "Traceback" in (text := log.read_text(errors="replace")):
        failures.append(f"traceback in {log.name}: {text[text.index('Traceback') :][:2000]}")
    print("\n".join(["", *failures]) if failures else "all well")
    return len(failures) > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
