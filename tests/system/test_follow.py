# SPDX-License-Identifier: MIT
"""gonio run and watch when following is not as easy as usual: the daemon dies, events are lost, no stream is free,
Ctrl-C comes early. What cannot be had from goniod on demand is played by a stand-in for its HTTP."""
import http.server
import json
import os
import signal
import socketserver
import threading

import pytest

from conftest import BUILD, PATIENCE_S, SMALL, Program, gonio, short_folder, wait_for

LONG = SMALL.replace("step_deg = 5.0", "step_deg = 1.0").replace('"small"', '"long"')


class StandIn(socketserver.ThreadingMixIn, socketserver.UnixStreamServer):
    """Answers GET with what a list of (path, status, text) says, each entry once but the last of a path."""
    daemon_threads = True

    def __init__(self, folder, *answers):
        self.answers = list(answers)
        self.path = short_folder(folder) / f"stand-in-{id(self)}.sock"
        super().__init__(str(self.path), Handler)
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def take(self, path):
        mine = [a for a in self.answers if a[0] == path]
        if not mine:
            return 404, '{"error":"there is no such run"}'
        if len(mine) > 1:
            self.answers.remove(mine[0])
        return mine[0][1:]


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        status, text = self.server.take(self.path)
        self.send_response(status)
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(text.encode())
        self.close_connection = True
        if self.path == "/api/v1/events" and status == 200 and "hold" in text:
            self.wfile.flush()
            self.server.held = self.request.recv(1)  # until the client goes

    def log_message(self, *args):
        pass

    def address_string(self):
        return "client"


def run_reply(state, text="", **more):
    return json.dumps({"run": 1, "name": "x", "file": "/nowhere/0001-x.gonio", "state": state, "text": text, "sweep": 1,
                       "sweeps": 2, "done": 3, "total": 9, "emission": False, "fit": None, **more})


def status_reply(state="running"):
    return json.dumps({"run": json.loads(run_reply(state)), "event_id": 7})


LOST = ': hold\n\nid: 90\nevent: lost\ndata: {"event":"lost","first":8,"last":90}\n\n'
FIT = {"params": {}, "derived": {}, "delta": 1.5}


@pytest.fixture
def stand_in(tmp_path):
    servers = []

    def start(*answers):
        servers.append(StandIn(tmp_path, *answers))
        return {"GONIO_SOCKET": str(servers[-1].path)}

    yield start
    for s in servers:
        s.shutdown()
        s.server_close()


@pytest.mark.parametrize("state, fit, status", [("done", FIT, 0), ("stopped", None, 1), ("failed", None, 1)])
def test_an_end_among_lost_events_is_asked_for(stand_in, state, fit, status):
    env = stand_in(("/api/v1/status", 200, status_reply()), ("/api/v1/events", 200, LOST),
                   ("/api/v1/runs/1", 200, run_reply(state, fit=fit)))
    r = gonio("watch", env=env, patience_s=PATIENCE_S)
    assert r.returncode == status and f"run 1 {state}" in r.stderr, r
    r = gonio("watch", "--json", env=env, patience_s=PATIENCE_S)
    events = [json.loads(line) for line in r.stdout.splitlines()]
    assert r.returncode == status and events[-1]["event"] == "state" and events[-1]["state"] == state
    assert [e["fit"] for e in events if e["event"] == "fit"] == ([fit] if fit else [])


def test_a_run_that_goes_on_after_lost_events_is_followed_on(stand_in):
    ended = 'event: state\nid: 91\ndata: {"event":"state","run":1,"state":"stopped","text":"by hand"}\n\n'
    env = stand_in(("/api/v1/status", 200, status_reply()), ("/api/v1/events", 200, LOST + ended),
                   ("/api/v1/runs/1", 200, run_reply("running")))
    r = gonio("watch", env=env, patience_s=PATIENCE_S)
    assert r.returncode == 1 and "run 1 stopped: by hand" in r.stderr


def test_a_run_that_the_daemon_does_not_know_any_more_is_no_success(stand_in):
    env = stand_in(("/api/v1/status", 200, status_reply()), ("/api/v1/events", 200, LOST))
    r = gonio("watch", env=env, patience_s=PATIENCE_S)
    assert r.returncode == 1 and "does not know run 1 any more" in r.stderr, r


def test_without_a_stream_the_run_is_asked_for(stand_in):
    full = '{"error":"too many event streams (8)","what_to_do":"stop one of the others that watch"}'
    env = stand_in(("/api/v1/status", 200, status_reply()), ("/api/v1/events", 503, full),
                   ("/api/v1/runs/1", 200, run_reply("running")), ("/api/v1/runs/1", 200, run_reply("running", done=4)),
                   ("/api/v1/runs/1", 503, full),
                   ("/api/v1/runs/1", 200, run_reply("paused", "laser: gone", done=5, fit=FIT)),
                   ("/api/v1/runs/1", 200, run_reply("done", done=9, fit=FIT)))
    r = gonio("watch", "--json", env=env, patience_s=PATIENCE_S)
    assert r.returncode == 0, r
    events = [json.loads(line) for line in r.stdout.splitlines()]
    assert [e["done"] for e in events if e["event"] == "reading"] == [3, 4, 5, 9]
    assert [e["state"] for e in events if e["event"] == "state"] == ["running", "paused", "done"]
    assert sum(e["event"] == "fit" for e in events) == 1
    assert r.stderr.count("once a second") == 1


