# SPDX-License-Identifier: MIT
"""What keeps a run: a door and a thermometer simulated from a profile, the interlock, a lost device; pauses by name
and at once."""
import re
import subprocess
import time

import pytest

from conftest import BUILD, QUICK_LASER, gonio, query, wait_for

PLAN = """\
campaign: {
  name = "suspended";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 2.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
  readings: { count = 4; };
};
"""

ROOM = """\
profile: { name = "room"; title = "I/O module"; role = "inputs"; source = "this test"; protocol = "modbus"; };
registers: { base = 1; single = true; };
values: (
  { name = "kind"; type = "int"; address = 100; access = "r"; },
  { name = "door_open"; type = "int"; table = "discrete"; address = 1; access = "r"; },
  { name = "bench_c"; unit = "degC"; table = "input"; address = 1; format = "s16"; scale = 0.1; min = -40; max = 150;
    access = "r"; }
);
identify: { asks = "kind"; refuse = ( { when = "kind != 4711"; text = "is no I/O module"; } ); };
inputs: { status = ( "door_open", "bench_c" ); };
simulate: { start = ( { value = "kind"; is = "4711"; }, { value = "bench_c"; is = "21.5"; } ); };
"""

SUSPENDERS = """\
devices: ( { name = "room"; driver = "./room.cfg"; bus = "io"; unit = 9; use = "inputs"; } );
suspenders: (
  { name = "too warm"; when = "room.bench_c > 25"; settle_s = 1.5; resume = "automatic"; },
  { name = "door"; when = "room.door_open"; settle_s = 0.5; },
  { name = "disk"; when = "disk_free_mb < 1"; }
);
"""


class Bench:
    def __init__(self, start_sim, folder, more=SUSPENDERS):
        (folder / "room.cfg").write_text(ROOM)
        self.sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
        self.room = start_sim("--profile", folder / "room.cfg", "--unit", "9", folder=folder / "room")
        link = "modbus-tcp:" + self.room.control(do="state")["wires"]["room-tcp"]["address"].rsplit("/", 1)[-1]
        text = (self.sim.folder / "goniod.cfg").read_text()
        text = text.replace("buses: (", f'buses: ( {{ name = "io"; link = "{link}"; timeout_ms = 200; }},')
        self.file = folder / "goniod.cfg"
        self.file.write_text(text + more)

    def set(self, **values):
        assert self.room.control(do="set", values=values)["ok"]

    def emits(self):
        return self.sim.control(do="state")["laser"]["emission"]

    def dark_within(self, patience_s):
        begun = time.monotonic()
        wait_for(lambda: not self.emits())
        took_s = time.monotonic() - begun
        assert took_s < patience_s, took_s


@pytest.fixture
def bench(start_sim, tmp_path):
    return Bench(start_sim, tmp_path)


@pytest.fixture
def daemon(bench, start_daemon):
    return start_daemon("--config", bench.file)


def begin(daemon):
    reply = daemon.submit(PLAN, "suspended.cfg")
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60.0)
    return reply["run"], reply["file"], events


def assert_complete(file, gaps=0):
    """Every point of the sample has one reading that counts, the opening references one more for each gap."""
    good = dict(((s, p), n) for s, p, n in query(
        file, "select sweep, point, count(*) from reading where flags & 255 = 0 group by sweep, point"))
    for sweep, point in query(file, "select sweep, point from plan"):
        assert good.pop((sweep, point)) == (1 + gaps if sweep == 0 else 1), (sweep, point)
    assert not good
    told = [t for t, in query(file, "select text from event where text like 'references measured again after a gap%'")]
    assert len(told) == gaps, told
    r = gonio("verify", file)
    assert r.returncode == 0, r
    r = gonio("fit", file, "--json")
    assert r.returncode == 0, r


def test_a_door_waits_for_somebody_and_warmth_for_nobody(bench, daemon):
    run, file, events = begin(daemon)
    bench.set(door_open=1)
    bench.dark_within(2.0)  # a second, and what a loaded machine adds
    paused = events.until_state(run, "paused")
    assert paused["text"].startswith('suspended by "door": room.door_open = 1; mend it, then: gonio resume')
    assert re.search(r'^suspended by "door": room.door_open = 1; must then be quiet for 0.5 s; waits for gonio resume$',
                     daemon.gonio("status").stdout, re.M)
    daemon.request("POST", "/api/v1/resume")  # with the door open: refused, and said again
    again = events.until_state(run, "paused")
    assert again["text"] == paused["text"]
    bench.set(door_open=0)
    wait_for(lambda: "door_open = 1; waits for gonio resume" in daemon.gonio("status").stdout)
    time.sleep(1.5)
    assert daemon.status()["state"] == "paused" and not bench.emits()
    assert daemon.request("POST", "/api/v1/resume")[0] == 202
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60.0)

    bench.set(bench_c=25.1)
    paused = events.until_state(run, "paused")
    assert paused["text"] == ('suspended by "too warm": room.bench_c = 25.1 > 25; it goes on by itself once that has '
                              'been quiet for 1.5 s')
    bench.dark_within(2.0)
    bench.set(bench_c=25)
    events.until_state(run, "done")
    assert_complete(file, gaps=2)
    why = [w for s, w in query(file, "select state, why from state") if s == "paused"]
    assert len(why) == 3 and "door" in why[0] and "too warm" in why[2], why
    assert any("nothing suspends it any more" in w for _, w in query(file, "select state, why from state"))


