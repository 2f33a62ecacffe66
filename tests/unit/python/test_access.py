"""Access rights of calls: rules, and the texts of errors."""

import os

import pytest
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.enums import choices
from rtcfd.access import calls, rights
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access, Level
from rtcfd.common.refusals import PermissionDenied


def named(name: str, groups: set[str], uid: int = 4711, known: bool = True) -> Peer:
    """Return a peer with a name and groups, which need not exist on this machine."""
    return Peer(1, uid, name, frozenset(groups), known)


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
def test_a_users_own_rule_precedes_rules_of_groups(
    name: str, groups: set[str], level: Level
) -> None:
    assert RULES.level(named(name, groups)) == level


def test_root_and_our_own_user_may_do_everything() -> None:
    for uid in (0, os.geteuid()):
        assert RULES.level(named("x", set(), uid)) == Level.ADMIN


def test_group_members_may_do_everything_by_default() -> None:
    assert Access().level(named("x", set())) == Level.ADMIN


def test_only_administrators_load_code() -> None:
    for method in ("Load", "Replace", "Apply", "AddRunner", "SetRunner", "Reload"):
        assert rights.needed(method) == Level.ADMIN


def test_an_unknown_method_requires_an_administrator() -> None:
    assert rights.needed("SomethingNew") == Level.ADMIN


def test_the_table_has_exactly_the_calls() -> None:
    service = control_pb2.DESCRIPTOR.services_by_name["Control"]
    assert sorted(calls.CALLS) == sorted(method.name for method in service.methods)


def test_exactly_the_queries_are_open_to_observers() -> None:
    for name, call in calls.CALLS.items():
        asks = name.startswith(("Get", "List", "Read", "Watch"))
        assert (call.right == Level.OBSERVE) == asks, name


def test_the_levels_are_the_rights_of_the_protocol() -> None:
    assert {level.word: level.value for level in Level} == choices(runner_pb2.Right.DESCRIPTOR)


def test_an_unidentified_user_has_no_rights_if_rules_name_users() -> None:
    unknown = named("#4711", set(), known=False)
    assert RULES.level(unknown) == Level.NONE
    assert Access().level(unknown) == Level.ADMIN
    with pytest.raises(PermissionDenied, match="the user database does not answer"):
        RULES.check(unknown, "GetStatus")


def test_an_error_explains_how_the_right_is_granted() -> None:
    with pytest.raises(PermissionDenied) as refused:
        RULES.check(named("ann", set()), "Load")
    assert "user ann has only the right to observe" in str(refused.value)
    assert 'admin = ["ann"] under [access]' in str(refused.value)
