"""Who may set which parameters, and how fast: the [[access.parameters]] of the settings.

Rules grant them to users who may otherwise only look, and bound those who may
tune; who may operate is bound by none.
"""

import re
from dataclasses import dataclass

from rtcf.v1 import errors_pb2

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.common.refusals import FailedPrecondition, PermissionDenied

# A value that has not been changed for long may not leap either.
LONGEST_PAUSE_S = 10.0
_FIRST_PAUSE_S = 1.0  # before the first change


@dataclass(frozen=True)
class Rule:
    """Some users, and what they may set."""

    who: frozenset[str]  # users, and groups with @
    runner: str = ".*"  # an expression that matches the whole name
    names: tuple[str, ...] = (".*",)  # likewise, of COMPONENT.PARAMETER
    most_per_s: float | None = None  # change of a number, in its unit

    def of(self, peer: Peer) -> bool:
        """Tell whether it is about this user."""
        return peer.user in self.who or not self.who.isdisjoint(f"@{each}" for each in peer.groups)

    def allows(self, runner: str, name: str) -> bool:
        """Tell whether it is about this parameter: `name` is COMPONENT.PARAMETER."""
        if not re.fullmatch(self.runner, runner):
            return False
        return any(re.fullmatch(pattern, name) for pattern in self.names)


@dataclass(frozen=True)
class Tuning:
    """What one user may set."""

    user: str
    rules: tuple[Rule, ...]

    def rule(self, runner: str, name: str) -> Rule:
        """Return the rule for a parameter, or refuse."""
        for rule in self.rules:
            if rule.allows(runner, name):
                return rule
        allowed = ", ".join(sorted({each for rule in self.rules for each in rule.names}))
        raise PermissionDenied(
            f"user {self.user} may not set {name} of runner {runner}, but what matches {allowed}: "
            "see [[access.parameters]] in rtcfd's settings",
            errors_pb2.REASON_PARAMETER_FORBIDDEN,
            parameter=name,
            user=self.user,
        )


def require_pace(
    rule: Rule, name: str, old: object, new: object, last: float | None, now: float
) -> None:
    """Refuse a change of a number that is faster than the rule allows; times in seconds."""
    if rule.most_per_s is None or not isinstance(old, int | float) or isinstance(old, bool):
        return
    if not isinstance(new, int | float):
        return  # of another type: its component refuses it
    pause_s = _FIRST_PAUSE_S if last is None else min(now - last, LONGEST_PAUSE_S)
    most = rule.most_per_s * pause_s
    # Written so that NaN is too fast.
    if not abs(new - old) <= most:
        raise FailedPrecondition(
            f"{name} may change by {rule.most_per_s:g} a second: from {old:g} to between "
            f"{old - most:g} and {old + most:g} for now, not to {new:g}",
            errors_pb2.REASON_PARAMETER_TOO_FAST,
            parameter=name,
        )


def bound(level: Level, rules: tuple[Rule, ...]) -> bool:
    """Tell whether rules bind a user with this right."""
    return bool(rules) and level < Level.OPERATE
