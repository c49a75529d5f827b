# SPDX-License-Identifier: MIT
"""gonio run and watch when following is not as easy as usual: Ctrl-C comes early."""
import os
import signal

import pytest

from conftest import BUILD, PATIENCE_S, SMALL, Program, wait_for

LONG = SMALL.replace("step_deg = 5.0", "step_deg = 1.0").replace('"small"', '"long"')


def has_socket(pid):
    folder = f"/proc/{pid}/fd"
    return any(os.readlink(f"{folder}/{fd}").startswith("socket:") for fd in os.listdir(folder))


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
