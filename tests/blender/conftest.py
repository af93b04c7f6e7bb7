"""What the tests of the add-on inside Blender share."""

import bpy
import pytest
import sanguine


@pytest.fixture
def addon():
    """The add-on registered in an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sanguine.register()
    yield
    sanguine.unregister()
