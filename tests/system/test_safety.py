# SPDX-License-Identifier: MIT
"""What goniod says of the laser is what was read back, and it ends within 5 s of SIGTERM whatever hangs."""
import os
import pty
import signal
import sqlite3
import subprocess
import termios
import time

import pytest

from conftest import BUILD, QUICK_LASER, ROOT, Daemon

PLAN = """\
campaign: {
  name = "safety";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""


@pytest.fixture
def measuring(start_sim, start_daemon):
    """A run with the laser on."""
    sim = start_sim("--fast", "--seed", "9", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    reply = daemon.submit(PLAN, "safety.cfg")
    events = daemon.follow(0)
    for _ in range(3):
        events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    assert sim.control(do="state")["laser"]["emission"]
    yield sim, daemon, reply, events
    os.kill(sim.pid, signal.SIGCONT)


class Unread(Daemon):
    """Its standard error is what nobody reads: a pipe, or a terminal where Ctrl-S was typed."""

    def __init__(self, folder, kind, *bench):
        if kind == "pipe":
            self.error = folder / "stderr"
            os.mkfifo(self.error)
            self.ends = [os.open(self.error, os.O_RDWR | os.O_NONBLOCK)]
        else:
            master, slave = pty.openpty()
            self.error = os.ttyname(slave)
            self.ends = [os.open(self.error, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY), slave, master]
        self.wrap = ("/bin/sh", "-c", f'exec "$@" 2>{self.error}', "sh")
        super().__init__(folder, *bench)

    def stop_reading(self):
        if len(self.ends) > 1:
            termios.tcflow(self.ends[1], termios.TCOOFF)
        try:
            while True:
                os.write(self.ends[0], b"x" * 1000)
        except BlockingIOError:
            pass


@pytest.mark.parametrize("kind", ["pipe", "terminal"])
def test_a_log_that_nobody_reads_holds_up_neither_a_stop_nor_the_end(start_sim, tmp_path, kind):
    sim = start_sim("--fast", "--seed", "9", *QUICK_LASER)
    (tmp_path / "d").mkdir()
    d = Unread(tmp_path / "d", kind, "--config", sim.folder / "goniod.cfg")
    try:
        reply = d.submit(PLAN, "safety.cfg")
        events = d.follow(0)
        events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
        d.stop_reading()
        assert sim.control(do="state")["laser"]["emission"]
        stopped = d.gonio("stop")
        assert stopped.returncode == 0, stopped.stderr
        assert not sim.control(do="state")["laser"]["emission"]
        assert d.request("GET", f"/api/v1/runs/{reply['run']}")[1]["state"] == "stopped"
    finally:
        assert d.end() == 0


def test_a_stop_never_says_off_of_a_laser_that_ignores_it(measuring):
    sim, daemon, reply, _ = measuring
    sim.control(do="set", ignore_off=True)
    stopped = daemon.gonio("stop")
    assert sim.control(do="state")["laser"]["emission"]
    assert stopped.returncode == 1 and "laser off" not in stopped.stderr, stopped.stderr
    assert "use its key or the interlock" in stopped.stderr
    text = daemon.request("GET", f"/api/v1/runs/{reply['run']}")[1]["text"]
    assert "LASER MAY BE ON" in text
    sim.control(do="set", ignore_off=False)
    daemon_status = daemon.end()
    assert not sim.control(do="state")["laser"]["emission"], "tried again at the end"
    assert daemon_status == 0


def test_a_stop_never_says_off_of_a_laser_that_is_unplugged(measuring):
    sim, daemon, _, events = measuring
    sim.control(do="unplug", wire="laser")
    events.until(lambda e: e["event"] == "state" and e["state"] == "paused")
    stopped = daemon.gonio("stop")
    assert stopped.returncode == 1 and "laser off" not in stopped.stderr, stopped.stderr
    assert "LASER MAY BE ON: use its key or the interlock" in stopped.stderr
    assert "LASER MAY BE ON" in daemon.gonio("status").stdout
    assert sim.control(do="state")["laser"]["emission"]
    assert daemon.end() == 1
    assert "LASER MAY BE ON" in daemon.errors()


def test_a_second_stop_says_it_too(measuring):
    sim, daemon, _, _ = measuring
    sim.control(do="set", ignore_off=True)
    assert daemon.gonio("stop").returncode == 1
    status, reply = daemon.request("POST", "/api/v1/stop")[:2]
    assert status == 500 and reply["laser_off"] is False and "LASER MAY BE ON" in reply["error"], reply
    again = daemon.gonio("stop")
    assert again.returncode == 1 and "LASER MAY BE ON" in again.stderr, again.stderr
    sim.control(do="set", ignore_off=False)
    assert daemon.end() == 0


def test_a_laser_that_was_never_there_is_not_called_off(tmp_path):
    bench = (ROOT / "configs" / "goniod.cfg").read_text().replace("/dev/serial/by-id", str(tmp_path))
    (tmp_path / "goniod.cfg").write_text(bench)
    daemon = Daemon(tmp_path / "d", "--config", tmp_path / "goniod.cfg")
    assert daemon.end() == 1
    assert "LASER MAY BE ON" in daemon.errors() and "laser off" not in daemon.errors()


def dark_within(sim, patience_s):
    """Seconds until goniosim's own laser is off."""
    begun = time.monotonic()
    while sim.control(do="state")["laser"]["emission"]:
        assert time.monotonic() - begun < patience_s, "still on"
        time.sleep(0.01)
    return time.monotonic() - begun


def test_a_stop_is_dark_at_once_when_the_axes_do_not_answer(measuring):
    sim, daemon, _, _ = measuring
    sim.control(do="mute", wire="axes")
    stopping = subprocess.Popen([BUILD / "gonio", "stop", "--socket", daemon.socket], stderr=subprocess.PIPE, text=True)
    dark_within(sim, 1.5)
    assert stopping.wait(30) == 0, stopping.communicate()
    assert "laser off" in stopping.stderr.read()


def test_sigterm_is_dark_at_once_when_the_axes_do_not_answer(measuring):
    sim, daemon, _, _ = measuring
    sim.control(do="mute", wire="axes")
    os.kill(daemon.pid, signal.SIGTERM)
    dark_within(sim, 1.5)
    daemon.end()
    assert "LASER MAY BE ON" not in daemon.errors()


def ends_in_time(daemon):
    begun = time.monotonic()
    status = daemon.end(signal.SIGTERM, patience_s=20)
    assert time.monotonic() - begun < 5.0
    return status


def test_sigterm_ends_it_when_the_laser_ignores_off(measuring):
    sim, daemon, _, _ = measuring
    sim.control(do="set", ignore_off=True)
    assert ends_in_time(daemon) == 1
    assert "LASER MAY BE ON" in daemon.errors()


def test_sigterm_ends_it_when_every_device_is_frozen(measuring):
    sim, daemon, _, _ = measuring
    os.kill(sim.pid, signal.SIGSTOP)
    assert ends_in_time(daemon) == 1
    assert "LASER MAY BE ON" in daemon.errors()


def test_sigterm_ends_it_when_the_campaign_file_is_locked(measuring):
    sim, daemon, reply, _ = measuring
    with sqlite3.connect(reply["file"], isolation_level=None) as db:
        db.execute("begin immediate")
        ends_in_time(daemon)
        db.execute("rollback")
    assert not sim.control(do="state")["laser"]["emission"], "off before the end"
    assert "LASER MAY BE ON" not in daemon.errors() and "The laser is off" in daemon.errors()
    assert db.execute("pragma quick_check").fetchone() == ("ok",)
