# SPDX-License-Identifier: MIT
"""goniod over the simulated bench: a campaign from its start to its fit, stop and resume, ends."""
import fcntl
import json
import math
import os
import select
import signal
import subprocess
import time

import pytest

from conftest import BUILD, PATIENCE_S, QUICK_LASER, SMALL, Daemon, Program, query

TINY = """\
campaign: {
  name = "tiny";
  theta_i_deg = [ 10.0, 30.0 ];
  theta_r: { from_deg = -40.0; to_deg = 40.0; step_deg = 10.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""
LONG = TINY.replace("step_deg = 10.0", "step_deg = 1.5").replace('"tiny"', '"long"')


@pytest.fixture(scope="module")
def finished(daemon, tmp_path_factory):
    """A small campaign, run to its end with gonio run --json: its events."""
    config = tmp_path_factory.mktemp("c") / "small.cfg"
    config.write_text(SMALL)
    r = daemon.gonio("run", config, "--json")
    events = [json.loads(line) for line in r.stdout.splitlines()]
    return {"status": r.returncode, "events": events, "stderr": r.stderr, "run": events[0]["run"]}


def test_a_campaign_runs_to_its_end(daemon, finished):
    assert finished["status"] == 0, finished["stderr"]
    states = [e["state"] for e in finished["events"] if e["event"] == "state"]
    assert states[0] == "queued" and states[-1] == "done" and "running" in states
    readings = [e for e in finished["events"] if e["event"] == "reading"]
    assert readings[-1]["done"] == readings[-1]["total"]
    sample = [e for e in readings if e["f_r_per_sr"] is not None]
    assert len(sample) > 90 and all(e["f_r_per_sr"] > 0 for e in sample)
    assert any(e["emission"] for e in readings)
    fits = [e for e in finished["events"] if e["event"] == "fit"]
    assert [e["last"] for e in fits].count(True) == 1 and "fit" in fits[-1]
    assert daemon.status()["run"] is None
    assert daemon.bench.control(do="state")["laser"]["emission"] is False


def test_ids_rise_and_every_event_names_its_run(finished):
    ids = [e["id"] for e in finished["events"]]
    assert ids == sorted(set(ids))
    assert all(e["run"] == finished["run"] for e in finished["events"])


def test_the_fit_matches_the_simulated_sample(daemon, finished):
    truth = daemon.bench.control(do="truth")["sample"]
    fit = [e for e in finished["events"] if e["event"] == "fit"][-1]["fit"]
    sigma = fit["params"]["sigma"]
    # Identified by f_00 alone (physics): sigma and kd. Five standard uncertainties, and never more than 5 %.
    assert abs(sigma["value"] - truth["sigma"]) < max(5 * sigma["u"], 0.01 * truth["sigma"])
    assert math.isclose(sigma["value"], truth["sigma"], rel_tol=0.05)
    assert math.isclose(fit["params"]["kd"]["value"], truth["kd"], rel_tol=0.05)


def test_list_and_show_read_the_file(daemon, finished):
    runs = json.loads(daemon.gonio("list", "--json").stdout)
    (run,) = [r for r in runs if r["id"] == finished["run"]]
    assert run["state"] == "done" and run["done"] == run["total"] and run["name"] == "small"
    assert run["created_utc"] and run["finished_utc"]
    assert not os.path.exists(run["file"] + "-wal")
    shown = json.loads(daemon.gonio("show", finished["run"], "--json").stdout)
    assert shown["state"] == "done" and shown["fit"]["params"]["sigma"]["identified"]
    by_path = json.loads(daemon.gonio("show", run["file"], "--sweep", 1, "--json").stdout)["readings"]
    by_name = json.loads(daemon.gonio("show", "small", "--sweep", 1, "--json").stdout)["readings"]
    assert by_path == by_name and len(by_path) >= 25
    assert all(r["accepted"] for r in by_path if r["f_r_per_sr"] is not None)
    assert all(r["u_a_per_sr"] > 0 and r["u_b_per_sr"] > 0 for r in by_path if r["f_r_per_sr"] is not None)
    table = daemon.gonio("show", finished["run"], "--sweep", 1).stdout.splitlines()
    assert table[0].split("\t")[:4] == ["kind", "theta_i_deg", "theta_r_deg", "f_r_per_sr"]
    assert len(table) == len(by_path) + 1
    assert daemon.gonio("show", finished["run"]).returncode == 0
    assert daemon.gonio("show", finished["run"], "--sweep", 99).returncode == 2
    assert query(run["file"], "select count(*) from reading_brdf")[0][0] >= 90


def test_fit_of_the_file_is_the_daemons_fit(daemon, finished):
    stored = [e for e in finished["events"] if e["event"] == "fit"][-1]["fit"]
    r = daemon.gonio("fit", finished["run"], "--json")
    assert r.returncode == 0, r.stderr
    again = json.loads(r.stdout)
    assert again["points"] == stored["points"] and again["weights"] == stored["weights"]
    assert math.isclose(again["params"]["sigma"]["value"], stored["params"]["sigma"]["value"], rel_tol=1e-9)


def test_a_run_that_is_done_is_not_resumed(daemon, finished):
    r = daemon.gonio("resume", finished["run"])
    assert r.returncode == 4 and "is done" in r.stderr
    r = daemon.gonio("resume", 999)
    assert r.returncode == 2 and "999" in r.stderr


def test_the_stream_replays_what_was_missed(daemon, finished):
    ids = [e["id"] for e in finished["events"]]
    stream = daemon.follow(last_id=ids[10])
    replayed = [stream.next() for _ in range(len(ids) - 11)]
    stream.close()
    assert replayed == finished["events"][11:]


def test_run_for_people_ends_with_the_parameters(daemon, tmp_path):
    config = tmp_path / "tiny.cfg"
    config.write_text(TINY)
    r = daemon.gonio("run", config)
    assert r.returncode == 0, r.stderr
    assert "sweep 1/2" in r.stderr and "sweep 2/2" in r.stderr and "started" in r.stderr
    assert ".gonio" in r.stderr
    rows = {line.split("\t")[0] for line in r.stdout.splitlines()}
    assert rows >= {"n", "k", "sigma", "ks", "kd", "ks*R(0)", "Delta"}
    assert "\033" not in r.stdout + r.stderr




def test_stop_and_resume_measure_no_point_twice(daemon):
    reply = daemon.submit(LONG, "long.cfg")
    run = reply["run"]
    stream = daemon.follow(reply["event_id"])
    stream.until(lambda e: e["event"] == "reading" and e["done"] >= 20)
    busy = daemon.gonio("resume", run)
    assert busy.returncode == 4 and "already" in busy.stderr
    began = time.monotonic()
    r = daemon.gonio("stop")
    assert r.returncode == 0 and f"gonio resume {run}" in r.stderr
    assert time.monotonic() - began < 3.0  # laser off within 1 s, then the file is closed
    stream.until_state(run, "stopped")
    assert daemon.status()["run"] is None
    devices = {d["name"]: d for d in daemon.status()["devices"]}
    assert devices["laser"]["emission"] is False
    (entry,) = [e for e in json.loads(daemon.gonio("list", "--json").stdout) if e["id"] == run]
    assert entry["state"] == "stopped" and 20 <= entry["done"] < entry["total"]

    r = daemon.gonio("resume", run, "--detach", "--json")
    assert r.returncode == 0, r.stderr
    stream.until(lambda e: e["event"] == "reading" and e["done"] > entry["done"])
    stream.until_state(run, "done", patience_s=90)
    stream.close()
    rows = query(reply["file"], "select sweep, point, flags from reading")
    plan = query(reply["file"], "select count(*) from plan")[0][0]
    accepted = [(s, p) for s, p, flags in rows if flags == 0]
    assert len(set(accepted)) == plan == entry["total"]
    again = [p for p in set(accepted) if accepted.count(p) > 1]
    assert sorted(again) == [(0, 0), (0, 1)], "the opening references, after the gap, and nothing else"


def test_pause_holds_and_resume_goes_on(daemon):
    reply = daemon.submit(TINY)
    run = reply["run"]
    stream = daemon.follow(reply["event_id"])
    stream.until(lambda e: e["event"] == "reading" and e["done"] >= 5)
    r = daemon.gonio("pause")
    assert r.returncode == 0, r.stderr
    stream.until_state(run, "paused")
    status = json.loads(daemon.gonio("status", "--json").stdout)
    assert status["run"]["run"] == run and status["run"]["state"] == "paused"
    assert status["run"]["emission"] is False
    shown = daemon.gonio("status").stdout
    assert "paused" in shown and "by the operator" in shown and "last error" not in shown, shown
    assert "emitting" not in shown and "warming" not in shown, shown  # what was read before OFF
    assert daemon.gonio("pause").returncode == 4
    r = daemon.gonio("resume", "--detach")
    assert r.returncode == 0, r.stderr
    stream.until_state(run, "running")
    assert daemon.gonio("watch").returncode == 0  # to the end
    stream.until_state(run, "done")
    stream.close()


def test_a_second_campaign_waits_and_a_stop_puts_it_back(daemon):
    first, second = daemon.submit(LONG, "long.cfg"), daemon.submit(TINY)
    assert daemon.status()["queued"] == [second["run"]]
    stream = daemon.follow(first["event_id"])
    stream.until_state(first["run"], "preparing")
    stop = daemon.gonio("stop")
    assert stop.returncode == 0 and f"run {second['run']} was waiting and waits no more" in stop.stderr, stop.stderr
    stream.until_state(first["run"], "stopped")
    stream.close()
    assert [e["state"] for e in json.loads(daemon.gonio("list", "--json").stdout)[-2:]] == ["stopped", "new"]
    runs = {r["run"]: r["state"] for r in daemon.request("GET", "/api/v1/runs")[1]["runs"]}
    assert runs[first["run"]] == "stopped" and runs[second["run"]] == "stopped"
    assert daemon.status()["run"] is None


def test_ctrl_c_ends_the_following_and_not_the_run(daemon, tmp_path):
    config = tmp_path / "long.cfg"
    config.write_text(LONG)
    p = Program([BUILD / "gonio", "run", config, "--json"], tmp_path / "err", daemon.env)
    p.wait_line('{"event":"reading"')
    assert p.end(signal.SIGINT) == 130
    assert "gonio stop" in p.errors()
    assert daemon.status()["run"]["state"] in ("preparing", "running")
    assert daemon.gonio("stop").returncode == 0
    r = daemon.gonio("run", config, "--detach", "--json")
    assert r.returncode == 0 and json.loads(r.stdout)["state"] in ("queued", "preparing", "running")
    assert daemon.gonio("stop").returncode == 0


def test_a_file_copied_into_the_folder_is_known_by_its_number(daemon):
    reply = daemon.submit(LONG, "long.cfg")
    assert daemon.gonio("stop").returncode == 0
    number = reply["run"] + 20
    os.link(reply["file"], daemon.directory / f"{number:04}-copy.gonio")
    assert daemon.request("GET", f"/api/v1/runs/{number}")[1]["name"] == "long"
    number += 1
    os.rename(daemon.directory / f"{number - 1:04}-copy.gonio", daemon.directory / f"{number:04}-copy.gonio")
    r = daemon.gonio("resume", number, "--detach", "--json")
    assert r.returncode == 0, r.stderr
    assert json.loads(r.stdout)["run"] == number
    assert daemon.gonio("stop").returncode == 0
    os.unlink(daemon.directory / f"{number:04}-copy.gonio")


def test_a_file_that_cannot_go_on_is_refused_at_once(daemon, tmp_path):
    reply = daemon.submit(LONG, "long.cfg")
    run, file = reply["run"], reply["file"]
    assert daemon.gonio("stop").returncode == 0
    with open(file + "-lock", "w") as lock:
        lock.write("4711\n")
        lock.flush()
        fcntl.lockf(lock, fcntl.LOCK_EX)
        r = daemon.gonio("resume", run, "--detach")
        assert r.returncode == 4 and "in use by process 4711" in r.stderr, r
    os.unlink(file + "-lock")
    os.truncate(file, 20000)
    r = daemon.gonio("resume", run, "--detach")
    assert r.returncode == 1 and file in r.stderr, r
    os.truncate(file, 0)
    r = daemon.gonio("resume", run, "--detach")
    assert r.returncode == 2 and "not a campaign file" in r.stderr, r
    os.unlink(file)
    r = daemon.gonio("resume", run)
    assert r.returncode == 2 and "No such file" in r.stderr, r
    assert daemon.status()["run"] is None


# --- the daemon's own beginning and end ---------------------------------------------------------------

def test_sigterm_in_a_run_ends_within_5_s_and_the_run_goes_on_later(start_daemon):
    d = start_daemon("--sim", "--fast")
    reply = d.submit(LONG, "long.cfg")
    d.follow(reply["event_id"]).until(lambda e: e["event"] == "reading" and e["done"] >= 10)
    sim_pid = int((d.sim_folder() / "goniosim.pid").read_text())
    began = time.monotonic()
    assert d.end(signal.SIGTERM) == 0, d.errors()
    assert time.monotonic() - began < 5.0
    assert list(d.runtime.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(sim_pid, 0)
    (entry,) = json.loads(d.gonio("list", "--json").stdout)
    assert entry["state"] == "stopped" and entry["done"] >= 10

    again = start_daemon("--sim", "--fast")
    r = again.gonio("resume", reply["run"], "--detach")
    assert r.returncode == 0, r.stderr
    again.follow(0).until(lambda e: e["event"] == "reading" and e["done"] > entry["done"])


def test_sim_needs_no_file_and_no_hardware(start_daemon):
    d = start_daemon("--sim", "--fast", "--seed", "9")
    assert d.said[0].startswith("goniod 0.") and "simulator (seed 9)" in d.said[0] and str(d.socket) in d.said[0]
    s = d.status()
    assert s["simulator"] is True and s["seed"] == 9
    assert d.sim_control(do="truth")["seed"] == 9


def test_the_simulator_dies_with_a_killed_daemon(start_daemon):
    d = start_daemon("--sim", "--fast")
    sim_pid = int((d.sim_folder() / "goniosim.pid").read_text())
    pidfd = os.pidfd_open(sim_pid)
    d.end(signal.SIGKILL)
    assert select.select([pidfd], [], [], PATIENCE_S)[0], "goniosim outlived its daemon"
    os.close(pidfd)
    again = start_daemon("--sim", "--fast")  # the dead daemon's socket is replaced
    assert again.status()["pid"] == again.pid


def test_a_second_daemon_is_refused(daemon):
    r = subprocess.run([BUILD / "goniod", "--sim"], env={**os.environ, **daemon.env}, capture_output=True, text=True,
                       timeout=PATIENCE_S, check=False)
    assert r.returncode == 4 and f"already running, pid {daemon.pid}" in r.stderr


def test_a_bench_that_is_not_there_is_named_and_waited_for(start_sim, start_daemon, tmp_path):
    sim = start_sim("--fast", *QUICK_LASER)
    for wire in ("axes-tcp", "laser-tcp"):
        assert sim.control(do="unplug", wire=wire)["ok"]
    d = start_daemon("--config", sim.folder / "goniod-tcp.cfg")
    assert any(line.startswith("waiting for laser: ") for line in d.said)
    assert "laser not reachable" in d.said[-1]
    devices = {e["name"]: e["link"] for e in d.status()["devices"]}
    assert devices["laser"] == devices["theta_i"] == "lost" and devices["detector"] == "ok"
    reply = d.submit(TINY)
    stream = d.follow(reply["event_id"])
    stream.until_state(reply["run"], "paused")
    r = d.gonio("stop")  # the run ends, but nobody may say that the laser is off
    assert r.returncode == 1 and "laser off" not in r.stderr and "use its key or the interlock" in r.stderr
    assert d.gonio("resume", reply["run"], "--detach").returncode == 0
    stream.until(lambda e: e["event"] == "state" and e["state"] == "paused" and e["id"] > reply["event_id"] + 3)
    for wire in ("axes-tcp", "laser-tcp"):
        assert sim.control(do="plug", wire=wire)["ok"]
    stream.until_state(reply["run"], "running")
    stream.close()
    r = d.gonio("stop")
    assert r.returncode == 0 and "laser off, axes halted" in r.stderr


def test_the_daemon_over_tcp_and_a_given_simulator(start_sim, start_daemon):
    sim = start_sim("--fast")
    d = start_daemon("--config", sim.folder / "goniod-tcp.cfg")
    reply = d.submit(TINY)
    d.follow(reply["event_id"]).until_state(reply["run"], "done")
    assert sim.control(do="state")


@pytest.mark.parametrize("args, says", [
    ([], "goniod --sim"),
    (["--sim", "--config", "x"], "leave out --config"),
    (["--fast", "--config", "x"], "add --sim"),
    (["--config", "/nowhere/x.cfg"], "/nowhere/x.cfg"),
    (["--sim", "--sped", "1"], "did you mean '--seed'?"),
    (["--sim", "--log", "debgu"], "did you mean 'debug'?"),
    (["--sim", "--socket", "/" + "x" * 200], "107"),
    (["--sim", "extra"], "too many"),
])
def test_wrong_options_are_status_2(tmp_path, args, says):
    env = {**os.environ, "GONIO_SOCKET": str(tmp_path / "s"), "GONIO_DIR": str(tmp_path)}
    r = subprocess.run([BUILD / "goniod", *args], capture_output=True, text=True, timeout=PATIENCE_S, env=env, check=False)
    assert r.returncode == 2 and says in r.stderr, r


def test_too_few_descriptors_are_refused_and_few_are_raised(tmp_path):
    (tmp_path / "no.cfg").write_text("bench: { };")

    def limited(soft, hard):
        limits = f"ulimit -Sn {soft}; ulimit -Hn {hard}; exec \"$0\" --config no.cfg --socket s"
        return subprocess.run(["sh", "-c", limits, BUILD / "goniod"], cwd=tmp_path, capture_output=True, text=True,
                              timeout=PATIENCE_S)

    few = limited(16, 64)
    assert few.returncode == 1 and "only 64 open files are allowed, 128 are needed" in few.stderr, few
    raised = limited(16, 256)
    assert raised.returncode == 2 and "no.cfg:1" in raised.stderr, raised  # as far as its bench


class Closed(Daemon):
    wrap = ("/bin/sh", "-c", 'exec "$@" <&- 2>&-', "sh")


def test_what_is_said_on_a_closed_standard_error_goes_nowhere(start_sim, tmp_path):
    sim = start_sim("--fast")
    d = Closed(tmp_path / "d", "--config", sim.folder / "goniod.cfg", "--log", "debug")
    try:
        for fd in (0, 2):
            assert os.readlink(f"/proc/{d.pid}/fd/{fd}") == "/dev/null"
        for lock in (d.directory / ".goniod.lock", d.socket.with_name(d.socket.name + ".lock")):
            assert "Z " not in lock.read_text(), "a line of the log"
    finally:
        assert d.end() == 0
