"""What holds for every Python test."""

from hypothesis import HealthCheck, settings

# The same examples every time, and no clock: on a busy machine a deadline fails for reasons that are not in the code.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")
