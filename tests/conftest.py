"""What holds for every Python test."""

import pytest
from hypothesis import HealthCheck, settings

# The same examples every time, and no clock: on a busy machine a deadline fails for reasons that are not in the code.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory):
    """Maps that a user's cache holds must not stand in for those a test means to make."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SANGUINE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
