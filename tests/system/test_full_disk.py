# SPDX-License-Identifier: MIT
"""Campaigns on a tmpfs of 3 MiB that others fill: the run pauses with the laser off, says so in the file, and goes on by
itself when there is room again."""
import json
import os
import subprocess

import pytest

from conftest import BUILD, QUICK_LASER, Daemon, query

LONG = """\
campaign: {
  name = "full";
  theta_i_deg = [ 0.0, 30.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 2.0; };
  dense: { half_width_deg = 0.0; };
  readings: { count = 2; };
};
"""
NAMESPACE = ["unshare", "-Urm"]


class Inside(Daemon):
    """goniod with a small file system of its own over its folder of campaigns."""
    wrap = (*NAMESPACE, "sh", "-c", 'mount -t tmpfs -o size=3m gonio "$GONIO_DIR" && exec "$@"', "sh")

    def inside(self, *argv):
        return subprocess.run(["nsenter", "-t", str(self.pid), "-U", "-m", "--preserve-credentials", *map(str, argv)],
                              capture_output=True, text=True, timeout=60, check=False,
                              env={**os.environ, **self.env})


@pytest.fixture
def small(start_sim, tmp_path):
    if subprocess.run([*NAMESPACE, "true"], check=False).returncode:
        assert "CI" not in os.environ, "no mount namespace: a full disk cannot be tested here"
        pytest.skip("no mount namespace: a full disk cannot be tested here")
    sim = start_sim("--fast", *QUICK_LASER)
    d = Inside(tmp_path, "--config", sim.folder / "goniod.cfg")
    d.bench = sim
    yield d
    d.end()


def test_a_full_disk_pauses_the_run_until_there_is_room(small, tmp_path):
    reply = small.submit(LONG, "full.cfg")
    run, events = reply["run"], small.follow(0)
    for _ in range(5):
        events.until(lambda e: e["event"] == "reading" and e["run"] == run)
    others = small.directory / "others"
    filled = small.inside("sh", "-c", f"cat /dev/zero >{others}")
    assert "No space left" in filled.stderr
    paused = events.until_state(run, "paused")
    assert "the disk is full" in paused["text"]
    assert not small.bench.control(do="state")["laser"]["emission"]
    # Nobody freed anything yet, and it is in the file.
    shown = small.inside(BUILD / "gonio", "show", reply["file"], "--json")
    assert shown.returncode == 0, shown.stderr
    campaign = json.loads(shown.stdout)
    assert campaign["state"] == "paused" and "the disk is full" in campaign["problem"]
    assert 5 <= campaign["readings"] < campaign["total"]
    assert small.inside("rm", others).returncode == 0
    events.until_state(run, "done", patience_s=120.0)
    verified = small.inside(BUILD / "gonio", "verify", "--json", reply["file"])
    (seen,) = json.loads(verified.stdout)["files"]
    assert seen["whole"], seen
    copy = tmp_path / "copy.gonio"
    with open(copy, "wb") as out:
        subprocess.run(["nsenter", "-t", str(small.pid), "-U", "-m", "--preserve-credentials", "cat", reply["file"]],
                       stdout=out, check=True)
    twice = query(copy, "select sweep, point from reading where flags = 0 and sweep > 0 group by 1, 2 having count(*) > 1")
    assert twice == [], "an accepted point on the sample is never measured again"
    assert query(copy, "select count(distinct sweep * 1000 + point) from reading where flags = 0") == query(
        copy, "select count(*) from plan")
