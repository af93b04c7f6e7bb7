#!/usr/bin/env python3
"""Installs a zip into the Blender of this Python and uses it: try_extension.py ZIP (set BLENDER_USER_RESOURCES)."""

import sys

import bpy

ADDON = "bl_ext.user_default.sanguine"
done = bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
assert done == {"FINISHED"} and ADDON in bpy.context.preferences.addons
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_enable(module=ADDON)
assert bpy.ops.sanguine.add_head(head="female") == {"FINISHED"}
assert bpy.ops.sanguine.adopt() == {"FINISHED"}
material = bpy.context.object.active_material.name
bpy.ops.preferences.addon_disable(module=ADDON)  # left registered, its classes crash `bpy` on the way out
print(f"well: {material}")
