# SPDX-License-Identifier: MIT
"""Light needs an arm: a person's name and an expiry. What ends it switches the laser off, and only a person
brings it back."""
import json
import signal
import time

import pytest

from conftest import query, wait_for

PLAN = """\
campaign: {
  name = "arm";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 0.1; };
  dense: { half_width_deg = 3.0; step_deg = 0.1; };
  readings: { count = 2; };
};
"""


@pytest.fixture
def bench(start_sim, start_daemon, tmp_path):
    """A function that starts a daemon whose bench file's laser group has more lines, and a plan of many minutes."""
    sim = start_sim("--fast", "--seed", "9", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")
    plan = tmp_path / "arm.cfg"
    plan.write_text(PLAN)

    class Bench:
        config = sim.folder / "goniod.cfg"

        def __init__(self, more=""):
            text = self.config.read_text()
            assert text.count("laser: {") == 1
            self.config.write_text(text.replace("laser: {", "laser: { " + more))
            self.daemon = start_daemon("--config", self.config)
            self.sim, self.plan = sim, plan

        def gonio(self, name, *args):
            before = self.daemon.env
            self.daemon.env = {**before, "GONIO_NAME": name}
            try:
                return self.daemon.gonio(*args)
            finally:
                self.daemon.env = before

        def emits(self):
            return sim.control(do="state")["laser"]["emission"]

        def arm(self):
            return self.daemon.request("GET", "/api/v1/laser")[1]["arm"]

    return Bench


def measure(b, name="anna", events=None):
    """A run of that person's with the laser on: its number and the events."""
    events = events or b.daemon.follow()
    r = b.gonio(name, "run", "--detach", "--json", b.plan)
    assert r.returncode == 0, r
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60)
    assert b.emits()
    return json.loads(r.stdout)["run"], events


def test_a_command_arms_in_its_persons_name_and_a_pause_ends_it(bench):
    b = bench()
    assert b.gonio("anna", "laser").stdout == "not armed\nlight: off\n"
    run, events = measure(b)
    armed = b.arm()
    assert armed["name"] == "anna" and armed["until_utc_ms"] - armed["since_utc_ms"] == 12 * 3600 * 1000
    shown = b.gonio("anna", "laser").stdout
    assert shown.startswith("armed by anna until ") and shown.endswith("light: on\n"), shown
    assert b.gonio("anna", "pause").returncode == 0
    events.until_state(run, "paused")
    assert b.arm() is None and not b.emits()
    assert "the arm of anna ended: the run was paused" in b.gonio("anna", "laser").stdout
    assert b.gonio("bert", "resume", "--detach").returncode == 0
    events.until_state(run, "running")
    assert b.arm()["name"] == "bert"
    (file,) = b.daemon.directory.glob("*.gonio")
    told = [t for (t,) in query(file, "select text from event where source = 'laser' order by rowid")]
    assert [t.split(" until")[0] for t in told] == [
        "armed by anna", "not armed; the arm of anna ended: the run was paused", "armed by bert"], told
    assert b.gonio("bert", "stop").returncode == 0
    assert b.arm() is None and not b.emits()


def test_an_arm_that_runs_out_switches_off_and_pauses(bench):
    b = bench()
    run, events = measure(b)
    assert b.gonio("anna", "laser", "arm", "--for", "1s").returncode == 0
    text = events.until_state(run, "paused")["text"]
    assert "the arm of anna ended: it ran out" in text and "gonio resume" in text, text
    assert not b.emits() and b.arm() is None
    assert b.gonio("anna", "resume", "--detach").returncode == 0
    events.until_state(run, "running")
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60)  # after dark and beam
    assert b.emits()


def test_the_bench_file_says_how_long(bench):
    b = bench("arm_h = 0.0015;")  # 5.4 s
    events = b.daemon.follow()
    assert b.gonio("anna", "run", "--detach", b.plan).returncode == 0
    text = events.until(lambda e: e["event"] == "state" and e["state"] == "paused", 60)["text"]
    assert "the arm of anna ended: it ran out" in text, text
    assert not b.emits()


def test_disarm_is_everybodys_and_switches_off(bench):
    b = bench()
    assert b.gonio("anna", "control", "take").returncode == 0
    run, events = measure(b)
    r = b.gonio("bert", "laser", "arm")
    assert r.returncode == 4 and "anna has control" in r.stderr, r
    r = b.gonio("bert", "laser", "disarm")
    assert r.returncode == 0 and r.stdout.startswith("not armed; the arm of anna ended: disarmed by bert"), r
    assert "disarmed by bert" in events.until_state(run, "paused")["text"]
    assert not b.emits()


