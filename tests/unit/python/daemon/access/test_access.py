"""Access rights of calls, and rules for setting parameters: users, parameters, rates of change."""

import os
from pathlib import Path

import pytest
import rtcf
from daemon_process import wait_for
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.enums import choices
from rtcfd.access import calls, rights
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access, Level, Rule, require_pace
from rtcfd.common.errors import FailedPrecondition, PermissionDenied, RequestError
from rtcfd.configuration import settings_file
from strangers import open_to_strangers, root_only, stranger

SET = """
import sys, rtcf
with rtcf.Client(sys.argv[1]) as client:
    for setting in sys.argv[2:]:
        try:
            client.set_parameters("pid", [rtcf.parse_parameter(setting)])
            print("set", flush=True)
        except rtcf.RtcfError as error:
            print(error, flush=True)
"""
TEXT = """
[access]
default = "none"
observe = ["ann"]
tune = ["tom"]
operate = ["bob"]
[[access.parameters]]
who = ["ann", "tom", "bob", "@lab"]
runner = "arm"
names = ["/pid\\\\.k.*"]
most_per_s = 0.5
"""


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
        assert calls.of(method).right == Level.ADMIN


def test_an_unknown_method_requires_an_administrator() -> None:
    assert calls.of("SomethingNew").right == Level.ADMIN


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


def peer(user: str, *groups: str) -> Peer:
    return Peer(1, 4711, user, frozenset(groups))


@pytest.fixture
def access(tmp_path: Path) -> rights.Access:
    file = tmp_path / "rtcfd.toml"
    file.write_text(TEXT)
    return settings_file.read(file).access


def test_a_named_user_may_set_only_the_named_parameters(access: rights.Access) -> None:
    access.check(peer("ann"), "SetParameters")
    tuning = access.tuning(peer("ann"))
    assert tuning is not None
    assert tuning.rule("arm", "/pid.kp").most_per_s == 0.5
    for runner, name in (("arm", "/pid.limit"), ("leg", "/pid.kp"), ("arm", "/other/pid.kp")):
        with pytest.raises(PermissionDenied, match=f"user ann may not set {name} of runner"):
            tuning.rule(runner, name)
    with pytest.raises(PermissionDenied):
        access.check(peer("ann"), "Stop")


def test_rules_apply_to_tune_and_not_to_operate(access: rights.Access) -> None:
    assert access.tuning(peer("tom")) is not None
    assert access.tuning(peer("bob")) is None
    access.check(peer("bob"), "SetParameters")


def test_a_rule_grants_nothing_without_the_right_to_observe(access: rights.Access) -> None:
    assert access.level(peer("x", "lab")) == Level.NONE
    with pytest.raises(PermissionDenied):
        access.check(peer("x", "lab"), "SetParameters")


@pytest.mark.parametrize(
    ("old", "new", "pause_s", "fits"),
    [
        (1.0, 1.5, None, True),
        (1.0, 1.6, None, False),
        (1.0, 0.4, 1.0, False),
        (1.0, 3.0, 4.0, True),
        (1.0, 7.0, 3600.0, False),  # a long pause permits no large step
        (1.0, float("nan"), 1.0, False),
        (1, 2, 1.0, False),
        ("a", "b", 0.0, True),
        (True, False, 0.0, True),
    ],
)
def test_a_number_changes_no_faster_than_its_rule_allows(
    old: object, new: object, pause_s: float | None, fits: bool
) -> None:
    rule = Rule(frozenset({"ann"}), most_per_s=0.5)
    last = None if pause_s is None else 100.0
    now = 100.0 + (pause_s or 0.0)
    if fits:
        require_pace(rule, "/pid.kp", old, new, last, now)
        return
    with pytest.raises(FailedPrecondition, match="/pid.kp may change by 0.5 a second"):
        require_pace(rule, "/pid.kp", old, new, last, now)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("who = 'ann'", "who must be a list of users and @groups"),
        ("who = ['a b']", "who must be a list of users and @groups"),
        ("who = ['a']\nnames = ['(']", "'(' is not a regular expression"),
        ("who = ['a']\nmost_per_s = 0", "most_per_s must be above 0"),
        ("who = ['a']\npace = 1", "unknown key"),
    ],
)
def test_a_bad_rule_is_rejected(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "rtcfd.toml"
    file.write_text(f"[[access.parameters]]\n{text}\n")
    with pytest.raises(RequestError) as refused:
        settings_file.read(file)
    assert said in str(refused.value)


@root_only
def test_an_observer_may_set_a_rules_parameters_at_its_rate() -> None:
    rules = (
        "[access]\nobserve = ['nobody']\n"
        "[[access.parameters]]\nwho = ['nobody']\nnames = ['/pid.kp']\nmost_per_s = 0.001\n"
    )
    with open_to_strangers(rules) as daemon:
        daemon.package("demo", types={"Fine": "fine"})
        with daemon.client() as client:
            client.load(rtcf.component("demo", "Fine", name="pid", parameters=["kp:=1.0"]))
        words = ("kp:=1.0001", "kp:=9.0", "ki:=1.0")
        with stranger(SET, str(daemon.socket), *words, user="nobody") as process:
            assert process.stdout is not None
            said = [process.stdout.readline() for _ in words]
        assert said[0] == "set\n"
        assert "/pid.kp may change by 0.001 a second" in said[1]
        assert "user nobody may not set /pid.ki" in said[2]
        wait_for(lambda: "/pid: kp = 1.0001 set by nobody" in daemon.log(), "the log")
