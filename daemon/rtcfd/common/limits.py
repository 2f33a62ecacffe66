"""How much clients and components may ask for; each is refused with a line that names it."""

from dataclasses import dataclass, fields

from rtcf.v1 import errors_pb2

from rtcfd.common.refusals import ResourceExhausted


@dataclass(frozen=True)
class Limits:
    """The [limits] of the settings."""

    clients: int = 256  # connections at a time
    clients_per_user: int = 32  # of one user that may only look or tune
    runners: int = 32
    components: int = 5000  # of one runner
    taps: int = 1000  # outputs of one runner that are published; kept by its executor
    message_kb: int = 16384  # one request, KiB
    log_records_per_s: int = 2000  # of one runner, averaged over some seconds
    incidents_mb: int = 1000  # files of incidents, MB; 0 = none of faults and crashes

    @property
    def reserve(self) -> int:
        """Connections that are kept for those who may stop loops."""
        return max(self.clients // 8, 1)

    def check_runners(self, number: int) -> None:
        """Refuse a number of runners."""
        self._check("runners", number, self.runners)

    def check_components(self, number: int) -> None:
        """Refuse a number of components of one runner."""
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


# What the settings may say: least and most.
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
