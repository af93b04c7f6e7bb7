"""A layout for panels where no window draws."""

from types import SimpleNamespace

import blf
import bpy

# Of the sidebar as Blender opens it, measured on screenshots of 4.3.2 at a scale of 1: its width, what a widget over all
# of it has, and how much of a slider is left for its label and its number. The longest that was seen whole in one,
# "11 Nasolabial Furrow Deepe…" and "0.000", take 190 pixels here; with one letter more they would take 197, and it was cut.
REGION, WIDGET, SLIDER = 280, 235, 190
TEXT, ICON, ARROW = 8, 20, 20


def pixels(text):
    """Of a text in Blender's own font, as widgets have it."""
    blf.size(0, 11.0)
    return blf.dimensions(0, text)[0]


class Layout:
    """Stands in for Blender's layout, which exists only while a window draws: takes what a panel asks for.

    drawn: operators, properties and texts in order. Nested layouts write to the same list. parts: what is in it, widgets as
    (text, pixels that they need) and other layouts. factor: of a split, the share of its first part.
    """

    def __init__(self, drawn=None, beside=False, factor=None):
        self.drawn = [] if drawn is None else drawn
        self.parts, self.beside, self.factor = [], beside, factor

    def operator(self, name, text=None, icon="NONE", **_):
        category, verb = name.split(".")
        made = getattr(bpy.types, f"{category.upper()}_OT_{verb}", None)
        assert made is not None, f"no operator {name}"
        self.drawn.append(name)
        self._put(made.bl_label if text is None else text, icon=icon)
        return type("Properties", (), {})()

    def operator_menu_enum(self, name, property, **more):
        self.operator(name, **more)
        category, verb = name.split(".")
        assert property in getattr(getattr(bpy.ops, category), verb).get_rna_type().properties

    def menu(self, name, text="", **_):
        assert hasattr(bpy.types, name), f"no menu {name}"
        self.drawn.append(name)
        self._put(text, ARROW)

    def prop(self, data, name, text=None, **_):
        # Blender draws an unknown property as an error in red: here it is one.
        data.path_resolve(name)
        self.drawn.append(name)
        if name.startswith('["'):
            about = data.id_properties_ui(name[2:-2]).as_dict()
            self._put(text, WIDGET - SLIDER + pixels(f"{about['max']:.{about['precision']}f}"))
            return
        row = data.bl_rna.properties[name]
        text = row.name if text is None else text
        if row.type in ("FLOAT", "INT") and not getattr(row, "array_length", 0):
            digits = row.precision if row.type == "FLOAT" else 0
            self._put(text, WIDGET - SLIDER + pixels(f"{row.hard_max:.{digits}f}"))
        else:
            self._put(text, ARROW)

    def prop_enum(self, data, name, value, **_):
        items = data.bl_rna.properties[name].enum_items
        assert value in items
        self.drawn.append(value)
        self._put(items[value].name)

    def label(self, text="", icon="NONE", **_):
        self.drawn.append(text)
        self._put(text, icon=icon)

    def template_icon(self, icon_value, scale=1.0):
        assert isinstance(icon_value, int)
        self.drawn.append("icon")

    def _put(self, text, more=0, icon="NONE"):
        self.parts.append((text, TEXT + more + (ICON if icon != "NONE" else 0) + pixels(text)))

    def _inner(self, beside, factor=None):
        self.parts.append(Layout(self.drawn, beside, factor))
        return self.parts[-1]

    def column(self, **_):
        return self._inner(False)

    box = column

    def row(self, **_):
        return self._inner(True)

    def split(self, factor=0.5, **_):
        return self._inner(True, factor)

    def too_wide(self, width=WIDGET):
        """What needs more than there is, widgets, and rows of some that do together: texts, pixels needed, pixels there."""
        found = []
        for i, part in enumerate(self.parts):
            there = width if self.factor is None else width * (self.factor if i == 0 else 1.0 - self.factor)
            if isinstance(part, Layout):
                found += part.too_wide(there)
            elif part[1] > there:
                found.append((*part, there))
        if self.beside and self.factor is None and self.needs() > width and not found:
            found.append((" | ".join(self.texts()), self.needs(), width))
        return found

    def needs(self):
        needs = [part.needs() if isinstance(part, Layout) else part[1] for part in self.parts]
        return sum(needs) if self.beside else max(needs, default=0.0)

    def texts(self):
        return [text for part in self.parts for text in (part.texts() if isinstance(part, Layout) else part[:1])]


class _Sidebar:
    """The context, with a sidebar of the width that Blender opens it with, and a scale, which is 0 where no window is."""

    region = SimpleNamespace(width=REGION)
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))

    def __getattr__(self, name):
        return getattr(bpy.context, name)


SIDEBAR = _Sidebar()


def lay_out(panel, context=None):
    """The layout that a panel fills for the context as it is; None where it is not shown at all."""
    if not panel.poll(bpy.context):
        return None
    layout = Layout()
    panel.draw(type("Panel", (), {"layout": layout})(), context or bpy.context)
    return layout


def draw(panel):
    """What a panel draws for the context as it is; None where it is not shown at all."""
    layout = lay_out(panel)
    return None if layout is None else layout.drawn
