# SPDX-License-Identifier: MIT
"""Readings that are excluded and restored with a reason, and sweeps that are measured again; nothing is removed."""
import json
import shutil
import signal

import pytest

from conftest import QUICK_LASER, SMALL, gonio, query, wait_for

TINY = """\
campaign: {
  name = "tiny";
  theta_i_deg = [ 10.0, 30.0, 50.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 10.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
  readings: { count = 4; };
};
"""
LONG = TINY.replace("step_deg = 10.0", "step_deg = 1.0").replace('"tiny"', '"long"')
WHY = ("--reason", "a fly sat on it")


@pytest.fixture(scope="module")
def finished(daemon):
    """A measured campaign, left as it was by every test that works on a copy."""
    reply = daemon.submit(TINY, "tiny.cfg")
    daemon.follow(0).until_state(reply["run"], "done")
    return reply


@pytest.fixture
def copy(finished, tmp_path):
    path = tmp_path / "0007-copy.gonio"
    shutil.copy(finished["file"], path)
    return path


def measured(d, config=TINY):
    reply = d.submit(config, "tiny.cfg")
    d.follow(0).until_state(reply["run"], "done")
    return reply


def fitted(file):
    """The fit of what counts now, without how long it took."""
    r = gonio("fit", file, "--json")
    assert r.returncode == 0, r.stderr
    fit = json.loads(r.stdout)
    del fit["elapsed_ms"], fit["elapsed_total_ms"]
    return fit


def shown(file):
    r = gonio("show", file, "--json")
    assert r.returncode == 0, r.stderr
    return json.loads(r.stdout)


def decisions(file):
    return query(file, "select sweep, point, attempt, what, reason, who from exclusion order by id")


def whole(file):
    r = gonio("verify", file)
    assert r.returncode == 0, r.stdout + r.stderr


def post(d, run, **body):
    return d.request("POST", f"/api/v1/runs/{run}/exclusions", body)


# --- excluded and restored ------------------------------------------------------------------------


def test_an_excluded_reading_is_not_fitted_and_comes_back_bit_by_bit(copy):
    before, readings = fitted(copy), query(copy, "select * from reading")
    assert before["excluded"] == 0
    r = gonio("exclude", copy, "2/3,2/8-9", *WHY, env={"GONIO_NAME": "Max"})
    assert r.returncode == 0 and "3 readings do not count any more" in r.stderr, r.stderr
    without = fitted(copy)
    assert without["points"] == before["points"] - 3 and without["excluded"] == 3
    assert without["params"] != before["params"]
    assert "3 readings excluded" in gonio("fit", copy).stderr
    assert decisions(copy) == [(2, p, 1, "excluded", "a fly sat on it", "Max") for p in (3, 8, 9)]

    seen = shown(copy)
    assert seen["done"] == seen["total"] and seen["excluded"] == 3 and seen["reduction"]["excluded"] == 3
    assert [(x["sweep"], x["point"], x["reason"]) for x in seen["exclusions"]] == [
        (2, p, "a fly sat on it") for p in (3, 8, 9)]
    assert any("Max excludes 3 readings (2/3,2/8-9): a fly sat on it" in e["text"] for e in seen["events"])
    text = gonio("show", copy).stdout
    assert "excluded  sweep 2, point 3: a fly sat on it (Max, " in text
    assert "excluded  sweep 2, points 8 to 9: a fly sat on it" in text
    rows = json.loads(gonio("show", copy, "--sweep", 2, "--json").stdout)["readings"]
    assert [r["point"] for r in rows if not r["counts"]] == [3, 8, 9]
    assert all((r["excluded"] is None) == r["counts"] and (r["f_r_per_sr"] is None) != r["counts"] for r in rows)
    table = [line.split("\t") for line in gonio("show", copy, "--sweep", 2).stdout.splitlines()]
    assert table[0][-2:] == ["point", "excluded"] and ["2/3", "excluded: a fly sat on it"] in [row[-2:] for row in table]

    r = gonio("restore", copy, "2/8-9,2/3", "--reason", "it was a shadow", "--json", env={"GONIO_NAME": "Eva"})
    assert r.returncode == 0 and json.loads(r.stdout)["readings"] == 3
    assert fitted(copy) == before
    assert query(copy, "select * from reading") == readings
    assert len(decisions(copy)) == 6 and shown(copy)["exclusions"] == []
    whole(copy)


