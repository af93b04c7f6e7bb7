"""An OpenColorIO configuration of a house of its own: no name that Blender's has, and a working space that is wanted."""

import colour
import numpy as np

NAMES = ("house_linear", "house_texture", "house_numbers")

_TEXT = """ocio_profile_version: 2
roles:
  aces_interchange: house_ap0
  cie_xyz_d65_interchange: house_xyz
  scene_linear: house_linear
  rendering: house_linear
  reference: house_linear
  default: house_texture
  default_byte: house_texture
  default_float: house_linear
  default_sequencer: house_texture
  color_picking: house_texture
  texture_paint: house_texture
  matte_paint: house_texture
  data: house_numbers
file_rules:
  - !<Rule> {{name: Default, colorspace: default}}
displays:
  House Monitor:
    - !<View> {{name: House Film, colorspace: house_texture}}
    - !<View> {{name: House Raw, colorspace: house_numbers}}
colorspaces:
  - !<ColorSpace> {{name: house_linear, isdata: false}}
  - !<ColorSpace>
    name: house_ap0
    from_reference: !<MatrixTransform> {{matrix: {ap0}}}
  - !<ColorSpace>
    name: house_xyz
    from_reference: !<MatrixTransform> {{matrix: {xyz}}}
  - !<ColorSpace>
    name: house_texture
    from_reference: !<GroupTransform>
      children:
        - !<MatrixTransform> {{matrix: {srgb}}}
        - !<ExponentWithLinearTransform> {{gamma: [2.4, 2.4, 2.4, 1], offset: [0.055, 0.055, 0.055, 0], direction: inverse}}
  - !<ColorSpace> {{name: house_numbers, isdata: true}}
"""

D65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]


def xyz_of(space):
    """(3, 3) from linear RGB of a space of colour-science to XYZ under D65, white at Y = 1, adapted by Bradford."""
    return colour.RGB_to_XYZ(np.eye(3), space, D65, chromatic_adaptation_transform="Bradford").T


def write_config(path, working_space):
    """The configuration whose scene-linear colours are in the space that colour-science calls so."""
    xyz = xyz_of(working_space)
    ap0 = colour.RGB_COLOURSPACES["ACES2065-1"]
    to_ap0 = colour.XYZ_to_RGB(np.eye(3), ap0, D65, chromatic_adaptation_transform="Bradford").T
    to_srgb = np.linalg.inv(xyz_of("sRGB"))
    made = {"xyz": xyz, "ap0": to_ap0 @ xyz, "srgb": to_srgb @ xyz}
    path.write_text(_TEXT.format(**{name: _matrix(m) for name, m in made.items()}))
    return path


def _matrix(three):
    four = np.eye(4)
    four[:3, :3] = three
    return [round(float(value), 9) for value in four.ravel()]
