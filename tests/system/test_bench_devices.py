# SPDX-License-Identifier: MIT
"""A shutter, a filter wheel and a power meter, simulated from their profiles, beside goniosim: campaigns with them,
the wheel unplugged and turned by hand, and what the command says of them."""
import json
import re
import threading
import time

import pytest

from conftest import PATIENCE_S, QUICK_LASER, ROOT, gonio, query, wait_for

PLAN = """\
campaign: {
  name = "devices";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 8.0; };
  dense: { half_width_deg = 2.0; step_deg = 2.0; };
  readings: { count = 2; };
};
"""
LIT_W = 1.2e-3
DISCARDED = 1 << 7

DEVICES = """\
monitor: {{ driver = "thorlabs-pm100"; link = "{monitor}"; full_scale = 2e-3; }};
devices: (
  {{ name = "shutter"; driver = "thorlabs-sc10"; link = "{shutter}"; use = "shutter"; position = "open"; darks = true; }},
  {{ name = "nd"; driver = "thorlabs-fw102c"; link = "{wheel}"; use = "filter"; position = "1"; }}
);
"""


class Bench:
    """The programs, and the light's way from laser through shutter to the power meter."""

    def __init__(self, start_sim, tmp_path):
        def instrument(name):
            return start_sim("--profile", ROOT / "configs" / "profiles" / f"{name}.cfg", "--fast",
                             folder=tmp_path / name)

        self.sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
        self.shutter, self.wheel = instrument("thorlabs-sc10"), instrument("thorlabs-fw102c")
        self.meter = instrument("thorlabs-pm100")
        self.wheel.control(do="set", values={"position": 4})
        self.file = tmp_path / "goniod.cfg"
        text = (self.sim.folder / "goniod.cfg").read_text().replace("monitor_aux = 1", "monitor_aux = 0")
        self.links = {part: f"serial:{sim.folder}/{sim.folder.name}?baud=115200"
                      for part, sim in [("shutter", self.shutter), ("wheel", self.wheel), ("monitor", self.meter)]}
        self.file.write_text(text + DEVICES.format(**self.links))
        self.ending = threading.Event()
        self.shone_on_darks = False
        self.thread = threading.Thread(target=self._shine, daemon=True)
        self._set_light(0)
        self.thread.start()

    def _set_light(self, power_w):
        assert self.meter.control(do="set", values={"power_w": power_w})["ok"]

    def _shine(self):
        before = 0
        while not self.ending.is_set():
            emits = self.sim.control(do="state")["laser"]["emission"]
            is_open = self.shutter.control(do="values")["values"]["closed"] == 0
            self.shone_on_darks |= emits and not is_open
            power_w = LIT_W if emits and is_open else 0
            if power_w != before:
                self._set_light(power_w)
            before = power_w
            time.sleep(0.005)

    def close(self):
        self.ending.set()
        self.thread.join(PATIENCE_S)

    def values(self, part):
        return getattr(self, part).control(do="values")["values"]


@pytest.fixture
def bench(start_sim, tmp_path):
    b = Bench(start_sim, tmp_path)
    yield b
    b.close()


@pytest.fixture
def daemon(bench, start_daemon):
    return start_daemon("--config", bench.file)


def rows(file):
    return query(file, "select r.sweep, r.point, r.flags, r.monitor_v, p.kind from reading r join plan p "
                       "using (sweep, point) order by r.sweep, r.point, r.attempt")


def assert_measured(file):
    """Every point has a reading that counts, with the monitor it should have; on the sample one."""
    all_rows = rows(file)
    good = [r for r in all_rows if not r[2] & 0xFF]
    on_sample = [r[:2] for r in good if r[4] == "sample"]
    assert len(on_sample) == len(set(on_sample))
    assert len({r[:2] for r in good}) == len({(r[0], r[1]) for r in all_rows}) == query(file, "select count(*) from plan")[0][0]
    for sweep, point, _, monitor, kind in good:
        assert monitor == pytest.approx(0 if kind == "dark" else LIT_W, abs=1e-9), (sweep, point)
    return [r for r in all_rows if r[2] & DISCARDED]


