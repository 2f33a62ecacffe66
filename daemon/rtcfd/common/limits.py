"""Limits on clients and components.  An error above a limit names it."""

from dataclasses import dataclass, fields

from rtcf.v1 import errors_pb2

from rtcfd.common.errors import ResourceExhausted


@dataclass(frozen=True)
class Limits:
    """The section [limits] of the settings."""

    clients: int = 256  # connections
    clients_per_user: int = 32  # connections of a user with the right to observe or tune only
    runners: int = 32
    components: int = 5000  # per runner
    taps: int = 1000  # published outputs per runner; the executor enforces it
    message_kb: int = 16384  # size of a request, KiB
    log_records_per_s: int = 2000  # per runner, averaged over some seconds
    incidents_mb: int = 1000  # all incident files, MB; 0 = faults and crashes leave none

    @property
    def reserve(self) -> int:
        """The number of connections reserved for clients that may stop loops."""
        return max(self.clients // 8, 1)

    def check_runners(self, number: int) -> None:
        """Raise ResourceExhausted for too many runners."""
        self._check("runners", number, self.runners)

    def check_components(self, number: int) -> None:
        """Raise ResourceExhausted for too many components in one runner."""
        self._check("components", number, self.components)

    @staticmethod
    def _check(name: str, number: int, most: int) -> None:
        if number > most:
            raise ResourceExhausted(
                f"{number} {name} are more than the {most} allowed: raise {name} under [limits] "
                "in rtcfd's settings",
                errors_pb2.REASON_LIMIT_REACHED,
                limit=name,
            )


# The smallest and the largest value that the settings may contain.
RANGES = {
    "clients": (1, 4096),
    "clients_per_user": (1, 4096),
    "runners": (1, 256),
    "components": (1, 100_000),
    "taps": (0, 100_000),
    "message_kb": (16, 16384),
    "log_records_per_s": (1, 1_000_000),
    "incidents_mb": (0, 1_000_000),
}
assert set(RANGES) == {field.name for field in fields(Limits)}
