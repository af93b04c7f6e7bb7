"""What perfusion and oxygenation share: the change of one blood quantity by emotion and region."""

from __future__ import annotations

from ..blood import blood_bounds, blood_property
from .effect import Activation, Bounds, Effect, Fragment, Scene, ShaderInput, shift_bounds
from .regions import mask_inputs, masked_sum


def blood_effect(effect_id: str, label: str, help: str, quantity: str) -> Effect:
    """An effect that adds the emotion-driven change of `quantity` in every region it moves in."""

    def changes(scene: Scene) -> dict[str, tuple[float, float]]:
        """Region -> lowest and highest change over the frames, regions that stay as they are left out."""
        found: dict[str, tuple[float, float]] = {}
        for frame in scene.frames:
            for region in scene.regions:
                low, high = blood_bounds(frame.emotions, frame.blood, region, quantity, mixable=scene.live)
                if low or high:
                    before = found.get(region, (0.0, 0.0))
                    found[region] = min(before[0], low), max(before[1], high)
        return found

    def activate(scene: Scene) -> Activation:
        if not scene.regions:
            return Activation(False, "the face has no region masks")
        frames = tuple(
            frame.id
            for frame in scene.frames
            if any(
                blood_bounds(frame.emotions, frame.blood, r, quantity, mixable=scene.live) != (0.0, 0.0)
                for r in scene.regions
            )
        )
        if not frames:
            return Activation(False, f"no emotion of the shot moves {quantity}")
        emotions = sorted({e for frame in scene.frames if frame.id in frames for e, v in frame.emotions.items() if v})
        return Activation(True, f"{', '.join(emotions)} move{'s' if len(emotions) == 1 else ''} {quantity}", frames)

    def fragments(scene: Scene) -> tuple[Fragment, ...]:
        terms = {region: blood_property(quantity, region) for region in changes(scene)}
        inputs = tuple(ShaderInput(name, "float", "object", name) for name in terms.values())
        fragment = Fragment(
            stage="chromophores",
            file=f"{effect_id}.osl",
            inputs=mask_inputs(scene, tuple(terms)) + inputs,
            defines={f"{quantity.upper()}_CHANGE": masked_sum(scene, terms)},
        )
        return (fragment,)

    def bounds(scene: Scene, before: Bounds) -> Bounds:
        return shift_bounds(before, quantity, changes(scene))

    return Effect(
        id=effect_id,
        label=label,
        help=help,
        reads=(quantity,),
        writes=(quantity,),
        activate=activate,
        fragments=fragments,
        bounds=bounds,
        maps=lambda scene: tuple(i.key for i in mask_inputs(scene, tuple(changes(scene)))),
    )