def test_they_are_chosen_by_their_angles(copy):
    r = gonio("exclude", copy, "--theta-i", 30, "--theta-r", "28..32", *WHY)
    assert r.returncode == 0, r.stderr
    out = query(copy, "select theta_i_udeg, theta_r_udeg from excluded join plan using (sweep, point)"
                      " order by theta_r_udeg")
    assert out == [(30000000, t * 1000000) for t in (28, 29, 30, 31, 32)]
    assert gonio("exclude", copy, "--theta-r", "-60", *WHY).returncode == 0
    assert query(copy, "select count(*) from excluded")[0][0] == 8, "one more in each sweep"
    again = gonio("exclude", copy, "--theta-i", 30, "--theta-r", "28..32", *WHY)
    assert again.returncode == 2 and "no reading there counts" in again.stderr
    assert gonio("restore", copy, "--theta-r", "-90..90", *WHY).returncode == 0
    assert query(copy, "select count(*) from excluded")[0][0] == 0
    for wrong in ("5..-5", "x", "1..2..3", ""):
        r = gonio("exclude", copy, "--theta-r", wrong, *WHY)
        assert r.returncode == 2, (wrong, r.stderr)


def test_what_is_refused_changes_nothing(copy, daemon, finished):
    for args, says in (
            (("2/3",), "--reason TEXT"), (("2/3", "--reason", ""), "--reason TEXT"),
            (("2/3", "--reason", "  "), "--reason TEXT"), (("2/3", "--reason", "a\nb"), "one line"),
            (("2/3", "--reason", "x" * 401), "at most 400"), (("2/x", *WHY), "'2/x' names no reading"),
            (("2/999", *WHY), "sweep 2, point 999: no reading of it counts"),
            (("2/3", "--theta-i", "30", *WHY), "either SWEEP/POINT"), (WHY, "either SWEEP/POINT")):
        for file in (copy, finished["run"]):
            r = daemon.gonio("exclude", file, *args)
            assert r.returncode == 2 and says in r.stderr, (args, r.stderr)
            assert r.stdout == ""
    r = gonio("restore", copy, "2/3", *WHY)
    assert r.returncode == 2 and "nothing of it is excluded" in r.stderr
    assert gonio("exclude", copy.parent / "no.gonio", "1/1", *WHY).returncode == 2
    assert decisions(copy) == [] and decisions(finished["file"]) == []


def test_the_last_reference_is_not_excluded_in_silence(copy):
    before = fitted(copy)
    assert gonio("exclude", copy, "0/1", *WHY).returncode == 0
    assert fitted(copy)["excluded"] == 1 and fitted(copy)["params"] != before["params"]
    assert gonio("exclude", copy, "4/0", *WHY).returncode == 0
    r = gonio("fit", copy)
    assert r.returncode == 2 and "no beam reading is left, 2 are excluded" in r.stderr
    assert "no beam reading is left" in gonio("show", copy).stdout
    assert gonio("restore", copy, "0,4", *WHY).returncode == 0
    assert fitted(copy) == before


def test_stored_results_stay_and_say_what_they_were_made_from(copy):
    results = query(copy, "select * from reduced"), query(copy, "select * from fit")
    assert query(copy, "select excluded from reduction") == [(0,)] * 4
    assert gonio("exclude", copy, "2/3", *WHY).returncode == 0
    assert (query(copy, "select * from reduced"), query(copy, "select * from fit")) == results
    assert query(copy, "select f_r, excluded from reading_brdf where sweep = 2 and point = 3") == [
        (None, "a fly sat on it")]