def test_a_campaign_with_shutter_wheel_and_monitor(bench, daemon):
    assert bench.values("meter")["wavelength_nm"] == 1060
    assert bench.values("meter")["full_scale"] == pytest.approx(1e-2)  # holds 2 mW
    reply = daemon.submit(PLAN, "devices.cfg")
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60.0)
    assert bench.values("wheel")["position"] == 1 and bench.values("wheel")["sensors"] == 0
    assert bench.values("shutter")["closed"] == 0
    events.until_state(reply["run"], "done")
    assert assert_measured(reply["file"]) == []
    wait_for(lambda: bench.values("shutter")["closed"] == 1)
    assert bench.shone_on_darks  # the shutter made the last one
    assert not bench.sim.control(do="state")["laser"]["emission"]
    daemon.end()
    fit = daemon.gonio("fit", reply["file"], "--json")
    assert fit.returncode == 0, fit.stderr


def test_a_wheel_turned_by_hand_is_set_again_and_its_reading_discarded(bench, daemon):
    reply = daemon.submit(PLAN, "devices.cfg")
    events = daemon.follow(0)
    for sweep in (1, 2):
        events.until(lambda e: e["event"] == "reading" and e["sweep"] == sweep, 60.0)
        assert bench.wheel.control(do="set", values={"position": 3})["ok"]
        events.until(lambda e: e["event"] == "log" and re.match("nd: .*'3'.*set (to '1' )?again", e["text"]))
    events.until_state(reply["run"], "done")
    discarded = assert_measured(reply["file"])
    assert 1 <= len(discarded) <= 2  # or found before a sweep
    assert bench.values("wheel")["position"] == 1


def test_an_unplugged_wheel_pauses_the_run_until_it_is_back_and_set(bench, daemon):
    reply = daemon.submit(PLAN, "devices.cfg")
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60.0)
    assert bench.wheel.control(do="unplug", wire="thorlabs-fw102c")["ok"]
    paused = events.until_state(reply["run"], "paused")
    assert "nd" in paused["text"] and "thorlabs-fw102c" in paused["text"], paused
    assert not bench.sim.control(do="state")["laser"]["emission"]
    wait_for(lambda: bench.values("shutter")["closed"] == 1)
    assert bench.wheel.control(do="set", values={"position": 5})["ok"]  # meanwhile
    assert bench.wheel.control(do="plug", wire="thorlabs-fw102c")["ok"]
    events.until_state(reply["run"], "done")
    assert_measured(reply["file"])
    assert bench.values("wheel")["position"] == 1
    nd = next(d for d in json.loads(daemon.gonio("devices", "--json").stdout)["devices"] if d["name"] == "nd")
    assert nd["returns"] == 1 and nd["errors"] >= 1


@pytest.mark.parametrize("part, name", [("shutter", "shutter"), ("wheel", "nd")])
def test_what_is_unplugged_while_the_laser_warms_up_pauses_the_run(bench, start_daemon, part, name):
    text, count = re.subn(r"warmup_s = [0-9.]+", "warmup_s = 600.0", bench.file.read_text())
    assert count == 1
    bench.file.write_text(text)
    d = start_daemon("--config", bench.file)
    reply = d.submit(PLAN, "devices.cfg")
    events = d.follow(0)
    events.until(lambda e: e["event"] == "log" and "warming up" in e["text"], 60.0)
    wait_for(lambda: bench.sim.control(do="state")["laser"]["emission"])
    sim = getattr(bench, part)
    assert sim.control(do="unplug", wire=sim.folder.name)["ok"]
    paused = events.until_state(reply["run"], "paused")
    assert name in paused["text"] and "unplugged" in paused["text"], paused
    assert not bench.sim.control(do="state")["laser"]["emission"]


