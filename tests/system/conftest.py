# SPDX-License-Identifier: MIT
"""Helpers of the system tests: programs started with bounded waits on what they say, HTTP over the Unix
socket, the event stream, and goniosim's control socket. Every process is ended by its own id."""
import atexit
import hashlib
import http.client
import json
import os
import pathlib
import queue
import shutil
import signal
import socket
import sqlite3
import subprocess
import tempfile
import threading
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("GONIO_BUILD", ROOT / "build")).resolve()
PATIENCE_S = 20.0  # for anything that should be there within a second; generous for a loaded machine

QUICK_LASER = ("--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")

SMALL = """\
campaign: {
  name = "small";
  theta_i_deg = [ 0.0, 20.0, 40.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 5.0; };
  dense: { half_width_deg = 3.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""


def query(file, sql):
    """Rows of a campaign file, whoever was killed while it was written: not mode=ro, which cannot take a
    killed writer's transaction back."""
    db = sqlite3.connect(file)
    try:
        db.execute("pragma query_only = 1")
        return db.execute(sql).fetchall()
    finally:
        db.close()


def wait_for(true, patience_s=PATIENCE_S):
    """Until true() is: for what is announced by nothing."""
    end = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end, f"not within {patience_s} s"
        time.sleep(0.02)


class Program:
    """A program whose standard output is read line by line; standard error goes to a file."""

    def __init__(self, argv, log, env=None, stdin=None, cwd=None):
        self.log = pathlib.Path(log)
        self.argv = [str(a) for a in argv]
        with open(self.log, "ab") as err:
            self.process = subprocess.Popen(self.argv, stdin=stdin, stdout=subprocess.PIPE, stderr=err,
                                            text=True, cwd=cwd, env={**os.environ, **(env or {})})
        self.pid = self.process.pid
        self.lines = queue.Queue()
        self.said = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))
        self.lines.put(None)

    def wait_line(self, begins, patience_s=PATIENCE_S):
        """The first line that begins so; fails with everything that was said instead."""
        end = time.monotonic() + patience_s
        while True:
            try:
                line = self.lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                line = None
            if line is None:
                raise AssertionError(f"{self.argv}: no line '{begins}'; said {self.said}, "
                                     f"errors: {self.errors()}")
            self.said.append(line)
            if line.startswith(begins):
                return line

    def errors(self):
        return self.log.read_text(errors="replace")

    def end(self, sig=signal.SIGTERM, patience_s=10.0):
        """Sends the signal and returns the exit status; kills what does not end in time."""
        if self.process.poll() is None:
            self.process.send_signal(sig)
        try:
            return self.process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.argv} did not end within {patience_s} s after signal {sig}; "
                                 f"errors: {self.errors()}") from None


class UnixConnection(http.client.HTTPConnection):
    def __init__(self, path, timeout=PATIENCE_S):
        super().__init__("goniod", timeout=timeout)
        self.path = str(path)

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self.path)


