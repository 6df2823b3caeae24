#!/usr/bin/env python3
"""Simulates a batch of many captures on a cluster, and computes its cost: `docs/scale.py`. `--help` lists the parameters.

Captures wait in one queue. A free slot of a node takes the next one; the driver starts at most `--dispatch` per second. Times are
lognormal with a share of stragglers whose factor has a Pareto distribution, up to a limit. A node is lost after an exponential time; its captures
are repeated from the start, at most `--retries` times. The same seed gives the same numbers. Prices are examples: replace them by yours.
"""

from __future__ import annotations

import argparse
import heapq
import json
import math
from collections import deque
from dataclasses import asdict, dataclass, fields, replace

import numpy as np


@dataclass(frozen=True)
class Cluster:
    """Nodes, and what a capture takes. Times in seconds, sizes in bytes."""

    captures: int = 1_000_000
    nodes: int = 400
    slots: int = 16
    """Captures at a time on a node."""
    cpus: int = 16
    """Processors of a node; a capture has an equal share of them."""
    cpu_seconds: float = 115.0
    """Median processor time of a capture."""
    spread: float = 0.89
    """Standard deviation of the logarithm of the time."""
    straggler_share: float = 0.01
    """Share of captures that are stragglers."""
    straggler_exponent: float = 1.5
    """Pareto exponent of their factor, which is at least 1."""
    limit: float = 3600.0
    """Longest run; a longer one is ended and fails."""
    efficiency: float = 0.9
    """Processor time divided by wall-clock time and processors of the slot."""
    input_bytes: float = 17e6
    output_bytes: float = 150e6
    input_files: int = 330
    output_files: int = 820
    slot_bandwidth: float = 50e6
    """Bytes per second between storage and a slot."""
    start_seconds: float = 2.0
    """Start of a process, and everything else that a capture waits for."""
    node_hours: float = 24.0
    """Mean time until a node is lost."""
    replace_seconds: float = 180.0
    """Time until a lost node is replaced."""
    bad_share: float = 0.02
    """Captures that fail for a reason that remains, after a tenth of their time."""
    retries: int = 2
    dispatch: float = 200.0
    """Captures that the driver can start per second."""
    seed: int = 0


@dataclass(frozen=True)
class Prices:
    """Examples in one currency."""

    node_hour: float = 0.30
    """An interruptible node of 16 processors."""
    get_1000: float = 0.0004
    put_1000: float = 0.005
    gigabyte_month: float = 0.023
    months: float = 1.0
    """Time that results are kept."""


@dataclass(frozen=True)
class Result:
    """What a batch took."""

    hours: float
    """Until the last capture has ended."""
    hours_99: float
    """Until 99 % have ended."""
    ideal_hours: float
    """If all slots were busy all the time without losses."""
    done: int
    bad: int
    """Failed for a reason that remains."""
    over_limit: int
    lost: int
    """Given up after the retries."""
    node_losses: int
    repeated: int
    """Runs that a lost node ended."""
    wasted_share: float
    """Slot time of those runs, of all slot time used."""
    busy_share: float
    """Slot time used, of the slot time of all nodes until the end."""
    node_hours: float
    terabytes_in: float
    terabytes_out: float
    gets_per_second: float
    puts_per_second: float
    gigabit_per_second: float
    cost_per_1000: float
    compute_per_1000: float
    requests_per_1000: float
    storage_per_1000: float


