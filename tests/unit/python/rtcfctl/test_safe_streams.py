"""Texts of other users on the terminal: their control characters are shown as escapes."""

import io
import json
import random
import subprocess
import unicodedata

import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2
from rtcfctl.terminal.output import Output, styled
from rtcfctl.terminal.safe_streams import SafeStream, safe_streams

ATTACK = "\x1b]0;PWN\x07\x1b[2J\x9b31m\r\x7f\u202eabc\u2066\x00\u200b\udc80"


def printed(*texts: str) -> str:
    out = io.StringIO()
    for each in texts:
        print(each, file=SafeStream(out))
    return out.getvalue()


def test_control_characters_are_printed_as_escapes() -> None:
    text = printed(ATTACK, "two\nlines\tand µ, ∞, 日本")
    assert text.splitlines()[0] == (
        r"\x1b]0;PWN\x07\x1b[2J\x9b31m\r\x7f\u202eabc\u2066\x00\u200b\udc80"
    )
    assert text.endswith("\ntwo\nlines\tand µ, ∞, 日本\n")


def test_own_colours_pass_and_others_inside_do_not() -> None:
    assert printed(styled(f"a{ATTACK[:7]}", "bold red", True)) == (
        "\x1b[1;31ma\\x1b]0;PWN\x1b[0m\n"
    )


def test_no_text_of_others_has_effect() -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    kinds = [chr(k) for k in range(0x300)] + [chr(k) for k in range(0x2000, 0x2100)]
    for _ in range(500):
        text = printed("".join(draw.choices(kinds, k=40)))
        odd = [each for each in text if unicodedata.category(each) in ("Cc", "Cf", "Cs", "Co")]
        assert set(odd) <= {"\n", "\t"}


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_programs_get_the_text_itself(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = ATTACK.replace("\udc80", "") + "\U000e0041"
    with safe_streams():
        Output(kind).data({"holder": text, "other": "µ"})
    out = capsys.readouterr().out
    assert out.replace("\n", "").isprintable()
    read = json.loads(out) if kind == "json" else yaml.safe_load(out)
    assert read == {"holder": text, "other": "µ"}


def test_holders_and_reasons_are_one_line(client: rtcf.Client) -> None:
    spec = rtcf.component("demo", "Fine", name="held")
    lease = client.lease_component(control_pb2.OpenLease(component=spec, holder=ATTACK[:-1]))
    wait_for(lambda: client.get_order() == ["/held"], "the lease")
    assert client.get_component("held").holder == printed(ATTACK[:-1])[:-1]
    lease.end()
    with pytest.raises(rtcf.RefusedError, match="reason 'a.nb' has unprintable characters"):
        client.take_incident(reason="a\nb")


def test_errors_about_odd_names_are_shown_safely(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.get_status()
    for command in (("load", "p\x1b[31m", "T"), ("info", "\u202en"), ("runner", "add", "\x07r")):
        done = daemon.ctl(*command)
        assert done.returncode != 0
        assert done.stderr.replace("\n", "").isprintable()
    assert daemon.log().replace("\n", "").replace("\t", "").isprintable()


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_a_change_succeeds_with_closed_output(
    daemon: DaemonUnderTest, client: rtcf.Client, closed: str
) -> None:
    client.start()
    done = subprocess.run(
        ["sh", "-c", f'exec "$@" {closed}', "sh", BUILD_TREE / "bin" / "rtcfctl",
         "--socket", str(daemon.socket), "stop"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