def test_an_explicit_bench_wants_an_arm_first(bench):
    b = bench('arm = "explicit";')
    events = b.daemon.follow()
    r = b.gonio("anna", "run", "--detach", b.plan)
    assert r.returncode == 4 and "the laser is not armed; gonio laser arm --for 8h" in r.stderr, r
    assert b.daemon.request("GET", "/api/v1/runs")[1]["runs"] == []
    r = b.gonio("anna", "laser", "arm", "--for", "8h", "--reason", "night run")
    assert r.returncode == 0 and "armed by anna until" in r.stdout and "(night run)" in r.stdout, r
    assert not b.emits(), "an arm is no light"
    run, events = measure(b, events=events)
    assert b.gonio("anna", "pause").returncode == 0
    events.until_state(run, "paused")
    r = b.gonio("anna", "resume", "--detach")
    assert r.returncode == 4 and "the arm of anna ended: the run was paused" in r.stderr, r
    assert not b.emits()
    assert b.gonio("anna", "laser", "arm").returncode == 0
    assert b.gonio("anna", "resume", "--detach").returncode == 0
    events.until_state(run, "running")
    # off for everybody: the guard switches off, the run pauses, the arm is gone
    assert b.gonio("bert", "laser", "off").returncode == 0
    events.until_state(run, "paused")
    assert b.arm() is None and not b.emits()


def test_an_arm_that_ends_before_the_light_pauses_the_run(bench):
    """The enforcement itself, behind the early refusal: the arm is gone between the command and the light."""
    b = bench('arm = "explicit";')
    events = b.daemon.follow()
    assert b.gonio("anna", "laser", "arm").returncode == 0
    before = b.sim.control(do="state")["laser"]["ons"]
    b.sim.control(do="set", interlock="open")
    assert b.gonio("anna", "run", "--detach", b.plan).returncode == 0
    first = events.until(lambda e: e["event"] == "state" and e["state"] == "paused", 60)
    assert "interlock" in first["text"] and b.arm() is None
    b.sim.control(do="set", interlock="closed")
    assert b.gonio("anna", "resume", "--detach").returncode == 4
    assert b.sim.control(do="state")["laser"]["ons"] == before


def test_a_lost_device_that_comes_back_leaves_the_arm(bench):
    b = bench('arm = "explicit";')
    assert b.gonio("anna", "laser", "arm").returncode == 0
    run, events = measure(b)
    armed = b.arm()
    b.sim.control(do="unplug", wire="detector")
    events.until_state(run, "paused")
    b.sim.control(do="plug", wire="detector")
    events.until_state(run, "running")
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60)  # after dark and beam
    assert b.arm() == armed and b.emits()


def test_a_pause_taken_over_from_a_lost_device_ends_the_arm(bench):
    b = bench('arm = "explicit";')
    assert b.gonio("anna", "laser", "arm").returncode == 0
    run, events = measure(b)
    b.sim.control(do="unplug", wire="detector")
    events.until_state(run, "paused")
    assert b.arm() is not None
    assert b.gonio("anna", "pause").returncode == 0
    events.until(lambda e: e["event"] == "state" and e["state"] == "paused" and "by the operator" in e["text"])
    assert b.arm() is None


def test_laser_off_ends_an_arm_that_waits(bench):
    b = bench('arm = "explicit"; align_power_w = 0.001;')
    for _ in range(2):
        assert b.gonio("anna", "laser", "arm").returncode == 0
        # a session's own end leaves the arm
        assert b.gonio("anna", "laser", "align", "--power", "0.001", "--for", "1s").returncode == 0
        wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None)
        assert not b.emits() and b.arm()["name"] == "anna"
        assert b.gonio("bert", "laser", "off").returncode == 0
        wait_for(lambda: b.arm() is None)


@pytest.mark.parametrize("sig", [signal.SIGKILL, signal.SIGTERM])
def test_a_restart_never_arms(bench, start_daemon, sig):
    b = bench()
    measure(b)
    b.daemon.end(sig)
    again = start_daemon("--config", b.config)
    b.daemon = again
    assert b.arm() is None and not b.emits()
    assert b.gonio("anna", "laser").stdout.startswith("not armed\n")


