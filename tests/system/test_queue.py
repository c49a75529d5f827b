# SPDX-License-Identifier: MIT
"""The queue at the prompt and over HTTP: its order, what is held, and that it outlives goniod."""
import json
import queue
import signal
import sqlite3
import threading
import time

import pytest

from conftest import SMALL, wait_for

LONG = SMALL.replace("step_deg = 5.0", "step_deg = 1.0").replace('"small"', '"long"')


def queue_of(d):
    status, q = d.request("GET", "/api/v1/queue")
    assert status == 200
    return q


def order(d):
    return [e["run"] for e in queue_of(d)["entries"]]


def do(d, what, **more):
    return d.request("POST", "/api/v1/queue", {"do": what, **more})


@pytest.fixture
def busy(start_daemon):
    """A long run has the bench, three wait."""
    d = start_daemon()
    d.runs = [d.submit(LONG)["run"], *(d.submit(SMALL)["run"] for _ in range(3))]
    return d


def test_order_and_estimates(busy):
    a, b, c, e = busy.runs
    q = queue_of(busy)
    assert [x["run"] for x in q["entries"]] == busy.runs
    assert [x["place"] for x in q["entries"]] == [0, 1, 2, 3]
    waiting = q["entries"][1:]
    assert all(x["left_s"] > 5 for x in waiting), "the plan's estimate"
    wait_for(lambda: queue_of(busy)["entries"][0]["left_s"] is not None, 60)
    ready = [x["ready_s"] for x in queue_of(busy)["entries"]]
    assert ready == sorted(ready) and ready[3] - ready[2] == pytest.approx(waiting[2]["left_s"])
    assert do(busy, "move", run=e, place=1)[0] == 200
    assert order(busy) == [a, e, b, c]
    assert do(busy, "remove", run=b)[0] == 200
    assert order(busy) == [a, e, c]
    status, reply = do(busy, "move", run=e, place=3)
    assert status == 400 and "place 3: the queue has 1 to 2" in reply["error"]
    status, reply = do(busy, "remove", run=a)
    assert status == 400 and "does not wait in the queue" in reply["error"]
    status, reply = do(busy, "dance")
    assert status == 400 and "hold, release, remove or move" in json.dumps(reply)
    assert busy.request("POST", "/api/v1/queue", {"run": 1})[0] == 400
    assert busy.request("POST", "/api/v1/queue", "[")[0] == 400


@pytest.mark.parametrize("number", [0, -1, 2**31, 2**32, 2**32 + 2, 2**63 - 1])
def test_a_number_that_is_no_runs_names_no_run(busy, number):
    assert do(busy, "hold")[0] == 200
    for wrong in ({"do": "release", "run": number}, {"do": "remove", "run": number},
                  {"do": "move", "run": number, "place": 1}, {"do": "move", "run": 3, "place": number}):
        status, reply = busy.request("POST", "/api/v1/queue", wrong)
        assert status == 400, (wrong, reply)
    q = queue_of(busy)
    assert q["held"] and [x["run"] for x in q["entries"]] == busy.runs


def test_a_change_is_answered_when_it_is_on_the_disk(busy):
    """Killed after the answer, goniod starts anew with what it said. Another writer delays the disk here."""
    a, b, c, e = busy.runs
    db = sqlite3.connect(busy.directory / "state.db", isolation_level=None)
    answers = queue.Queue()
    changes = ({"do": "move", "run": e, "place": 1}, {"do": "hold", "run": c}, {"do": "remove", "run": b})
    for change in changes:
        db.execute("begin immediate")
        threading.Thread(target=lambda: answers.put(busy.request("POST", "/api/v1/queue", change))).start()
        with pytest.raises(queue.Empty):
            answers.get(timeout=0.3)
        assert busy.status()["state"], "nothing else waits"
        db.execute("rollback")
        assert answers.get(timeout=60)[0] == 200
    busy.process.kill()
    busy.process.wait()
    assert db.execute("select run, held from queue order by place").fetchall() == [(a, 0), (e, 0), (c, 1)]


def test_the_command(busy):
    a, b, c, e = busy.runs
    r = busy.gonio("queue")
    rows = [line.split("\t") for line in r.stdout.splitlines()]
    assert rows[0][:2] == ["place", "run"] and [int(row[1]) for row in rows[1:]] == busy.runs
    assert busy.gonio("queue", "hold", c).returncode == 0
    assert "queued, held" in busy.gonio("queue").stdout
    r = busy.gonio("queue", "move", c, 1, "--json")
    assert [x["run"] for x in json.loads(r.stdout)["entries"]] == [a, c, b, e]
    assert busy.gonio("queue", "remove", b).returncode == 0
    r = busy.gonio("queue", "hold")
    assert "the queue is held" in r.stderr
    for wrong, says in ((["hodl"], "did you mean 'hold'"), (["move", c], "a RUN and a PLACE"),
                        (["remove", "x"], "run 'x' is not a number"), (["remove", a], "does not wait")):
        r = busy.gonio("queue", *wrong)
        assert r.returncode == 2 and says in r.stderr, r.stderr
    assert busy.gonio("stop").returncode == 0
    assert "the queue is empty" in busy.gonio("queue").stderr
    assert queue_of(busy)["held"] is False, "a stop empties it; nothing is left to hold"


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_it_outlives_goniod_and_waits_for_a_person(start_daemon, tmp_path, start_sim, end):
    sim = start_sim("--fast", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    bench = ("--config", sim.folder / "goniod.cfg")
    d = start_daemon(*bench, folder=tmp_path / "d")
    a, b, c = d.submit(LONG)["run"], d.submit(SMALL)["run"], d.submit(SMALL)["run"]
    do(d, "move", run=c, place=1)
    do(d, "hold", run=b)
    wait_for(lambda: d.status()["run"]["done"] > 20, 60)
    d.end(end)

    d = start_daemon(*bench, folder=tmp_path / "d")
    q = queue_of(d)
    assert q["held"] is True and order(d) == [a, c, b]
    assert [x["held"] for x in q["entries"]] == [False, False, True]
    time.sleep(1.0)
    assert sim.control(do="state")["laser"]["emission"] is False and d.status()["run"] is None
    assert "held, as goniod was started anew" in d.errors()

    follow = d.follow()
    assert d.gonio("queue", "release").returncode == 0
    follow.until_state(a, "done", patience_s=120)
    follow.until_state(c, "done", patience_s=120)
    wait_for(lambda: d.status()["run"] is None)
    assert order(d) == [b], "held still"
    assert d.gonio("resume", b).returncode == 0
    assert order(d) == []