def test_a_killed_daemon_that_is_back_tells_what_became_of_the_run(start_sim, start_daemon, tmp_path):
    sim = start_sim("--fast", "--seed", "5", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    d = start_daemon("--config", sim.folder / "goniod-tcp.cfg")
    config = tmp_path / "long.cfg"
    config.write_text(LONG)
    run = Program([BUILD / "gonio", "run", config], tmp_path / "run.err", d.env)
    wait_for(lambda: "sweep 1/" in run.errors())
    watch = Program([BUILD / "gonio", "watch", "--json"], tmp_path / "watch.err", d.env)
    watch.wait_line('{"event":"reading"')
    d.end(signal.SIGKILL)
    start_daemon("--config", sim.folder / "goniod-tcp.cfg")
    assert run.process.wait(PATIENCE_S) == 1
    assert "the daemon is back" in run.errors() and "run 1 stopped: interrupted" in run.errors()
    assert "go on with: gonio resume 1" in run.errors() and "theta_i nan" not in run.errors()
    assert json.loads(watch.wait_line('{"event":"state"'))["state"] == "stopped"
    assert watch.process.wait(PATIENCE_S) == 1


def test_run_follows_when_all_streams_are_taken(daemon, stand_in, tmp_path):
    config = tmp_path / "small.cfg"
    config.write_text(SMALL)
    streams = [daemon.follow() for _ in range(8)]
    try:
        r = daemon.gonio("run", config)
        assert r.returncode == 0 and "once a second" in r.stderr, r
        assert "sigma" in r.stdout and ".gonio" in r.stderr
    finally:
        for s in streams:
            s.close()
    # A daemon that was started since then does not know the fit; the file does.
    (file,) = [e["file"] for e in daemon.request("GET", "/api/v1/runs")[1]["runs"] if e["state"] == "done"]
    env = stand_in(("/api/v1/status", 200, status_reply()), ("/api/v1/events", 200, LOST),
                   ("/api/v1/runs/1", 200, run_reply("done")))
    assert gonio("watch", env=env, patience_s=PATIENCE_S).returncode == 1
    env["GONIO_SOCKET"] = stand_in(
        ("/api/v1/status", 200, status_reply().replace("/nowhere/0001-x.gonio", file)),
        ("/api/v1/events", 200, LOST), ("/api/v1/runs/1", 200, run_reply("done")))["GONIO_SOCKET"]
    again = gonio("watch", env=env, patience_s=PATIENCE_S)
    assert again.returncode == 0 and again.stdout == r.stdout, again


def has_socket(pid):
    folder = f"/proc/{pid}/fd"

    def kind(fd):
        try:
            return os.readlink(f"{folder}/{fd}")
        except FileNotFoundError:  # closed meanwhile
            return ""

    return any(kind(fd).startswith("socket:") for fd in os.listdir(folder))


@pytest.mark.parametrize("options", [[], ["--detach"]])
def test_ctrl_c_before_the_answer_says_that_the_run_was_started(daemon, tmp_path, options):
    config = tmp_path / "long.cfg"
    config.write_text(LONG)
    daemon.process.send_signal(signal.SIGSTOP)
    try:
        p = Program([BUILD / "gonio", "run", config, *options], tmp_path / "err", daemon.env)
        wait_for(lambda: has_socket(p.pid))
        p.process.send_signal(signal.SIGINT)
    finally:
        daemon.process.send_signal(signal.SIGCONT)
    assert p.process.wait(PATIENCE_S) == 130
    assert "was started and goes on" in p.errors() and "gonio stop" in p.errors()
    assert daemon.status()["run"] is not None
    assert daemon.gonio("stop").returncode == 0


def test_ctrl_c_ends_a_question_that_nobody_answers(start_daemon, tmp_path):
    daemon = start_daemon()
    config = tmp_path / "long.cfg"
    config.write_text(LONG)
    daemon.process.send_signal(signal.SIGSTOP)
    try:
        p = Program([BUILD / "gonio", "run", config], tmp_path / "err", daemon.env)
        wait_for(lambda: has_socket(p.pid))
        p.process.send_signal(signal.SIGINT)
        assert p.process.wait(PATIENCE_S) == 130
    finally:
        daemon.process.send_signal(signal.SIGCONT)
    assert "has not answered" in p.errors() and "gonio status" in p.errors()
