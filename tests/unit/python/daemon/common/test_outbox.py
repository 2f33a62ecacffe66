"""A slow lease holder loses counted log records, and nothing else."""

import asyncio
from typing import Any

from rtcf.v1 import control_pb2
from rtcfd.runners.outbox import MOST_RECORDS, Outbox


def collect(outbox: Outbox) -> list[Any]:
    async def run() -> list[Any]:
        return [message async for message in outbox]

    return asyncio.run(run())


def test_a_slow_holder_loses_only_the_oldest_records_counted() -> None:
    outbox = Outbox(control_pb2.LeaseComponentResponse)
    outbox.say(loaded=control_pb2.ChangeResult(component="/a"))
    for i in range(MOST_RECORDS + 5):
        outbox.log(control_pb2.LogRecord(message=str(i)))
    outbox.end(control_pb2.LeaseEnded.WHY_ASKED, "done")
    messages = collect(outbox)
    assert messages[0].loaded.component == "/a"
    assert messages[-1].ended.message == "done"
    batches = [message.logs for message in messages[1:-1]]
    assert [batch.dropped for batch in batches] == [5] + [0] * (len(batches) - 1)
    records = [record.message for batch in batches for record in batch.records]
    assert records == [str(i) for i in range(5, MOST_RECORDS + 5)]


def test_a_slow_holder_gets_the_newest_report_only() -> None:
    outbox = Outbox(control_pb2.HoldRunnerResponse)
    for count in range(100):
        outbox.report(control_pb2.HoldReport(components=count))
    outbox.end(control_pb2.LeaseEnded.WHY_ASKED)
    assert [message.report.components for message in collect(outbox)[:-1]] == [99]


def test_the_first_reason_of_an_end_is_kept() -> None:
    outbox = Outbox(control_pb2.HoldRunnerResponse)
    outbox.end(control_pb2.LeaseEnded.WHY_FAILED, "first")
    outbox.end(control_pb2.LeaseEnded.WHY_DAEMON_ENDED, "second")
    (message,) = collect(outbox)
    assert (message.ended.why, message.ended.message) == (
        control_pb2.LeaseEnded.WHY_FAILED,
        "first",
    )
