# SPDX-License-Identifier: MIT
"""The command that tells somebody who is not there: on pause, failure and completion, without a shell."""
import re
import stat
import time

import pytest

from conftest import QUICK_LASER, SMALL, wait_for

NASTY = "a $(touch pwned); `id` 'b'"


@pytest.fixture
def bench(start_sim):
    sim = start_sim("--fast", *QUICK_LASER)
    return sim


def script(tmp_path, body):
    path = tmp_path / "tell"
    path.write_text("#!/bin/sh\n" + body)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def config(sim, tmp_path, *argv, limit=""):
    text = (sim.folder / "goniod.cfg").read_text()
    words = ", ".join(f'"{a}"' for a in argv)
    path = tmp_path / "goniod.cfg"
    path.write_text(re.sub(r"daemon\s*:\s*\{.*?\};", "", text, flags=re.S) + f"\ndaemon: {{ notify = ( {words} ); {limit} }};\n")
    return path


def test_pause_and_completion_are_told(bench, tmp_path, start_daemon):
    out = tmp_path / "out"
    tell = script(tmp_path, f'printf "%s|" "$GONIO_EVENT" "$GONIO_RUN" "$GONIO_CAMPAIGN" "$GONIO_TEXT" "$@" >>{out}\n'
                            f"echo >>{out}\n")
    d = start_daemon("--config", config(bench, tmp_path, tell, "first argument"), folder=tmp_path / "d")
    run = d.submit(SMALL.replace('"small"', f'"{NASTY}"'))["run"]
    wait_for(lambda: d.status()["run"]["done"] > 5, 60)
    assert d.gonio("pause").returncode == 0
    wait_for(out.exists)
    assert d.gonio("resume", patience_s=120).returncode == 0
    wait_for(lambda: len(out.read_text().splitlines()) == 2)
    paused, done = (line.split("|") for line in out.read_text().splitlines())
    assert paused[:3] == ["paused", str(run), NASTY] and "operator" in paused[3]
    assert paused[4:6] == ["first argument", f"run {run} ({NASTY}) paused: {paused[3]}"]
    assert done[:3] == ["done", str(run), NASTY] and done[5] == f"run {run} ({NASTY}) done"
    assert not list(tmp_path.rglob("pwned")) and not list(d.folder.rglob("pwned"))


def test_one_that_hangs_is_killed_with_its_children(bench, tmp_path, start_daemon):
    pid = tmp_path / "pid"
    tell = script(tmp_path, f"sleep 1000 &\necho $! >{pid}\nwait\n")
    d = start_daemon("--config", config(bench, tmp_path, tell, limit="notify_limit_s = 0.5;"), folder=tmp_path / "d")
    d.submit(SMALL)
    wait_for(lambda: (d.status()["run"] or {"done": 0})["done"] > 5, 60)
    begun = time.monotonic()
    d.gonio("pause")
    wait_for(lambda: "not done after 0.5 s, killed" in d.errors())
    child = int(pid.read_text())
    wait_for(lambda: not alive(child))
    assert d.status()["state"] == "paused" and time.monotonic() - begun < 20


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as f:
            return f.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_what_cannot_start_is_said_and_harms_nothing(bench, tmp_path, start_daemon):
    d = start_daemon("--config", config(bench, tmp_path, "/nowhere/tell"), folder=tmp_path / "d")
    assert d.gonio("run", write(tmp_path, SMALL), patience_s=120).returncode == 0
    wait_for(lambda: "/nowhere/tell does not start: No such file or directory" in d.errors())


def write(tmp_path, text):
    path = tmp_path / "small.cfg"
    path.write_text(text)
    return path


def test_a_name_without_a_path_is_refused(bench, tmp_path, start_daemon):
    d = start_daemon("--config", config(bench, tmp_path, "logger"), folder=tmp_path / "d", ready=False)
    assert d.process.wait(20) == 2
    assert "daemon.notify" in d.errors() and "allowed a program's full path, as /usr/bin/logger" in d.errors()