def durations(cluster: Cluster, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Slot seconds of every capture without losses, and how it ends: 0 done, 1 bad, 2 over the limit; 3 is for lost."""
    n = cluster.captures
    cpu = cluster.cpu_seconds * np.exp(cluster.spread * random.standard_normal(n))
    stragglers = random.random(n) < cluster.straggler_share
    factor = 1.0 + random.pareto(cluster.straggler_exponent, n)
    cpu = np.where(stragglers, cpu * factor, cpu)
    run = cpu / (cluster.cpus / cluster.slots * cluster.efficiency)
    bad = random.random(n) < cluster.bad_share
    run = np.where(bad, 0.1 * run, run)
    over = run > cluster.limit
    move = (cluster.input_bytes + np.where(bad | over, 0.0, cluster.output_bytes)) / cluster.slot_bandwidth
    ends = np.where(bad, 1, np.where(over, 2, 0))
    return np.minimum(run, cluster.limit) + move + cluster.start_seconds, ends


class Losses:
    """When nodes are lost."""

    def __init__(self, cluster: Cluster, random: np.random.Generator) -> None:
        self.mean, self.random = cluster.node_hours * 3600.0, random
        self.times: list[list[float]] = [[] for _ in range(cluster.nodes)]

    def after(self, node: int, time: float) -> float:
        """The first loss of a node after a time."""
        if math.isinf(self.mean):
            return math.inf
        times = self.times[node]
        while not times or times[-1] <= time:
            times.append((times[-1] if times else 0.0) + float(self.random.exponential(self.mean)))
        # Slots of a node ask for times that lie close together.
        index = len(times) - 1
        while index > 0 and times[index - 1] > time:
            index -= 1
        return times[index]


def simulate(cluster: Cluster, prices: Prices) -> Result:
    """The batch, event by event."""
    random = np.random.default_rng(cluster.seed)
    times, ends = durations(cluster, random)
    losses = Losses(cluster, random)
    free = [(0.0, slot) for slot in range(cluster.nodes * cluster.slots)]
    waiting: deque[int] = deque(range(cluster.captures))
    again: list[tuple[float, int]] = []
    attempts = np.zeros(cluster.captures, dtype=np.int64)
    finished = np.full(cluster.captures, np.nan)
    used = wasted = last_start = 0.0
    repeated = started = 0
    lost_at: set[tuple[int, float]] = set()
    while waiting or again:
        now, slot = heapq.heappop(free)
        if again and (again[0][0] <= now or not waiting):
            ready, capture = heapq.heappop(again)
            now = max(now, ready)
        else:
            capture = waiting.popleft()
        # A node that is lost while the slot waits only delays it.
        begin = max(now, last_start + 1.0 / cluster.dispatch)
        last_start = begin
        node = slot // cluster.slots
        end, loss = begin + float(times[capture]), losses.after(node, begin)
        started += 1
        attempts[capture] += 1
        if loss < end:
            lost_at.add((node, loss))
            used += loss - begin
            wasted += loss - begin
            repeated += 1
            heapq.heappush(free, (loss + cluster.replace_seconds, slot))
            if attempts[capture] <= cluster.retries:
                heapq.heappush(again, (loss, capture))
            else:
                ends[capture] = 3
                finished[capture] = loss
            continue
        used += end - begin
        finished[capture] = end
        heapq.heappush(free, (end, slot))
    ordered = np.sort(finished)
    span = float(ordered[-1])
    done, bad, over_limit, lost = (int(np.count_nonzero(ends == how)) for how in range(4))
    gets, puts = started * cluster.input_files, done * cluster.output_files + cluster.captures
    moved_in, moved_out = started * cluster.input_bytes, done * cluster.output_bytes
    node_hours = cluster.nodes * span / 3600.0
    thousands = cluster.captures / 1000.0
    compute = node_hours * prices.node_hour / thousands
    requests = (gets * prices.get_1000 + puts * prices.put_1000) / 1000.0 / thousands
    kept = (cluster.captures * cluster.input_bytes + moved_out) / 1e9
    storage = kept * prices.gigabyte_month * prices.months / thousands
    return Result(
        hours=span / 3600.0,
        hours_99=float(ordered[math.ceil(0.99 * len(ordered)) - 1]) / 3600.0,
        ideal_hours=float(times.sum()) / (cluster.nodes * cluster.slots) / 3600.0,
        done=done,
        bad=bad,
        over_limit=over_limit,
        lost=lost,
        node_losses=len(lost_at),
        repeated=repeated,
        wasted_share=wasted / used,
        busy_share=used / (span * cluster.nodes * cluster.slots),
        node_hours=node_hours,
        terabytes_in=moved_in / 1e12,
        terabytes_out=moved_out / 1e12,
        gets_per_second=gets / span,
        puts_per_second=puts / span,
        gigabit_per_second=8.0 * (moved_in + moved_out) / span / 1e9,
        cost_per_1000=compute + requests + storage,
        compute_per_1000=compute,
        requests_per_1000=requests,
        storage_per_1000=storage,
    )


SMALL = {"output_bytes": 20e6, "output_files": 3, "input_files": 2}
"""One archive as input, and only exports of one file each as output."""

SCENARIOS: list[tuple[str, dict[str, float], dict[str, float]]] = [
    ("all files of the replica kept", {}, {}),
    ("only exports kept, 100 files", {"output_bytes": 20e6, "output_files": 100}, {}),
    ("few files: *F*", SMALL, {}),
    ("*F*, nodes lost every 2 h", {**SMALL, "node_hours": 2.0}, {}),
    ("*F*, nodes lost every 2 h, no retries", {**SMALL, "node_hours": 2.0, "retries": 0}, {}),
    ("*F*, no time limit", {**SMALL, "limit": 1e9}, {}),
    ("*F*, time limit 15 min", {**SMALL, "limit": 900.0}, {}),
    ("*F*, driver starts 10 per second", {**SMALL, "dispatch": 10.0}, {}),
    ("*F*, 100 nodes", {**SMALL, "nodes": 100}, {}),
    ("*F*, 1600 nodes", {**SMALL, "nodes": 1600}, {}),
    ("*F*, GPU nodes at 4 times the price, training takes no time", {**SMALL, "cpu_seconds": 62.0}, {"node_hour": 1.2}),
]
"""What the table of the book shows: name, changes of the cluster, and of the prices."""


def table() -> str:
    """Results of all scenarios as a table of Markdown."""
    head = ["", "h, 99 %", "h", "busy", "given up", "runs repeated", "TB stored", "requests/s", "compute", "requests", "storage", "sum"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "--:|" * (len(head) - 1)]
    for name, changes, prices in SCENARIOS:
        r = simulate(replace(Cluster(), **changes), replace(Prices(), **prices))
        cells = [f"{r.hours_99:.1f}", f"{r.hours:.1f}", f"{100 * r.busy_share:.0f} %", str(r.over_limit + r.lost), str(r.repeated)]
        cells += [f"{r.terabytes_out:.0f}", f"{r.gets_per_second + r.puts_per_second:.0f}"]
        cells += [f"{x:.2f}" for x in (r.compute_per_1000, r.requests_per_1000, r.storage_per_1000, r.cost_per_1000)]
        lines.append("| " + " | ".join([name, *cells]) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    for group in (Cluster, Prices):
        for field in fields(group):
            kind = type(field.default)
            parser.add_argument(f"--{field.name.replace('_', '-')}", type=kind, default=field.default)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--table", action="store_true", help="print the table of the book; other parameters are ignored")
    given = vars(parser.parse_args())
    if given["table"]:
        print(table())
        return
    cluster = Cluster(**{field.name: given[field.name] for field in fields(Cluster)})
    prices = Prices(**{field.name: given[field.name] for field in fields(Prices)})
    result = asdict(simulate(cluster, prices))
    if given["json"]:
        print(json.dumps(result))
        return
    for name, value in result.items():
        print(f"{name:20} {value:,.4g}" if isinstance(value, float) else f"{name:20} {value:,}")


if __name__ == "__main__":
    main()