def test_what_is_no_arm_is_refused(bench):
    b = bench()
    name = {"Gonio-Name": "anna"}
    for body in ("", "[]", {"do": 7}, {"do": "on"}, {"do": "arm", "else": 1}, {"do": "arm", "for_s": -1},
                 {"do": "arm", "for_s": 1e9}, {"do": "arm", "for_s": "8h"}, {"do": "arm", "reason": "r" * 161}):
        status, reply = b.daemon.request("POST", "/api/v1/laser", body, name)
        assert status == 400, (body, reply)
    assert b.daemon.request("POST", "/api/v1/laser", {"do": "arm"})[0] == 400, "no name"
    for args in (("--for", "8"), ("--for", "8x"), ("--for", "0s"), ("--for", "-1h"), ("--for", "")):
        assert b.gonio("anna", "laser", "arm", *args).returncode == 2, args
    for args in (("disarm", "--for", "8h"), ("on",), ("--reason", "x"), ("arm", "--link", "x"), ("off", "--for", "1h")):
        assert b.gonio("anna", "laser", *args).returncode == 2, args
    assert b.arm() is None
    assert b.daemon.request("POST", "/api/v1/laser", {"do": "arm", "for_s": 60}, name)[1]["arm"]["name"] == "anna"


def test_no_alignment_unless_the_bench_allows_it(bench):
    b = bench()
    r = b.gonio("anna", "laser", "align", "--power", "0.001", "--for", "10min")
    assert r.returncode == 4 and "laser.align_power_w" in r.stderr, r
    assert not b.emits() and b.arm() is None


def test_an_alignment_session_has_limits_and_ends(bench):
    b = bench("align_power_w = 0.001;")
    align = ("laser", "align", "--for", "10min", "--power")
    for args in ((*align, "0.002"), ("laser", "align", "--power", "0.001", "--for", "31min"),
                 ("laser", "align", "--power", "0.001"), ("laser", "align", "--for", "1min"),
                 (*align, "0.001", "--reason", "x")):
        r = b.gonio("anna", *args)
        assert r.returncode == 2, (args, r)
    assert not b.emits() and b.arm() is None

    def begin(for_="10min"):
        r = b.gonio("anna", "laser", "align", "--power", "0.001", "--for", for_)
        assert r.returncode == 0 and "light: " in r.stdout, r
        session = b.daemon.request("GET", "/api/v1/laser")[1]["align"]
        assert session["name"] == "anna" and session["power_w"] == 0.001
        assert b.emits()

    begin()
    assert b.gonio("bert", "laser", "align", "--power", "0.001", "--for", "1min").returncode == 4
    r = b.gonio("bert", "run", "--detach", b.plan)
    assert r.returncode == 4 and "anna aligns the laser" in r.stderr, r
    time.sleep(1.5)  # three leases of the guard
    assert b.emits()
    for command in (("laser", "off"), ("stop",), ("laser", "disarm")):
        r = b.gonio("bert", *command)
        assert r.returncode == 0, (command, r)
        wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None and not b.emits())
        assert b.arm() is None
        begin()
    assert b.gonio("bert", "laser", "off").returncode == 0
    wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None)
    begin("2s")
    wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None and not b.emits())
    run, _ = measure(b)
    r = b.gonio("anna", *align, "0.001")
    assert r.returncode == 4 and f"run {run} has the bench" in r.stderr, r
    assert b.gonio("anna", "stop").returncode == 0
    begin()
    b.sim.control(do="set", interlock="open")
    wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None and not b.emits())
    assert b.arm() is None
    assert b.gonio("anna", *align, "0.001").returncode == 4 and not b.emits()


def test_an_explicit_bench_wants_an_arm_for_alignment_too(bench):
    b = bench('arm = "explicit"; align_power_w = 0.001;')
    r = b.gonio("anna", "laser", "align", "--power", "0.001", "--for", "10min")
    assert r.returncode == 4 and "not armed" in r.stderr, r
    assert b.gonio("anna", "laser", "arm", "--for", "3s").returncode == 0
    assert b.gonio("anna", "laser", "align", "--power", "0.001", "--for", "10min").returncode == 0
    assert b.emits()
    wait_for(lambda: b.daemon.request("GET", "/api/v1/laser")[1]["align"] is None and not b.emits())