# --- who writes -----------------------------------------------------------------------------------


def test_the_daemon_writes_in_its_folder(daemon, finished):
    """Nobody else: a lock that is held just when the run's turn comes would fail it."""
    log = daemon.errors()
    r = daemon.gonio("exclude", finished["run"], "1/0", *WHY)
    assert r.returncode == 0, r.stderr
    assert "decided about 1 readings" in daemon.errors()[len(log):]
    status, reply = post(daemon, finished["run"], do="restore", readings="1/0", reason="was good")
    assert status == 200 and reply["readings"] == 1 and reply["state"] == "done"
    assert decisions(finished["file"])[-1][3:5] == ("restored", "was good")
    assert daemon.status()["run"] is None


@pytest.mark.parametrize("body, says", [
    ({"do": "exclude", "readings": "1/0"}, "without a reason"),
    ({"do": "exclude", "readings": "1/0", "reason": ""}, "without a reason"),
    ({"do": "exclude", "reason": "x"}, "readings"), ({"do": "dance", "reason": "x"}, "use exclude"),
    ({"do": "exclude", "readings": "1/0", "sweep": 1, "reason": "x"}, "without"),
    ({"do": "remeasure", "sweep": 9, "reason": "x"}, "allowed 1..3"),
    ({"do": "remeasure", "sweep": 1}, "without a reason"),
    ({"do": "remeasure", "readings": "1/0", "reason": "x"}, "sweep"),
    ({"do": "exclude", "readings": "1/0", "reason": "x", "more": 1}, "more"), ("[", "JSON")])
def test_wrong_requests(daemon, finished, body, says):
    rows = decisions(finished["file"])
    status, reply = daemon.request("POST", f"/api/v1/runs/{finished['run']}/exclusions", body)
    assert status == 400 and says in json.dumps(reply), reply
    assert decisions(finished["file"]) == rows
    assert daemon.gonio("list").returncode == 0


def test_runs_that_are_not_there(daemon, finished):
    status, reply = post(daemon, 999, do="exclude", readings="1/0", reason="x")
    assert status == 400 and "there is no run 999" in reply["error"]
    for path in ("0/exclusions", "x/exclusions", "/exclusions", "1/2/exclusions"):
        assert daemon.request("POST", f"/api/v1/runs/{path}", {})[0] == 404, path
    assert daemon.request("POST", f"/api/v1/runs/{finished['run']}", {})[0] == 405
    assert daemon.request("GET", f"/api/v1/runs/{finished['run']}/exclusions")[0] in (404, 405)
    r = daemon.gonio("remeasure", 999, 1, *WHY)
    assert r.returncode == 2 and "there is no run 999" in r.stderr


def test_only_who_has_control_decides(daemon, finished):
    assert daemon.request("POST", "/api/v1/control", {"do": "take"}, {"Gonio-Name": "Eva"})[0] == 200
    try:
        r = daemon.gonio("exclude", finished["run"], "1/0", *WHY)
        assert r.returncode == 4 and "Eva has control" in r.stderr
    finally:
        daemon.request("POST", "/api/v1/control", {"do": "release"}, {"Gonio-Name": "Eva"})


def test_excluded_while_it_is_measured(start_daemon):
    d = start_daemon()
    reply = d.submit(LONG, "long.cfg")
    events = d.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] == 1 and e["point"] == 3)
    # Another program may not: the file has its writer.
    other = gonio("exclude", reply["file"], "1/2", *WHY, env={**d.env, "GONIO_SOCKET": str(d.folder / "none")})
    assert other.returncode == 4 and f"in use by process {d.pid}" in other.stderr
    assert d.gonio("exclude", reply["run"], "1/2", *WHY).returncode == 0
    assert d.status()["run"]["state"] == "running"
    ahead = d.gonio("exclude", reply["run"], "3/5", *WHY)
    assert ahead.returncode == 2 and "no reading of it counts" in ahead.stderr, "not measured yet"
    events.until_state(reply["run"], "done", patience_s=120)
    file = reply["file"]
    assert query(file, "select distinct excluded from reduction") == [(1,)]
    assert query(file, "select count(*) from reduced where sweep = 1 and point = 2") == [(0,)]
    assert accepted(file, 1) == {1}, "its point is not measured again"
    fit = json.loads(query(file, "select json from fit order by id desc limit 1")[0][0])
    assert fit["excluded"] == 1
    whole(file)


