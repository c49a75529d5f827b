# SPDX-License-Identifier: MIT
"""goniod under a service manager: what it says on $NOTIFY_SOCKET, its watchdog, and the unit that is installed."""
import ctypes
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import time

import pytest

from conftest import PATIENCE_S, ROOT, Program, BUILD, short_folder

UNIT = ROOT / "configs" / "systemd" / "goniod.service"
EXPOSURE_MOST = 1.5


class Manager:
    """The manager's end of the socket."""

    def __init__(self, folder):
        self.path = short_folder(folder) / "notify.sock"
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(self.path))
        self.said = []

    def until(self, wanted, patience_s=PATIENCE_S):
        end = time.monotonic() + patience_s
        while True:
            self.socket.settimeout(max(0.01, end - time.monotonic()))
            try:
                message = self.socket.recv(4096).decode()
            except TimeoutError:
                raise AssertionError(f"no {wanted} within {patience_s} s; said {self.said}") from None
            self.said.append(message)
            if message.startswith(wanted):
                return message

    def drain(self):
        self.socket.setblocking(False)
        try:
            while True:
                self.said.append(self.socket.recv(4096).decode())
        except BlockingIOError:
            pass


@pytest.fixture
def manager(tmp_path):
    m = Manager(tmp_path / "manager")
    yield m
    m.socket.close()


def test_ready_status_and_end_are_told(manager, start_daemon):
    d = start_daemon(env={"NOTIFY_SOCKET": str(manager.path), "WATCHDOG_USEC": "10000000"})
    manager.until("READY=1")
    assert manager.until("STATUS=") == "STATUS=idle, laser off"
    manager.until("WATCHDOG=1")
    run = d.submit()["run"]
    assert re.fullmatch(rf"STATUS=run {run} \(small\) \w+, \d+ of \d+ points", manager.until(f"STATUS=run {run}"))
    assert d.end() == 0
    manager.drain()
    assert manager.said.count("READY=1") == 1 and "STOPPING=1" in manager.said


def test_children_do_not_speak_for_goniod(manager, start_daemon):
    d = start_daemon(env={"NOTIFY_SOCKET": str(manager.path)})
    manager.until("READY=1")
    children = subprocess.run(["pgrep", "-P", str(d.pid)], capture_output=True, text=True, check=False).stdout.split()
    assert children, "goniod --sim has the simulator as its child"
    for child in children:
        assert b"NOTIFY_SOCKET" not in pathlib.Path(f"/proc/{child}/environ").read_bytes()


def child_of(d):
    (sim,) = subprocess.run(["pgrep", "-P", str(d.pid), "goniosim"], capture_output=True, text=True,
                            check=True).stdout.split()
    return int(sim)


def test_devices_that_do_not_answer_are_no_hang(manager, start_daemon):
    d = start_daemon(env={"NOTIFY_SOCKET": str(manager.path)})
    manager.until("READY=1")
    sim = child_of(d)
    os.kill(sim, signal.SIGSTOP)
    try:
        manager.drain()
        for _ in range(8):
            manager.until("WATCHDOG=1", 7.0)
    finally:
        os.kill(sim, signal.SIGCONT)


class Frozen:
    """One thread of a process stopped, the others running: by ptrace."""
    SEIZE, INTERRUPT, DETACH = 0x4206, 0x4207, 17

    def __init__(self, tid):
        self.tid = tid
        self.ptrace = ctypes.CDLL(None, use_errno=True).ptrace
        self.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        self.call(self.SEIZE)
        self.call(self.INTERRUPT)
        os.waitpid(tid, 0x40000000)  # __WALL

    def call(self, request):
        if self.ptrace(request, self.tid, None, None) < 0:
            raise OSError(ctypes.get_errno(), "ptrace")

    def thaw(self):
        self.call(self.DETACH)


def test_a_hung_instrument_thread_is_not_called_alive(manager, start_daemon):
    d = start_daemon(env={"NOTIFY_SOCKET": str(manager.path)})
    manager.until("WATCHDOG=1")
    (tid,) = [int(t.name) for t in pathlib.Path(f"/proc/{d.pid}/task").iterdir()
              if (t / "comm").read_text().strip() == "instrument"]
    frozen = Frozen(tid)
    try:
        time.sleep(8.0)  # the looks of the last 6 s still count
        manager.drain()
        assert d.status()["state"] == "idle", "the main thread answers"
        manager.drain()
        with pytest.raises(AssertionError):
            manager.until("WATCHDOG=1", 4.0)
    finally:
        frozen.thaw()
    manager.until("WATCHDOG=1")


def test_a_wrong_address_is_refused(tmp_path):
    d = Program([BUILD / "goniod", "--sim"], tmp_path / "log", {"NOTIFY_SOCKET": "relative/path",
                                                               "XDG_RUNTIME_DIR": str(short_folder(tmp_path))})
    assert d.process.wait(PATIENCE_S) == 1
    assert "NOTIFY_SOCKET=relative/path: neither a path nor an abstract name" in d.errors()


def test_an_abstract_address(tmp_path, start_daemon):
    s = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    name = f"gonio-test-{os.getpid()}"
    s.bind("\0" + name)
    s.settimeout(PATIENCE_S)
    start_daemon(env={"NOTIFY_SOCKET": "@" + name})
    assert s.recv(100) in (b"READY=1", b"WATCHDOG=1")
    s.close()


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")
def test_the_unit_is_hardened(tmp_path):
    unit = tmp_path / UNIT.name
    unit.write_text(UNIT.read_text().replace("@PREFIX@", "/usr"))
    r = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", str(unit)],
                       capture_output=True, text=True, check=False)
    exposure = float(re.search(r"Overall exposure level for goniod.service: ([\d.]+)", r.stdout).group(1))
    assert exposure <= EXPOSURE_MOST, r.stdout


def test_the_unit_has_what_safety_needs():
    settings = [line.partition("=") for line in UNIT.read_text().splitlines() if "=" in line and line[0] != "#"]
    unit = {name: value for name, _, value in settings}
    assert unit["Type"] == "notify"
    assert unit["WatchdogSec"] == "10"
    assert "gonio laser off --bench" in unit["ExecStopPost"]
    assert float(unit["TimeoutStopSec"]) > 4.5, "goniod ends within 4.5 s, whatever hangs"