def test_a_stuck_shutter_pauses_the_run_with_the_laser_off(bench, daemon):
    assert bench.shutter.control(do="set", values={"interlock": 1})["ok"]  # its blades stay closed
    reply = daemon.submit(PLAN, "devices.cfg")
    events = daemon.follow(0)
    paused = events.until_state(reply["run"], "paused")
    assert "shutter" in paused["text"] and "'open'" in paused["text"], paused
    assert not bench.sim.control(do="state")["laser"]["emission"]
    assert bench.shutter.control(do="set", values={"interlock": 0})["ok"]
    assert daemon.gonio("resume", "--detach").returncode == 0
    events.until_state(reply["run"], "done")
    assert_measured(reply["file"])


# --- inputs -----------------------------------------------------------------------------------------

DOOR = r"""
profile: { name = "door"; title = "I/O module"; role = "inputs"; protocol = "modbus"; source = "this test"; };
values: (
  { name = "kind"; type = "int"; address = 100; access = "r"; },
  { name = "open"; type = "int"; table = "discrete"; address = 1; access = "r"; },
  { name = "bench_c"; unit = "degC"; table = "input"; address = 1; format = "s16"; scale = 0.1; min = -40; max = 150;
    access = "r"; },
  { name = "alive"; type = "int"; table = "coil"; address = 6; access = "rw"; },
  { name = "relay"; type = "int"; table = "discrete"; address = 9; access = "r"; },
  { name = "left_ms"; address = 50; format = "s16"; access = "r"; } );
writes: ( { name = "keep"; set = "alive = 1"; then = "left_ms = 600, relay = 1"; } );
identify: { asks = "kind"; title = "I/O module"; refuse = ( { when = "kind != 4711"; text = "is no I/O module"; } ); };
inputs: { status = ( "open", "bench_c", "relay" ); watchdog = "keep"; watchdog_ms = 600; };
simulate: { start = ( { value = "kind"; is = "4711"; }, { value = "bench_c"; is = "21.5"; } );
  drift = ( { value = "left_ms"; to = "0"; rate = 1000; then = "relay = 0"; } ); };
"""


def test_inputs_on_a_bus_are_seen_kept_and_missed(start_sim, start_daemon, tmp_path):
    (tmp_path / "door.cfg").write_text(DOOR)
    sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
    door = start_sim("--profile", tmp_path / "door.cfg", "--unit", "9", folder=tmp_path / "door")
    link = "modbus-tcp:" + door.control(do="state")["wires"]["door-tcp"]["address"].rsplit("/", 1)[-1]
    text = (sim.folder / "goniod.cfg").read_text()
    text = text.replace("buses: (", f'buses: ( {{ name = "io"; link = "{link}"; timeout_ms = 200; }},')
    (tmp_path / "goniod.cfg").write_text(
        text + 'devices: ( { name = "door"; driver = "./door.cfg"; bus = "io"; unit = 9; use = "inputs"; } );\n')
    looked = gonio("doctor", tmp_path / "goniod.cfg", cwd=tmp_path)
    assert looked.returncode == 0 and re.search(r"^door\twell\t.*open 0, bench_c 21\.5 degC", looked.stdout, re.M), looked
    daemon = start_daemon("--config", tmp_path / "goniod.cfg")
    status = daemon.gonio("status").stdout
    assert re.search(r"^door +open 0, bench_c 21\.5 degC, relay [01]$", status, re.M), status
    assert door.control(do="set", values={"open": 1})["ok"]
    wait_for(lambda: re.search(r"^door +open 1", daemon.gonio("status").stdout, re.M))

    wait_for(lambda: door.control(do="values")["values"]["relay"] == 1)

    reply = daemon.submit(PLAN, "devices.cfg")
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60.0)
    assert door.control(do="mute", wire="door-tcp")["ok"]
    paused = events.until_state(reply["run"], "paused")
    assert "door" in paused["text"], paused
    assert not sim.control(do="state")["laser"]["emission"]
    assert door.control(do="unmute", wire="door-tcp")["ok"]
    events.until_state(reply["run"], "done")
    assert daemon.end() == 0
    wait_for(lambda: door.control(do="values")["values"]["relay"] == 0)  # nobody keeps it on


# --- what is said of them ---------------------------------------------------------------------------