# --- measured again -------------------------------------------------------------------------------


def good(file, sweep):
    """How many good readings its points have, by point; that is not the number of attempts."""
    return dict(query(file, f"select point, count(*) from reading where sweep = {sweep}"
                            " and (flags & 255) = 0 group by point"))


def accepted(file, sweep):
    return set(good(file, sweep).values())


def check_measured_again(file, sweep, last=4, opening=None):
    """A second good reading of every point of the sweep, bracketed by new references, and of nothing else.

    opening: how many good readings the opening references have, where the laser was off meanwhile.
    """
    assert accepted(file, sweep) == {2}
    assert good(file, 0) == opening if opening else accepted(file, 0) == {2}
    assert min(accepted(file, last)) == 2 or query(file, "select count(*) from exclusion where sweep = 4") == [(0,)]
    assert all(accepted(file, s) == {1} for s in range(1, last) if s != sweep)

    def time(what, s):
        return query(file, f"select {what}(t) from (select max(t_utc_ms) t from reading where sweep = {s}"
                           " and (flags & 255) = 0 group by point)")[0][0]
    (opened,), = query(file, "select max(t_utc_ms) from (select t_utc_ms, row_number() over (partition by point"
                             " order by attempt) n from reading where sweep = 0 and (flags & 255) = 0) where n = 2")
    assert opened <= time("min", sweep) and time("max", sweep) <= time("min", last)
    newest = "reduction = (select max(id) from reduction)"
    assert query(file, f"select point, attempt from reduced where sweep = {sweep} and {newest} order by point") == query(
        file, f"select point, max(attempt) from reading where sweep = {sweep} and (flags & 255) = 0 group by point")
    assert query(file, f"select count(*) from reduced where {newest}") == query(
        file, "select count(*) from plan where kind = 'sample'")
    seen = shown(file)
    assert seen["state"] == "done" and seen["done"] == seen["total"]
    whole(file)


def test_a_sweep_of_a_finished_campaign(start_daemon):
    d = start_daemon()
    reply = measured(d)
    run, file = reply["run"], reply["file"]
    old = query(file, "select * from reading order by sweep, point")
    before = fitted(file)
    assert d.gonio("remeasure", run, 2).returncode == 2, "without a reason"
    assert d.gonio("remeasure", run, 9, *WHY).returncode == 2
    assert decisions(file) == []
    r = d.gonio("remeasure", run, 2, *WHY)
    assert r.returncode == 0 and "measured again" in r.stderr, r.stderr
    check_measured_again(file, 2)
    assert set(old) < set(query(file, "select * from reading")), "nothing is gone"
    after = fitted(file)
    assert after["points"] == before["points"] and after["excluded"] == before["points"] // 3
    assert after["params"] != before["params"]
    assert shown(file)["exclusions"][0]["what"] in ("repeated", "replaced")
    (entry,) = [e for e in json.loads(d.gonio("list", "--json").stdout) if e["id"] == run]
    assert entry["state"] == "done" and entry["done"] == entry["total"]
    # A second time, by its path; the attempts go on counting.
    assert d.gonio("remeasure", file, 2, *WHY).returncode == 0
    assert [accepted(file, s) for s in range(5)] == [{3}, {1}, {3}, {1}, {3}]
    whole(file)


