"""What perfusion and oxygenation share: the change of one blood quantity by emotion, state and region."""

from __future__ import annotations

from ..blood import Change, settled
from ..vascular import reach
from .effect import ELSEWHERE, Activation, Bounds, Effect, Fragment, Frame, Scene, shift_bounds
from .regions import mask_inputs, masked_sum


def frame_changes(frame: Frame, mixable: bool) -> dict[tuple[str, str], Change]:
    """(region, quantity) -> change at a moment. mixable: of every mix of its sliders, not of their values alone."""
    if frame.changes is not None:
        return dict(frame.changes)
    if mixable:
        return reach(frame.emotions)
    return {key: (value, value) for key, value in settled(frame.emotions, frame.blood).items()}


def blood_effect(effect_id: str, label: str, help: str, quantity: str) -> Effect:
    """An effect that adds the emotion-driven change of `quantity` in every region it moves in."""

    def moment(scene: Scene, frame: Frame) -> dict[str, Change]:
        """Region -> lowest and highest change, of what moves and has a mask."""
        moved = frame_changes(frame, scene.live)
        found = ((region, moved.get((region, quantity), (0.0, 0.0))) for region in (*scene.regions, ELSEWHERE))
        return {region: change for region, change in found if change != (0.0, 0.0)}

    def changes(scene: Scene) -> dict[str, Change]:
        """The same over all frames, rest included."""
        found: dict[str, Change] = {}
        for frame in scene.frames:
            for region, (low, high) in moment(scene, frame).items():
                before = found.get(region, (0.0, 0.0))
                found[region] = min(before[0], low), max(before[1], high)
        return found

    def activate(scene: Scene) -> Activation:
        frames = tuple(frame.id for frame in scene.frames if moment(scene, frame))
        if not frames:
            if not scene.regions and any(frame_changes(frame, scene.live) for frame in scene.frames):
                return Activation(False, "the face has no region masks")
            return Activation(False, f"no emotion or state of the shot moves {quantity}")
        names = sorted({e for frame in scene.frames if frame.id in frames for e, v in frame.emotions.items() if v})
        return Activation(True, f"{', '.join(names)} move{'s' if len(names) == 1 else ''} {quantity}", frames)

    def fragments(scene: Scene) -> tuple[Fragment, ...]:
        moved = changes(scene)
        total, numbers = masked_sum(scene, quantity, moved)
        fragment = Fragment(
            stage="chromophores",
            file=f"{effect_id}.osl",
            inputs=mask_inputs(scene, moved) + numbers,
            defines={f"{quantity.upper()}_CHANGE": total},
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
        maps=lambda scene: tuple(i.key for i in mask_inputs(scene, changes(scene))),
    )