class Stream:
    """Server-sent events as dicts, from the daemon's socket."""

    def __init__(self, path, last_id=None):
        self.connection = UnixConnection(path)
        headers = {} if last_id is None else {"Last-Event-ID": str(last_id)}
        self.connection.request("GET", "/api/v1/events", headers=headers)
        self.response = self.connection.getresponse()
        self.seen = []

    def next(self, end=float("inf")):
        """The next event, before the time end: pings alone keep the connection for ever."""
        data = None
        while time.monotonic() < end:
            line = self.response.readline().decode()
            if not line:
                raise AssertionError(f"the event stream ended; seen {self.seen[-5:]}")
            if line.startswith("data: "):
                data = json.loads(line[6:])
            elif line == "\n" and data is not None:
                self.seen.append(data)
                return data
        raise AssertionError(f"no event; last events {self.seen[-5:]}")

    def until(self, wanted, patience_s=PATIENCE_S):
        """The first event for which wanted(event) is true."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            event = self.next(end)
            if wanted(event):
                return event
        raise AssertionError(f"not within {patience_s} s; last events {self.seen[-5:]}")

    def until_state(self, run, *states, patience_s=60.0):
        return self.until(lambda e: e["event"] == "state" and e["run"] == run and e["state"] in states,
                          patience_s)

    def close(self):
        self.connection.close()


class Sim(Program):
    """goniosim in its own run directory."""

    def __init__(self, folder, *args):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        super().__init__([BUILD / "goniosim", "--run-dir", self.folder, *args], f"{self.folder}.log")
        self.wait_line("ready")

    def control(self, **command):
        return control(self.folder / "control.sock", **command)


def control(path, **command):
    """One question to goniosim's control socket: control(path, do="unplug", wire="laser")."""
    path = pathlib.Path(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as s:
        s.settimeout(PATIENCE_S)
        folder = os.open(path.parent, os.O_PATH)
        try:
            s.connect(f"/proc/self/fd/{folder}/{path.name}")  # whatever the path's length
        finally:
            os.close(folder)
        s.sendall(json.dumps(command).encode() + b"\n")
        with s.makefile() as answers:
            return json.loads(answers.readline())


def short_folder(of):
    """A folder for sockets that belongs to a folder: a socket's address holds 107 bytes, less than tmp_path may need."""
    name = hashlib.sha1(str(of).encode()).hexdigest()[:12]
    folder = pathlib.Path(tempfile.gettempdir()) / f"gonio-{name}"
    folder.mkdir(mode=0o700, exist_ok=True)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


class Daemon(Program):
    """goniod with its socket and campaigns in a folder; bench: arguments that name it."""
    wrap = ()  # what runs it
    made = []  # all of them, until their guards are known to be gone

    def __init__(self, folder, *bench, env=None, ready=True):
        Daemon.made.append(self)
        self.folder = pathlib.Path(folder)
        self.directory = self.folder / "campaigns"
        self.runtime = short_folder(self.folder)  # --sim makes its run directory here
        self.socket = self.runtime / "goniod.sock"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.directory.mkdir(exist_ok=True)
        self.env = {"GONIO_SOCKET": str(self.socket), "GONIO_DIR": str(self.directory),
                    "XDG_RUNTIME_DIR": str(self.runtime), **(env or {})}
        super().__init__([*self.wrap, BUILD / "goniod", *(bench or ("--sim", "--fast"))], self.folder / "goniod.log",
                         self.env)
        if ready:
            self.wait_line("ready")

    def gonio(self, *args, **kwargs):
        return gonio(*args, env=self.env, **kwargs)

    def request(self, method, path, body=None, headers=None):
        """Status and JSON of one request; body: text, bytes, or what becomes JSON."""
        if body is not None and not isinstance(body, (str, bytes)):
            body = json.dumps(body)
        c = UnixConnection(self.socket)
        try:
            c.request(method, path, body=body, headers=headers or {})
            r = c.getresponse()
            return r.status, json.loads(r.read() or b"null")
        finally:
            c.close()

    def submit(self, config=SMALL, name="small.cfg"):
        """Queues a campaign; the reply with 'run', 'file' and 'event_id'."""
        status, reply = self.request("POST", "/api/v1/runs", {"config": config, "name": name})
        assert status == 201, reply
        return reply

    def status(self):
        status, reply = self.request("GET", "/api/v1/status")
        assert status == 200, reply
        return reply

    def follow(self, last_id=None):
        return Stream(self.socket, last_id)

    def stop_socket(self):
        return self.runtime / "goniod-guard.sock"

    def guard_pid(self):
        """Of the process behind the STOP socket, without connecting to it, which would mean OFF; None: there is none."""
        inodes = {line.split()[6] for line in pathlib.Path("/proc/net/unix").read_text().splitlines()[1:]
                  if line.endswith(f" {self.stop_socket()}")}
        for process in pathlib.Path("/proc").glob("[0-9]*") if inodes else ():
            try:
                if (process / "comm").read_text() != "gonio-guard\n":
                    continue
                if inodes & {os.readlink(fd)[len("socket:["):-1] for fd in (process / "fd").iterdir()}:
                    return int(process.name)
            except OSError:
                continue
        return None

    def sim_folder(self):
        """The run directory of the simulator that --sim started."""
        (folder,) = self.runtime.glob("goniosim-*")
        return folder

    def sim_control(self, **command):
        return control(self.sim_folder() / "control.sock", **command)


def gonio(*args, env=None, patience_s=60.0, cwd=None, stdin=None, **kwargs):
    """Runs the command to its end: a CompletedProcess with text. kwargs: as subprocess.run, for another user."""
    return subprocess.run([str(BUILD / "gonio"), *map(str, args)], capture_output=True, text=True,
                          timeout=patience_s, cwd=cwd, input=stdin, check=False,
                          env={**os.environ, "NO_COLOR": "", **(env or {})}, **kwargs)


LONGEST = ["test_paper_campaign", "test_profile_campaign", "test_walkthrough", "test_exclude", "test_suspend",
           "test_queue", "test_service", "test_unplug", "test_replug", "test_safety", "test_daemon", "test_kill"]


def pytest_configure(config):
    config.addinivalue_line("markers", "timed: measures how long something takes; scripts/system runs it in quiet")


def spread(few, many):
    """Each of the few with its share of the many behind it."""
    share = len(many) // max(len(few), 1)
    mixed = []
    for i, one in enumerate(few):
        mixed += [one, *many[i * share:(i + 1) * share]]
    return mixed + many[len(few) * share:]


def pytest_collection_modifyitems(items):
    """The longest first, one to a worker: xdist deals the first quarter in equal runs of consecutive tests, so the
    tests that lead those runs are the long ones, and short ones wait behind them. What is long besides is spread, as
    later on, too, a worker gets several tests that follow each other."""
    rank = {name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.module.__name__, len(LONGEST)))
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    run = max(len(items) // (4 * workers), 2)
    leaders, rest = items[:workers], items[workers:]
    short = [item for item in rest if item.module.__name__ not in rank]
    others = [item for item in rest if item.module.__name__ in rank]
    dealt = []
    for leader in leaders:
        dealt += [leader, *short[:run - 1]]
        del short[:run - 1]
    items[:] = dealt + spread(others, short)


@pytest.fixture(autouse=True)
def no_guard_stays():
    """A guard tries for ever to switch a laser off that it does not reach: here those are simulators that ended."""
    yield
    for d in [d for d in Daemon.made if d.process.poll() is not None]:
        Daemon.made.remove(d)
        pid = d.guard_pid()
        if pid:
            os.kill(pid, signal.SIGKILL)


@pytest.fixture
def start_daemon(tmp_path):
    """Starts daemons and ends them, whatever happens to the test."""
    daemons = []

    def start(*bench, folder=None, **kwargs):
        d = Daemon(folder or tmp_path, *bench, **kwargs)
        daemons.append(d)
        return d

    yield start
    for d in daemons:
        d.end()


@pytest.fixture
def start_sim(tmp_path):
    sims = []

    def start(*args, folder=None):
        s = Sim(folder or tmp_path / "bench", *args)
        sims.append(s)
        return s

    yield start
    for s in sims:
        s.end()


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """One goniod for all tests of a module that leave it idle; its bench (daemon.bench) warms up at once."""
    folder = tmp_path_factory.mktemp("d")
    bench = Sim(folder / "bench", "--fast", "--seed", "7", *QUICK_LASER)
    d = Daemon(folder, "--config", bench.folder / "goniod.cfg")
    d.bench = bench
    yield d
    try:
        assert d.end() == 0, d.errors()
    finally:
        bench.end()
