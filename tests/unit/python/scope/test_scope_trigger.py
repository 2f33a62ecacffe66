"""The cycles at which a trigger hits."""

import numpy as np
import pytest
from rtcf_scope.trigger import Search, TriggerError, parse

_BASE = {"signal": "/a.b", "before": 1, "after": 1}
_NAN = float("nan")


def _hits(values: list[float], **told: object) -> list[int]:
    return [int(each) for each in Search(parse(_BASE | told)).hits(np.array(values))]


@pytest.mark.parametrize(
    ("told", "values", "hits"),
    [
        ({"kind": "edge", "low": 1.0}, [0, 1, 2, 0, 3], [1, 4]),
        ({"kind": "edge", "low": 1.0, "slope": "falling"}, [2, 1, 0, 2, 0], [1, 4]),
        ({"kind": "edge", "low": 1.0, "slope": "either"}, [0, 2, 0], [1, 2]),
        ({"kind": "edge", "low": 1.0}, [_NAN, 2, 0, 1], [3]),
        # Noise around the level is one edge, until the signal was beyond the hysteresis again.
        (
            {"kind": "edge", "low": 1.0, "hysteresis": 0.5},
            [0, 1.1, 0.9, 1.1, 0.6, 1.2, 0.5, 1.0, 0.4, 1.0],
            [1, 9],
        ),
        (
            {"kind": "edge", "low": 1.0, "slope": "falling", "hysteresis": 0.5},
            [2, 1, 1.4, 0.9, 1.6, 1.2, 1.0],
            [1, 6],
        ),
        ({"kind": "edge", "low": 1.0, "slope": "either", "hysteresis": 1}, [-1, 2, 3, 0.5], [1, 3]),
        ({"kind": "edge", "low": 1.0, "hysteresis": 0.5}, [0, 0.8, 1.0, _NAN, 1.0], [2]),
        ({"kind": "edge", "low": 1.0, "hysteresis": 0.5}, [0, _NAN, 1.0], []),
        ({"kind": "level", "low": 1.0}, [0, 1, 2, _NAN, 0], [1, 2]),
        ({"kind": "level", "low": 1.0, "slope": "below"}, [0, 1, 2], [0, 1]),
        ({"kind": "window", "low": -1.0, "high": 1.0}, [0, 2, 3, 0, -2], [1, 4]),
        ({"kind": "window", "low": -1.0, "high": 1.0}, [0, _NAN, 0], [1]),
        ({"kind": "window", "low": -1.0, "high": 1.0, "slope": "enters"}, [2, 0, 0, 2], [1]),
        ({"kind": "nan"}, [0, _NAN, 1, float("inf")], [1, 3]),
    ],
)
def test_a_trigger_hits_the_expected_cycles(
    told: dict[str, object], values: list[float], hits: list[int]
) -> None:
    assert _hits(values, **told) == hits


@pytest.mark.parametrize("kind", ["edge", "window", "level", "nan"])
def test_the_hits_do_not_depend_on_the_batches(kind: str) -> None:
    values = np.random.default_rng(12).normal(size=500)
    values[100:103] = np.nan
    trigger = parse(_BASE | {"kind": kind, "low": 0.5, "high": 1.0, "hysteresis": 0.7})
    whole = Search(trigger).hits(values).tolist()
    assert whole
    for size in (1, 7, 64):
        search = Search(trigger)
        found: list[int] = []
        for at in range(0, len(values), size):
            found += [int(hit) + at for hit in search.hits(values[at : at + size])]
        assert found == whole


@pytest.mark.parametrize("size", [1, 3, 100])
def test_a_condition_hits_where_it_becomes_true(size: int) -> None:
    trigger = parse(_BASE | {"kind": "condition", "condition": "a.x > 1 and not b.y"})
    assert trigger.signals == ["/a.x", "/b.y"]
    x, y = np.array([2.0, 2, 0, 2, 2, 2, _NAN, 2]), np.array([0.0, 0, 0, 0, 1, 0, 0, 0])
    search = Search(trigger)
    found: list[int] = []
    for at in range(0, len(x), size):
        found += [int(hit) + at for hit in search.hits(x[at : at + size], y[at : at + size])]
    # Not in the first cycle, as its predecessor is unknown.
    assert found == [3, 5, 7]


def test_an_invalid_condition_is_rejected() -> None:
    with pytest.raises(TriggerError, match="is not a condition"):
        parse(_BASE | {"kind": "condition", "condition": "a.x >"})


def test_an_unsupported_slope_is_rejected() -> None:
    with pytest.raises(TriggerError, match="edge 'above': must be one of rising, falling, either"):
        parse(_BASE | {"kind": "edge", "slope": "above"})


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"low": "high"}, "invalid number in the trigger"),
        ({"low": _NAN}, "levels of a trigger must be finite"),
        ({"after": 0}, "after must be at least 1 cycle"),
        ({"before": -1}, "after must be at least 1 cycle"),
        ({"holdoff": -1}, "after must be at least 1 cycle"),
        ({"hysteresis": -0.1}, "hysteresis of a trigger must be at least 0"),
        ({"hysteresis": _NAN}, "levels of a trigger must be finite"),
    ],
)
def test_impossible_numbers_are_rejected(told: dict[str, object], said: str) -> None:
    with pytest.raises(TriggerError, match=said):
        parse(_BASE | {"kind": "edge"} | told)
