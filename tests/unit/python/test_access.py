"""Who may call what: rules, and what a refusal says."""

import os

import pytest
from rtcf.v1 import control_pb2
from rtcfd.access import rights
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access, Level
from rtcfd.common.refusals import PermissionDenied


class Named(Peer):
    """A peer of a name and groups that need not be in this machine's database."""

    def __init__(self, name: str, groups: set[str], uid: int = 4711) -> None:
        super().__init__(1, uid, frozenset())
        self.__dict__["names"] = (name, groups)

    @property
    def user(self) -> str:
        return str(self.__dict__["names"][0])

    def group_names(self) -> set[str]:
        return set(self.__dict__["names"][1])


RULES = rights.rules(
    {Level.OBSERVE: ["ann", "@lab"], Level.OPERATE: ["@shift"], Level.ADMIN: ["bob"]},
    default=Level.NONE,
)


@pytest.mark.parametrize(
    ("name", "groups", "level"),
    [
        ("nobody", set(), Level.NONE),
        ("x", {"lab"}, Level.OBSERVE),
        ("x", {"lab", "shift"}, Level.OPERATE),
        ("ann", {"shift"}, Level.OBSERVE),
        ("bob", {"lab"}, Level.ADMIN),
    ],
)
def test_a_users_own_rule_goes_before_the_highest_of_the_groups(
    name: str, groups: set[str], level: Level
) -> None:
    assert RULES.level(Named(name, groups)) == level


def test_root_and_our_own_user_may_do_everything() -> None:
    for uid in (0, os.geteuid()):
        assert RULES.level(Named("x", set(), uid)) == Level.ADMIN


def test_who_is_in_the_group_may_do_everything_unless_told_otherwise() -> None:
    assert Access().level(Named("x", set())) == Level.ADMIN


def test_only_administrators_load_code() -> None:
    for method in ("Load", "Replace", "Apply", "AddRunner", "SetRunner", "Reload"):
        assert rights.needed(method) == Level.ADMIN


def test_a_method_that_is_not_known_takes_an_administrator() -> None:
    assert rights.needed("SomethingNew") == Level.ADMIN


def test_every_query_is_open_to_observers() -> None:
    service = control_pb2.DESCRIPTOR.services_by_name["Control"]
    for method in service.methods:
        if method.name.startswith(("Get", "List", "Watch")):
            assert rights.needed(method.name) == Level.OBSERVE


def test_a_refusal_says_how_the_right_is_granted() -> None:
    with pytest.raises(PermissionDenied) as refused:
        RULES.check(Named("ann", set()), "Load")
    assert "user ann has only the right to observe" in str(refused.value)
    assert 'admin = ["ann"] under [access]' in str(refused.value)