def test_a_sweep_of_a_campaign_in_progress(start_daemon):
    d = start_daemon()
    reply = d.submit(SMALL)
    run, file = reply["run"], reply["file"]
    events = d.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] == 2 and e["point"] == 2)
    status, answer = post(d, run, do="remeasure", sweep=1, reason="the door was open")
    assert status == 201 and answer["state"] == "running", answer
    assert d.gonio("list").returncode == 0
    events.until_state(run, "queued", patience_s=120)
    end = events.until_state(run, "done", patience_s=120)
    assert end["done"] == end["total"]
    wait_for(lambda: d.status()["run"] is None)
    check_measured_again(file, 1)
    states = [s for (s,) in query(file, "select state from state order by id")]
    assert states[-1] == "done" and states.count("done") == 1 and "stopped" in states


def test_one_that_waits_and_one_that_was_stopped(start_daemon):
    d = start_daemon()
    first, second = d.submit(LONG, "long.cfg"), d.submit(TINY, "tiny.cfg")
    events = d.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] == 2 and e["point"] == 2)
    status, answer = post(d, second["run"], do="remeasure", sweep=1, reason="x")
    assert status == 400 and "it is measured anyway" in json.dumps(answer)
    assert d.gonio("stop").returncode == 0
    events.until_state(first["run"], "stopped")
    r = d.gonio("remeasure", first["run"], 1, *WHY, "--detach")
    assert r.returncode == 0, r.stderr
    events.until_state(first["run"], "done", patience_s=120)
    check_measured_again(first["file"], 1)


def test_taken_back_before_it_is_measured(start_daemon):
    d = start_daemon()
    blocker, reply = None, measured(d)
    before = fitted(reply["file"])
    blocker = d.submit(LONG, "long.cfg")
    d.follow(0).until(lambda e: e["event"] == "reading" and e["run"] == blocker["run"])
    assert d.gonio("remeasure", reply["run"], 2, *WHY, "--detach").returncode == 0
    seen = shown(reply["file"])
    assert seen["state"] == "stopped" and seen["done"] < seen["total"]
    assert d.gonio("queue", "remove", reply["run"]).returncode == 0
    assert d.gonio("restore", reply["run"], "0,2,4", *WHY).returncode == 0
    assert d.gonio("stop").returncode == 0
    assert fitted(reply["file"])["params"] == before["params"]
    assert d.gonio("resume", reply["run"]).returncode == 0, "nothing is left to measure"
    assert accepted(reply["file"], 2) == {1}
    assert shown(reply["file"])["state"] == "done"
    whole(reply["file"])


@pytest.mark.parametrize("after", [0, 1, 12])
def test_killed_in_between(start_daemon, start_sim, tmp_path, after):
    """After the decision, in the references, in the sweep: the file says what is still to be measured."""
    sim = start_sim("--fast", *QUICK_LASER)
    bench = ("--config", sim.folder / "goniod.cfg")
    d = start_daemon(*bench, folder=tmp_path / "d")
    reply = measured(d)
    run, file = reply["run"], reply["file"]
    events = d.follow()
    status, _ = post(d, run, do="remeasure", sweep=2, reason="x")
    assert status == 201
    for _ in range(after):
        events.until(lambda e: e["event"] == "reading" and e["run"] == run)
    d.end(signal.SIGKILL)
    (entry,) = json.loads(gonio("list", "--json", "--dir", d.directory).stdout)
    assert entry["state"] in ("stopped", "interrupted") and entry["done"] < entry["total"]
    whole(file)
    opening = {point: n + 1 for point, n in good(file, 0).items()}  # once each, whatever was done before
    d = start_daemon(*bench, folder=tmp_path / "d")
    r = d.gonio("resume", run)
    assert r.returncode == 0, r.stderr
    check_measured_again(file, 2, opening=opening)


def test_remeasure_needs_the_daemon_and_its_folder(copy, daemon):
    r = daemon.gonio("remeasure", copy, 1, *WHY)
    assert r.returncode == 2 and "only these can be measured again" in r.stderr
    r = gonio("remeasure", 1, 1, *WHY, env={"GONIO_SOCKET": str(copy.parent / "none")})
    assert r.returncode == 3
