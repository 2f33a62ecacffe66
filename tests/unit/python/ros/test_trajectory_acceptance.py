"""The node follow_joint_trajectory finds its trajectory among those of other senders."""

from collections.abc import Iterable
from dataclasses import replace

import pytest
from rtcf_launch.follow_joint_trajectory import Server, _FailedError, _Sample

OURS, OTHER = 3_000_000_000, 7
BEFORE = _Sample(
    done=True, halted=False, accepted=4, seq=OTHER, rejected=1, position=[0.0], velocity=[0.0]
)
OTHER_ACCEPTED = replace(BEFORE, accepted=5)
OTHER_REJECTED = replace(BEFORE, rejected=2)


def acceptance(samples: Iterable[_Sample]) -> _Sample:
    server = object.__new__(Server)
    server._generator = "/trajectory"
    return server._await_acceptance(iter(samples), BEFORE, OURS)


@pytest.mark.parametrize("other", [OTHER_ACCEPTED, OTHER_REJECTED])
def test_a_trajectory_is_found_behind_another_senders(other: _Sample) -> None:
    ours = replace(other, accepted=other.accepted + 1, seq=OURS)
    assert acceptance([BEFORE, other, other, ours]) is ours


def test_a_rejected_trajectory_is_reported_soon() -> None:
    with pytest.raises(_FailedError, match="/trajectory rejects the trajectory"):
        acceptance([BEFORE, *[OTHER_REJECTED] * 20])


def test_another_senders_trajectory_is_no_acceptance() -> None:
    with pytest.raises(_FailedError, match="/trajectory does not read the trajectory"):
        acceptance([OTHER_ACCEPTED] * 3000)
