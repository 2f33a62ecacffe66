"""Loops with components of rtcf_control and simulated motors."""

from typing import Any

import rtcf

LAG = {"inertia": 1e-3, "viscous": 2e-3}  # K = 500, T = 0.5 s


def load(
    client: rtcf.Client, type_: str, name: str, remaps: dict[str, str] | None = None, **more: Any
) -> None:
    """Load a component with remaps and parameters."""
    client.load(
        rtcf.component(
            "rtcf_control", type_, name=name, breaks=more.pop("breaks", ()),
            remaps=[f"{a}:={b}" for a, b in (remaps or {}).items()],
            parameters=[f"{key}:={value}" for key, value in more.items()],
        )
    )  # fmt: skip


def gains(client: rtcf.Client) -> dict[str, float]:
    """Return kp and ki of the controller `pid`."""
    found = {p.name: p.value.double_value for p in client.get_component("pid").parameters}
    return {name: found[name] for name in ("kp", "ki")}
