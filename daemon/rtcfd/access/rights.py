"""What a client may do: observe, operate, or everything, by its user and groups.

Owned by the daemon; asked by admission.py before each call.
"""

import enum
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from rtcfd.access.peer import Peer
from rtcfd.common.refusals import PermissionDenied


class Level(enum.IntEnum):
    """Rights, each with those before it."""

    NONE = 0
    OBSERVE = 1  # see everything, change nothing
    OPERATE = 2  # run what is there: loops, parameters, loop breaks
    ADMIN = 3  # decide what is there: load code, make runners, settings

    @property
    def word(self) -> str:
        """Return it as the settings write it."""
        return self.name.lower()


WORDS = {level.word: level for level in Level}

# Calls that change what runs, but not what there is to run.
_OPERATE = frozenset(
    {
        "Start",
        "Stop",
        "Step",
        "Replay",
        "SetBreaks",
        "SetParameters",
        "Release",
        "ResetStatistics",
        "RestartRunner",
    }
)
_OBSERVING = ("Get", "List", "Watch")


def needed(method: str) -> Level:
    """Return what a method of rtcf.v1.Control takes; one that is not known here: admin."""
    if method.startswith(_OBSERVING):
        return Level.OBSERVE
    return Level.OPERATE if method in _OPERATE else Level.ADMIN


@dataclass(frozen=True)
class Access:
    """The rules: a user's own rule goes before those of groups, of these the highest counts."""

    default: Level = Level.ADMIN  # of whoever may connect and is not named
    users: Mapping[str, Level] = field(default_factory=dict)
    groups: Mapping[str, Level] = field(default_factory=dict)

    def level(self, peer: Peer) -> Level:
        """Return what a peer may do."""
        # Root can become anybody, and our own user owns the executors.
        if peer.uid in (0, os.geteuid()):
            return Level.ADMIN
        if peer.user in self.users:
            return self.users[peer.user]
        ruled = [self.groups[name] for name in peer.group_names() & set(self.groups)]
        return max(ruled, default=self.default)

    def check(self, peer: Peer, method: str) -> None:
        """Refuse a call that a peer may not make."""
        has, wants = self.level(peer), needed(method)
        if has >= wants:
            return
        raise PermissionDenied(
            f"{method} takes the right to {_deed(wants)}, and user {peer.user} has "
            f"{f'only the right to {_deed(has)}' if has else 'none'}: an administrator grants it "
            f'by {wants.word} = ["{peer.user}"] under [access] in rtcfd\'s settings '
            "and `systemctl reload rtcfd`"
        )


def rules(named: Mapping[Level, Collection[str]], default: Level) -> Access:
    """Return the rules that a settings file gives; names that begin with @ are groups."""
    users: dict[str, Level] = {}
    groups: dict[str, Level] = {}
    for level in sorted(named):
        for name in named[level]:
            if name.startswith("@"):
                groups[name[1:]] = level
            else:
                users[name] = level
    return Access(default, users, groups)


def _deed(level: Level) -> str:
    return "administer" if level == Level.ADMIN else level.word
