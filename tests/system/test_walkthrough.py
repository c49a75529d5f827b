# SPDX-License-Identifier: MIT
"""The manual's walk-through, done as it stands there: files are written, commands run on a terminal, and what they
print is what the manual prints. And the two invented instruments measure right."""
import difflib
import os
import pty
import re
import select
import shlex
import signal
import subprocess
import time

import pytest

from conftest import BUILD, QUICK_LASER, Program, short_folder
from test_paper_campaign import SMALL_PLAN, recover
from walkthrough import MANUAL, commands, line_pattern, pattern, profiles, put, steps

LONGEST_S = 120.0  # for a command; the campaign takes some 15


def on_terminal(command, folder, env):
    """What a command prints on a terminal."""
    master, slave = pty.openpty()
    process = subprocess.Popen(["bash", "-c", command], stdin=slave, stdout=slave, stderr=slave, cwd=folder, env=env)
    os.close(slave)
    end = time.monotonic() + LONGEST_S
    said = b""
    try:
        while select.select([master], [], [], max(0.0, end - time.monotonic()))[0]:
            said += os.read(master, 65536)
        process.kill()
        said += f"\nnot ended within {LONGEST_S} s\n".encode()
    except OSError:
        pass  # EIO: nobody has the terminal any more
    os.close(master)
    process.wait(LONGEST_S)
    return said.decode().replace("\r\n", "\n").replace("\r", "")


def differ(step, command, expected, got):
    diff = "\n".join(difflib.unified_diff(expected, got, f"{MANUAL.name}:{step.line}", "printed", lineterm="", n=100))
    pytest.fail(f"$ {command}\n{diff}", pytrace=False)


class Terminals:
    """Commands that go on running, each in a terminal of its own."""

    def __init__(self, folder, env):
        self.folder, self.env, self.running = folder, env, []

    def start(self, step):
        ((command, expected),) = commands(step)
        program = Program(["bash", "-c", f"cd {shlex.quote(str(self.folder))} && exec {command}"],
                          self.folder / f"terminal{len(self.running)}", self.env)
        self.running.append(program)
        try:
            program.wait_line(re.split(r"\.\.\.", expected[-1])[0])
        except AssertionError as e:
            differ(step, command, expected, [*program.said, *str(e).splitlines()])
        if not all(re.fullmatch(line_pattern(e, False), s) for e, s in zip(expected, program.said)) or \
                len(expected) != len(program.said):
            differ(step, command, expected, program.said)

    def end(self):
        return [p.end(signal.SIGINT) for p in reversed(self.running)]


def test_the_walk_through_does_what_the_manual_prints(tmp_path):
    sockets = short_folder(tmp_path)
    env = {**os.environ, "PATH": f"{BUILD}:{os.environ['PATH']}", "NO_COLOR": "1", "LC_ALL": "C.UTF-8",
           "GONIO_SOCKET": str(sockets / "s"), "GONIO_DIR": str(tmp_path), "XDG_RUNTIME_DIR": str(sockets)}
    env.pop("COLUMNS", None)
    terminals = Terminals(tmp_path, env)
    try:
        for step in steps():
            if step.file:
                put(step, tmp_path)
            elif step.kind == "start":
                terminals.start(step)
            else:
                for command, expected in commands(step):
                    got = on_terminal(command, tmp_path, env)
                    if not pattern(expected, step.vary).fullmatch(got):
                        differ(step, command, expected, got.splitlines())
    finally:
        ends = terminals.end()
    assert ends == [0] * len(ends)


def test_the_invented_instruments_measure_right(start_sim, start_daemon, tmp_path):
    """Beyond 3 standard uncertainties twice: once in 14000 runs by chance (test_paper_campaign.py)."""
    profiles(tmp_path)
    config = tmp_path / "seed.cfg"
    config.write_text(SMALL_PLAN)

    def check(daemon, run, truth, fit, last):
        assert run["state"] == "done"

    recover(check, start_sim, start_daemon, config, "goniod.cfg", "--fast", *QUICK_LASER,
            "--set", f"detector.profile={tmp_path}/pa7.cfg", "--set", f"axes.profile={tmp_path}/mc3.cfg", seed=41)


@pytest.mark.parametrize("expected, got, vary, same", [
    (["a", "b"], "a\nb\n", False, True),
    (["a", "b"], "a\nc\n", False, False),
    (["a", "..."], "a\nb\nc\n", False, True),
    (["...", "b"], "a\nc\n", False, False),
    (["x ... y"], "x 1 2 y\n", False, True),
    (["sigma   0.15  2e-05 s"], "sigma 0.149  1.5e-06 s\n", True, True),
    (["sigma   0.15  2e-05 s"], "sigma nan  1.5e-06 s\n", True, False),
    (["sigma 0.15"], "sigma 0.149\n", False, False),
])
def test_what_is_printed_is_compared(expected, got, vary, same):
    assert bool(pattern(expected, vary).fullmatch(got)) == same