def test_status_devices_metrics_and_doctor_know_them(bench, daemon):
    status = daemon.gonio("status").stdout
    assert re.search(r"^nd +4, measures at 1$", status, re.M), status
    assert re.search(r"^shutter +closed, measures at open$", status, re.M), status
    assert re.search(r"^monitor +full scale 0\.01 W, last 0 W$", status, re.M), status
    _, reply = daemon.request("GET", "/api/v1/devices")
    kinds = {d["name"]: d for d in reply["devices"]}
    assert [kinds[n]["kind"] for n in ("monitor", "shutter", "nd")] == ["monitor", "shutter", "filter"]
    assert kinds["nd"]["filter"] == {"position": "4", "measures_at": "1"}
    assert "SC10" in kinds["shutter"]["identity"] and kinds["monitor"]["serial"] == "P0012345"
    assert kinds["nd"]["traffic"]["requests"] > 0 and kinds["nd"]["link"] == bench.links["wheel"]
    table = daemon.gonio("devices").stdout
    assert all(re.search(f"^{n}\\s.*ok", table, re.M) for n in ("monitor", "shutter", "nd")), table
    told = daemon.gonio("doctor", bench.file)
    assert told.returncode == 0 and re.search(r"^nd\twell\t.*FW102C.*says goniod", told.stdout, re.M), told.stdout
    assert daemon.end() == 0
    looked = daemon.gonio("doctor", bench.file)
    assert looked.returncode == 0, looked.stdout
    assert re.search(r"^nd\twell\t.*FW102C.*at '4'", looked.stdout, re.M), looked.stdout
    assert re.search(r"^monitor\twell\tThorlabs PM100D", looked.stdout, re.M), looked.stdout


@pytest.mark.parametrize("was, becomes, says", [
    ('position = "1"', 'position = "7"', r"devices\[1\]\.position = \"7\": profile thorlabs-fw102c has no such "
                                         r"position; it has \"1\", .*\"6\""),
    ("thorlabs-fw102c", "thorlabs-pm100", "is of a detector, not of a selector"),
    ("thorlabs-pm100", "thorlabs-sc10", "is of a selector, not of a detector"),
    ("serial:", "modbus-rtu:", r"devices\[0\]\.link = .*allowed serial:PORT"),
], ids=["position", "role", "monitor", "link"])
def test_gonio_check_looks_into_the_profiles(tmp_path, was, becomes, says):
    links = {part: f"serial:/dev/{part}?baud=9600" for part in ("monitor", "shutter", "wheel")}
    text = (ROOT / "configs" / "goniod.cfg").read_text().replace("monitor_aux = 1", "monitor_aux = 0")
    right, wrong = tmp_path / "right.cfg", tmp_path / "wrong.cfg"
    right.write_text(text + DEVICES.format(**links))
    wrong.write_text(text + DEVICES.format(**links).replace(was, becomes))
    assert gonio("check", right).returncode == 0
    done = gonio("check", wrong)
    assert done.returncode == 2 and re.search(says, done.stderr), done.stderr


def test_a_shutter_has_to_have_a_safe_position(tmp_path):
    profile = (ROOT / "configs" / "profiles" / "thorlabs-sc10.cfg").read_text()
    (tmp_path / "sc10.cfg").write_text(profile.replace('safe = "closed";', ""))
    shutter = '\ndevices: ( { name = "shutter"; driver = "./sc10.cfg"; link = "serial:/dev/s?baud=9600"; ' \
              'use = "shutter"; position = "open"; } );\n'
    bench = tmp_path / "bench.cfg"
    text = (ROOT / "configs" / "goniod.cfg").read_text()
    bench.write_text(text + shutter)
    done = gonio("check", bench)
    assert done.returncode == 2, done.stderr
    assert "devices[0].safe: missing: profile thorlabs-sc10 does not say where it is safe" in done.stderr
    for right in ('use = "shutter"; safe = "closed"', 'use = "other"'):
        bench.write_text(text + shutter.replace('use = "shutter"', right))
        assert gonio("check", bench).returncode == 0
