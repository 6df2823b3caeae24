"""Known cases of the simulation: `pytest docs/test_scale.py`."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scale import Cluster, Losses, Prices, simulate

PLAIN = Cluster(
    captures=4,
    nodes=1,
    slots=2,
    cpus=2,
    cpu_seconds=8.0,
    spread=0.0,
    straggler_share=0.0,
    efficiency=1.0,
    input_bytes=1e9,
    output_bytes=1e9,
    slot_bandwidth=2e9,
    input_files=200,
    output_files=60,
    start_seconds=1.0,
    node_hours=math.inf,
    bad_share=0.0,
    dispatch=1e9,
)
"""Four captures of ten seconds on two slots."""


def test_a_batch_without_losses_takes_what_can_be_computed_by_hand() -> None:
    result = simulate(PLAIN, Prices(node_hour=36.0, get_1000=1.0, put_1000=2.0, gigabyte_month=0.5, months=2.0))
    assert result.hours * 3600.0 == pytest.approx(20.0)
    assert result.ideal_hours * 3600.0 == pytest.approx(20.0)
    assert (result.done, result.busy_share, result.wasted_share) == (4, pytest.approx(1.0), 0.0)
    # 20 s of one node; four times 200 reads and 61 writes; 8 GB for two months; per 1000 captures.
    assert result.compute_per_1000 == pytest.approx(250.0 * 20.0 / 3600.0 * 36.0)
    assert result.requests_per_1000 == pytest.approx(200.0 * 1.0 + 61.0 * 2.0)
    assert result.storage_per_1000 == pytest.approx(250.0 * 8.0 * 0.5 * 2.0)
    assert result.cost_per_1000 == pytest.approx(
        result.compute_per_1000 + result.requests_per_1000 + result.storage_per_1000
    )


def test_a_lost_node_repeats_what_ran_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Losses, "after", lambda self, node, time: 5.0 if time < 5.0 else math.inf)
    result = simulate(replace(PLAIN, captures=2, replace_seconds=3.0), Prices())
    # Both run from 0 to 5 and again from 8 to 18.
    assert result.hours * 3600.0 == pytest.approx(18.0)
    assert (result.node_losses, result.repeated, result.lost, result.done) == (1, 2, 0, 2)
    assert result.wasted_share == pytest.approx(10.0 / 30.0)
    monkeypatch.setattr(Losses, "after", lambda self, node, time: time + 1.0)
    given_up = simulate(replace(PLAIN, captures=2), Prices())
    assert (given_up.lost, given_up.done, given_up.repeated) == (2, 0, 6)


def test_the_driver_limits_how_many_captures_start() -> None:
    result = simulate(replace(PLAIN, nodes=1000, captures=1000, dispatch=10.0), Prices())
    assert result.hours * 3600.0 == pytest.approx(110.0, rel=0.01)


def test_the_same_seed_gives_the_same_numbers() -> None:
    cluster = Cluster(captures=2000, nodes=4, node_hours=0.5)
    assert simulate(cluster, Prices()) == simulate(cluster, Prices())
    assert simulate(replace(cluster, seed=1), Prices()) != simulate(cluster, Prices())
    found = simulate(cluster, Prices())
    assert found.done + found.bad + found.over_limit + found.lost == 2000
