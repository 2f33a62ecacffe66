"""Who may call what: rules, and what a refusal says."""

import os

import pytest
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.enums import choices
from rtcfd.access import calls, rights
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access, Level
from rtcfd.common.refusals import PermissionDenied


def named(name: str, groups: set[str], uid: int = 4711, known: bool = True) -> Peer:
    """Return a peer of a name and groups that need not be in this machine's database."""
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
def test_a_users_own_rule_goes_before_the_highest_of_the_groups(
    name: str, groups: set[str], level: Level
) -> None:
    assert RULES.level(named(name, groups)) == level


def test_root_and_our_own_user_may_do_everything() -> None:
    for uid in (0, os.geteuid()):
        assert RULES.level(named("x", set(), uid)) == Level.ADMIN


def test_who_is_in_the_group_may_do_everything_unless_told_otherwise() -> None:
    assert Access().level(named("x", set())) == Level.ADMIN


def test_only_administrators_load_code() -> None:
    for method in ("Load", "Replace", "Apply", "AddRunner", "SetRunner", "Reload"):
        assert rights.needed(method) == Level.ADMIN


def test_a_method_that_is_not_known_takes_an_administrator() -> None:
    assert rights.needed("SomethingNew") == Level.ADMIN


def test_every_call_is_in_the_table_and_nothing_else() -> None:
    service = control_pb2.DESCRIPTOR.services_by_name["Control"]
    assert sorted(calls.CALLS) == sorted(method.name for method in service.methods)


def test_what_is_named_like_a_query_is_open_to_observers_alone() -> None:
    for name, call in calls.CALLS.items():
        asks = name.startswith(("Get", "List", "Read", "Watch"))
        assert (call.right == Level.OBSERVE) == asks, name


def test_the_levels_are_the_rights_of_the_protocol() -> None:
    assert {level.word: level.value for level in Level} == choices(runner_pb2.Right.DESCRIPTOR)


def test_who_cannot_be_found_out_has_no_right_where_names_have() -> None:
    unknown = named("#4711", set(), known=False)
    assert RULES.level(unknown) == Level.NONE
    assert Access().level(unknown) == Level.ADMIN
    with pytest.raises(PermissionDenied, match="the user database does not answer"):
        RULES.check(unknown, "GetStatus")


def test_a_refusal_says_how_the_right_is_granted() -> None:
    with pytest.raises(PermissionDenied) as refused:
        RULES.check(named("ann", set()), "Load")
    assert "user ann has only the right to observe" in str(refused.value)
    assert 'admin = ["ann"] under [access]' in str(refused.value)