def test_what_is_not_known_holds_and_nothing_begins(bench, daemon):
    assert bench.room.control(do="mute", wire="room-tcp")["ok"]
    wait_for(lambda: next(d for d in daemon.status()["devices"] if d["name"] == "room")["link"] == "lost")
    reply = daemon.submit(PLAN, "suspended.cfg")
    events = daemon.follow(0)
    paused = events.until_state(reply["run"], "paused")
    assert 'is not known' in paused["text"], paused
    suspenders = {s["name"]: s for s in daemon.status()["suspenders"]}
    assert suspenders["door"]["holds"] and suspenders["too warm"]["holds"] and not suspenders["disk"]["holds"]
    assert query(reply["file"], "select count(*) from reading") == [(0,)]
    assert bench.room.control(do="unmute", wire="room-tcp")["ok"]
    paused = events.until_state(reply["run"], "paused")  # the door is left, and waits
    wait_for(lambda: not any(s["holds"] for s in daemon.status()["suspenders"]))
    assert daemon.request("POST", "/api/v1/resume")[0] == 202
    events.until_state(reply["run"], "done")
    assert_complete(reply["file"])


def test_a_pause_names_who_and_why(bench, daemon):
    run, file, events = begin(daemon)
    assert daemon.request("POST", "/api/v1/pause", {"now": 1})[0] == 400
    assert daemon.request("POST", "/api/v1/pause", {"reason": "a\nb"})[0] == 400
    r = gonio("pause", "--now", "--reason", "mirror is dusty", env=daemon.env | {"GONIO_NAME": "anna"})
    assert r.returncode == 0 and "pauses now" in r.stderr, r
    paused = events.until_state(run, "paused")
    assert re.fullmatch(r"by the operator anna \(uid \d+\): mirror is dusty; go on with: gonio resume", paused["text"])
    bench.dark_within(2.0)
    assert daemon.request("POST", "/api/v1/resume")[0] == 202
    events.until_state(run, "done")
    assert_complete(file, gaps=1)
    assert query(file, "select count(*) from state where why like '%anna%'") == [(1,)]


@pytest.mark.parametrize("line, says", [
    ('{ name = "d"; when = "room.door_open"; resume = "automatic"; }', "never resumes by itself"),
    ('{ name = "d"; when = "interlock_open"; resume = "automatic"; }', "never resumes by itself"),
    ('{ name = "d"; when = "romm.bench_c > 2"; }', "did you mean 'room'?"),
    ('{ name = "d"; when = "room.bench > 2"; }', "has no value 'bench'"),
    ('{ name = "d"; when = "disk_free_mb"; }, { name = "d"; when = "disk_free_mb"; }', "another suspender"),
    ('{ name = "d"; when = "disk_free_mb >"; }', "no number"),
])
def test_a_wrong_suspender_is_refused(start_sim, tmp_path, line, says):
    more = SUSPENDERS.split("suspenders:")[0] + f"suspenders: ( {line} );\n"
    bench = Bench(start_sim, tmp_path, more)
    r = gonio("check", bench.file, cwd=tmp_path)
    assert r.returncode == 2 and says in r.stdout + r.stderr, r


def test_a_value_that_the_device_has_not_keeps_goniod_from_starting(start_sim, tmp_path):
    more = SUSPENDERS.split("suspenders:")[0] + 'suspenders: ( { name = "s"; when = "room.bench > 2"; } );\n'
    bench = Bench(start_sim, tmp_path, more)
    r = subprocess.run([BUILD / "goniod", "--config", bench.file, "--socket", tmp_path / "s", "--dir", tmp_path / "d"],
                       capture_output=True, text=True, timeout=30)
    assert r.returncode == 2, r
    assert 'room: has no value \'bench\', which suspender "s" names' in r.stderr, r
