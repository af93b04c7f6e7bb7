"""Light under the skin: Burley lobes whose weights and radii come from the chromophores. Always on."""

from .effect import Activation, Effect, Scene


def _activate(scene: Scene) -> Activation:
    return Activation(True, "skin is seen", tuple(frame.id for frame in scene.frames))


EFFECT = Effect(
    id="scattering",
    label="Scattering",
    help="Light that enters the skin, scatters in both layers and leaves at a distance.",
    reads=(
        "melanin", "melanin_blend", "hemoglobin", "oxygenation", "epidermis_thickness_mm", "scatter_scale",
        "scatter_power", "vessel_radius_mm", "bilirubin_umol_per_l", "ink_per_mm",
    ),
    writes=(),
    activate=_activate,
    fragments=lambda scene: (),  # it is the fixed code of both shaders
    switchable=False,  # skin through which no light goes is black
)
