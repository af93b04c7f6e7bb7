"""A layout for panels where no window draws."""

import bpy


class Layout:
    """Stands in for Blender's layout, which exists only while a window draws: takes what a panel asks for.

    drawn: operators, properties and texts in order. Nested layouts write to the same list.
    """

    def __init__(self, drawn=None):
        self.drawn = [] if drawn is None else drawn

    def operator(self, name, **_):
        category, verb = name.split(".")
        assert hasattr(bpy.types, f"{category.upper()}_OT_{verb}"), f"no operator {name}"
        self.drawn.append(name)
        return type("Properties", (), {})()

    def operator_menu_enum(self, name, property, **_):
        self.operator(name)
        category, verb = name.split(".")
        assert property in getattr(getattr(bpy.ops, category), verb).get_rna_type().properties

    def menu(self, name, **_):
        assert hasattr(bpy.types, name), f"no menu {name}"
        self.drawn.append(name)

    def prop(self, data, name, **_):
        # Blender draws an unknown property as an error in red: here it is one.
        data.path_resolve(name)
        self.drawn.append(name)

    def prop_enum(self, data, name, value, **_):
        assert value in data.bl_rna.properties[name].enum_items
        self.drawn.append(value)

    def label(self, text="", **_):
        self.drawn.append(text)

    def template_icon(self, icon_value, scale=1.0):
        assert isinstance(icon_value, int)
        self.drawn.append("icon")

    def column(self, **_):
        return Layout(self.drawn)

    row = box = split = column


def draw(panel):
    """What a panel draws for the context as it is; None where it is not shown at all."""
    if not panel.poll(bpy.context):
        return None
    layout = Layout()
    panel.draw(type("Panel", (), {"layout": layout})(), bpy.context)
    return layout.drawn
