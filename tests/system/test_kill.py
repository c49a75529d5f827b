# SPDX-License-Identifier: MIT
"""kill -9 of goniod at random moments, five in each campaign: every reading that was announced (it is announced after
its commit) is in the file, the file is whole, `gonio resume` goes on where it stopped, and nothing is measured twice but
the point in progress. GONIO_TEST_KILLS says how many (20; 200 with CI set), GONIO_TEST_SEED moves the moments."""
import json
import os
import random
import signal
import time

import pytest

from conftest import Daemon, query

PLAN = """\
campaign: {
  name = "killed";
  theta_i_deg = [ 0.0, 15.0, 30.0, 45.0, 60.0 ];
  theta_r: { from_deg = -80.0; to_deg = 80.0; step_deg = 4.0; };
  dense: { half_width_deg = 4.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""
SEED = int(os.environ.get("GONIO_TEST_SEED", "20261123"))
KILLS = 5  # of a campaign
CAMPAIGNS = -(-int(os.environ.get("GONIO_TEST_KILLS", "200" if os.environ.get("CI") else "20")) // KILLS)


def rows(path):
    return query(path, "select sweep, point, attempt, flags from reading")


@pytest.mark.parametrize("campaign", range(CAMPAIGNS))
def test_no_acknowledged_reading_is_lost_when_killed(start_sim, tmp_path, campaign):
    random_ = random.Random(SEED + campaign)
    print("seed", SEED + campaign)
    sim = start_sim("--fast", "--seed", "3", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    run = file = None
    announced = set()

    for kill in range(KILLS + 1):
        d = Daemon(tmp_path, "--config", sim.folder / "goniod-tcp.cfg")
        try:
            if run is None:
                reply = d.submit(PLAN, "killed.cfg")
                run, file = reply["run"], reply["file"]
                events = d.follow(0)
            else:
                events = d.follow()
                resumed = d.gonio("resume", run, "--detach")
                assert resumed.returncode == 0, resumed.stderr
            if kill == KILLS:
                events.until_state(run, "done")
                break
            # The moment: a random part of a second after a random number of readings; 0 is in the preparation.
            for _ in range(random_.choice([0, 1, 2, 5, 20, 40])):
                e = events.until(lambda e: e["event"] == "reading" and e["run"] == run)
                announced.add((e["sweep"], e["point"]))
            time.sleep(random_.random() * 0.1)
        finally:
            d.end(signal.SIGKILL if kill < KILLS else signal.SIGTERM)
        stored = {(s, p) for s, p, _, _ in rows(file)}
        assert announced <= stored, f"lost after kill {kill}: {sorted(announced - stored)}"
        verified = d.gonio("verify", file)
        assert verified.returncode == 0, verified.stdout

    accepted = {}
    for sweep, point, attempt, flags in rows(file):
        if not flags & 0xFF:
            accepted[(sweep, point)] = accepted.get((sweep, point), 0) + 1
    # The opening references are, after each gap.
    repeated = sum(n - 1 for (sweep, _), n in accepted.items() if sweep > 0)
    assert repeated == 0, "an accepted point on the sample is never measured again"
    planned = set(query(file, "select sweep, point from plan"))
    assert set(accepted) == planned
    shown = json.loads(d.gonio("show", run, "--json").stdout)
    assert shown["state"] == "done"
