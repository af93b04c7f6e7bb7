"""Features for tests of what any feature has to do: rows as the native core declares them, without the growing."""

from __future__ import annotations

import pytest
from sanguine.domain import plan
from sanguine.domain.effects import Effect, grown


def declare(patch: pytest.MonkeyPatch, feature_id: str, **changes: tuple[float, float]) -> Effect:
    """A feature that changes channels (channel=(low, high)), known to the planner until the test ends."""
    row = {
        "id": feature_id,
        "label": feature_id.capitalize(),
        "help": "For a test",
        "source": "none",
        "changes": [{"channel": name, "low": low, "high": high} for name, (low, high) in changes.items()],
    }
    effect = grown._effect(row)
    assert feature_id not in grown.ROWS, "there is such a feature: take another name"
    patch.setitem(grown.ROWS, feature_id, row)
    known = plan.EFFECTS
    after = [other.id for other in known].index("skin_map") + 1
    patch.setattr(plan, "EFFECTS", (*known[:after], effect, *known[after:]))
    return effect
