# SPDX-License-Identifier: MIT
"""Each wire is unplugged in mid-sweep: the run pauses with a message that names the device, the laser is off where
it can be reached, and the run goes on and ends after the wire is back."""
import pytest

PLAN = """\
campaign: {
  name = "unplugged";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 2.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""
NAMES = {"axes": "theta_", "laser": "laser", "detector": "detector"}


@pytest.mark.parametrize("bench, suffix", [("goniod.cfg", ""), ("goniod-tcp.cfg", "-tcp")])
def test_an_unplugged_wire_pauses_the_run_and_its_return_resumes_it(start_sim, start_daemon, bench, suffix):
    sim = start_sim("--fast", "--seed", "5", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    daemon = start_daemon("--config", sim.folder / bench)
    run = daemon.submit(PLAN, "unplugged.cfg")["run"]
    events = daemon.follow(0)

    for wire, name in NAMES.items():
        for _ in range(4):
            events.until(lambda e: e["event"] == "reading" and e["run"] == run and e["sweep"] >= 1)
        assert sim.control(do="unplug", wire=wire + suffix)["ok"]
        paused = events.until_state(run, "paused")
        assert name in paused["text"], paused
        assert daemon.status()["state"] == "paused"
        if wire != "laser":
            assert not sim.control(do="state")["laser"]["emission"], "off while the run is paused"
        assert sim.control(do="plug", wire=wire + suffix)["ok"]
        events.until_state(run, "running")

    events.until_state(run, "done")
    assert not sim.control(do="state")["laser"]["emission"]


def test_a_run_that_waits_for_a_device_can_be_held(start_sim, start_daemon):
    sim = start_sim("--fast", "--seed", "5", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    daemon = start_daemon("--config", sim.folder / "goniod-tcp.cfg")
    run = daemon.submit(PLAN, "unplugged.cfg")["run"]
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    assert sim.control(do="unplug", wire="detector-tcp")["ok"]
    events.until_state(run, "paused")
    r = daemon.gonio("pause")
    assert r.returncode == 0 and r.stderr == f"run {run} stays paused. Go on with: gonio resume\n", r
    held = events.until_state(run, "paused")
    assert "by the operator" in held["text"]
    assert sim.control(do="plug", wire="detector-tcp")["ok"]
    assert daemon.gonio("pause").returncode == 4
    assert daemon.status()["state"] == "paused"
    assert daemon.gonio("resume", "--detach").returncode == 0
    events.until_state(run, "running")
