"""The rights of clients, by user and group, and the rules on single parameters.

Owned by the daemon; admission.py checks the rights before each call, operations/parameters.py the
rules ([[access.parameters]] of the settings) before each change.  A rule lets users with the right
to observe set some parameters, and restricts users with the right to tune to them.  Users with the
right to operate are not restricted.
"""

import grp
import logging
import os
import pwd
import re
import stat
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import errors_pb2

from rtcfd.access import calls
from rtcfd.access.calls import WORDS, Level
from rtcfd.access.peer import Peer
from rtcfd.common.errors import FailedPrecondition, PermissionDenied

__all__ = ["WORDS", "Access", "Level", "Rule", "Tuning", "require_pace", "rules"]

log = logging.getLogger(__name__)

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


@dataclass(frozen=True)
class Access:
    """The rules.  A user's own rule overrides those of groups; of several groups, the highest
    right counts."""

    default: Level = Level.ADMIN  # for clients without a rule
    users: Mapping[str, Level] = field(default_factory=dict)
    groups: Mapping[str, Level] = field(default_factory=dict)
    parameters: tuple[Rule, ...] = ()

    def tuning(self, peer: Peer) -> Tuning | None:
        """Return the parameter rules that bind a peer; None: its right alone decides."""
        rules = tuple(rule for rule in self.parameters if rule.of(peer))
        bound = bool(rules) and self.level(peer) < Level.OPERATE
        return Tuning(peer.user, rules) if bound else None

    def level(self, peer: Peer) -> Level:
        """Return the right of a peer."""
        # Root can become any user, and our own user owns the executors.
        if peer.uid in (0, os.geteuid()):
            return Level.ADMIN
        if not peer.known and (self.users or self.groups):
            return Level.NONE
        if peer.user in self.users:
            return self.users[peer.user]
        ruled = [self.groups[name] for name in peer.groups & set(self.groups)]
        return max(ruled, default=self.default)

    def check(self, peer: Peer, method: str) -> None:
        """Raise PermissionDenied if a peer may not make a call."""
        has, wants = self.level(peer), calls.of(method).right
        if has >= wants:
            return
        if wants == Level.TUNE and has == Level.OBSERVE and self.tuning(peer) is not None:
            return  # the handler of the call checks each parameter
        if not peer.known:
            raise PermissionDenied(
                f"{method} requires the right to {_deed(wants)}, and the name and groups of user "
                f"{peer.user} are unknown: the user database does not answer",
                errors_pb2.REASON_RIGHT_MISSING,
                right=wants.word,
                user=peer.user,
            )
        raise PermissionDenied(
            f"{method} requires the right to {_deed(wants)}, and user {peer.user} has "
            f"{'none' if has == Level.NONE else f'only the right to {_deed(has)}'}: an "
            f'administrator grants it by {wants.word} = ["{peer.user}"] under [access] in '
            "rtcfd's settings and `systemctl reload rtcfd`",
            errors_pb2.REASON_RIGHT_MISSING,
            right=wants.word,
            user=peer.user,
        )

    def unknown(self) -> list[str]:
        """Return the users and @groups of the rules that do not exist.

        May block: asks the user database.
        """
        names = {*self.users, *(f"@{group}" for group in self.groups)}
        names.update(name for rule in self.parameters for name in rule.who)
        return sorted(name for name in names if not _exists(name))

    def for_executors(self, control_socket: Path) -> wire.AccessRules:
        """Return the rules with uids and gids, and the permissions of the control socket.

        May block: asks the user database.  Rules with unknown names are left out.
        """
        found = wire.AccessRules(others=self.default.right)
        for name, level in self.users.items():
            try:
                found.users.add(id=pwd.getpwnam(name).pw_uid, right=level.right)
            except KeyError:
                log.warning("[access] names the unknown user %s", name)
        for name, level in self.groups.items():
            try:
                found.groups.add(id=grp.getgrnam(name).gr_gid, right=level.right)
            except KeyError:
                log.warning("[access] names the unknown group %s", name)
        try:
            there = control_socket.stat()
        except OSError:
            return found
        if there.st_mode & stat.S_IWGRP:
            found.door_group = there.st_gid
        found.door_open = bool(there.st_mode & stat.S_IWOTH)
        return found


def _exists(name: str) -> bool:
    try:
        grp.getgrnam(name[1:]) if name.startswith("@") else pwd.getpwnam(name)
    except KeyError:
        return False
    return True


def rules(
    named: Mapping[Level, Collection[str]], default: Level, parameters: tuple[Rule, ...] = ()
) -> Access:
    """Build the rules of a settings file; names that begin with @ are groups."""
    users: dict[str, Level] = {}
    groups: dict[str, Level] = {}
    for level in sorted(named):
        for name in named[level]:
            if name.startswith("@"):
                groups[name[1:]] = level
            else:
                users[name] = level
    return Access(default, users, groups, parameters)


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


def _deed(level: Level) -> str:
    return "administer" if level == Level.ADMIN else level.word
