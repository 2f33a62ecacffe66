"""Rules on parameters and their rate of change: [[access.parameters]] of the settings.

A rule lets users with the right to observe set some parameters, and restricts users
with the right to tune to them.  Users with the right to operate are not restricted.
"""

import re
from dataclasses import dataclass

from rtcf.v1 import errors_pb2

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.common.refusals import FailedPrecondition, PermissionDenied

# The allowed step grows with the time since the last change, up to this time.
LONGEST_PAUSE_S = 10.0
_FIRST_PAUSE_S = 1.0  # assumed before the first change


@dataclass(frozen=True)
class Rule:
    """A set of users, and the parameters that they may set."""

    who: frozenset[str]  # users, and groups with @
    runner: str = ".*"  # regular expression that matches the whole name
    names: tuple[str, ...] = (".*",)  # likewise, for COMPONENT.PARAMETER
    most_per_s: float | None = None  # largest change of a number per second, in its unit

    def of(self, peer: Peer) -> bool:
        """Return whether the rule names this user or one of its groups."""
        return peer.user in self.who or not self.who.isdisjoint(f"@{each}" for each in peer.groups)

    def allows(self, runner: str, name: str) -> bool:
        """Return whether the rule covers a parameter; `name` is COMPONENT.PARAMETER."""
        if not re.fullmatch(self.runner, runner):
            return False
        return any(re.fullmatch(pattern, name) for pattern in self.names)


@dataclass(frozen=True)
class Tuning:
    """The rules that bind one user."""

    user: str
    rules: tuple[Rule, ...]

    def rule(self, runner: str, name: str) -> Rule:
        """Return the rule for a parameter; raises PermissionDenied if there is none."""
        for rule in self.rules:
            if rule.allows(runner, name):
                return rule
        allowed = ", ".join(sorted({each for rule in self.rules for each in rule.names}))
        raise PermissionDenied(
            f"user {self.user} may not set {name} of runner {runner}, only parameters that match "
            f"{allowed}: see [[access.parameters]] in rtcfd's settings",
            errors_pb2.REASON_PARAMETER_FORBIDDEN,
            parameter=name,
            user=self.user,
        )


def require_pace(
    rule: Rule, name: str, old: object, new: object, last: float | None, now: float
) -> None:
    """Raise FailedPrecondition if a number changes faster than the rule allows.

    `last` is the time of the last change (None: there was none), `now` the current time,
    both in seconds on one clock.
    """
    if rule.most_per_s is None or not isinstance(old, int | float) or isinstance(old, bool):
        return
    if not isinstance(new, int | float):
        return  # the component rejects a value of another type
    pause_s = _FIRST_PAUSE_S if last is None else min(now - last, LONGEST_PAUSE_S)
    most = rule.most_per_s * pause_s
    # "not <=" instead of ">": NaN must fail.
    if not abs(new - old) <= most:
        raise FailedPrecondition(
            f"{name} may change by {rule.most_per_s:g} a second: from {old:g} to between "
            f"{old - most:g} and {old + most:g} for now, not to {new:g}",
            errors_pb2.REASON_PARAMETER_TOO_FAST,
            parameter=name,
        )


def bound(level: Level, rules: tuple[Rule, ...]) -> bool:
    """Return whether rules bind a user with this right."""
    return bool(rules) and level < Level.OPERATE
