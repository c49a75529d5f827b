# SPDX-License-Identifier: MIT
"""A device is unplugged in the middle of a campaign and plugged in again under another name: the run pauses with the
light off, knows the device by its serial number, goes on with the point in progress, and every reading is right. One
with another serial number is not used."""
import itertools

import pytest

from conftest import BUILD, QUICK_LASER, query, wait_for
from mockbus import Usb, needs_umockdev, preload
from relay import Relay, port_of
from test_goniosim import f00

CAMPAIGN = """\
campaign: {
  name = "replugged";
  theta_i_deg = [ 20.0, 45.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 10.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""
BAUD = {"laser": 115200, "detector": 19200}
SERIAL = {"laser": b"12345", "detector": b"43480"}
OTHER = {"laser": b"54321", "detector": b"99999"}


# --- links: how a device of the simulator is plugged in, taken away, and plugged in elsewhere --------


class ById:
    """A pty behind a lasting name, as udev makes them: a symbolic link to whatever the port is called now."""

    def __init__(self, sim, part, folder):
        self.relay = Relay(port_of(sim, f"{part}-tcp"))
        self.name = folder / "by-id" / f"usb-{part}"
        self.name.parent.mkdir(exist_ok=True)
        self.link = f"serial:{self.name}?baud={BAUD[part]}"
        self.env = {}
        self.places = []

    def plug(self):
        self.relay.plug()
        self.name.symlink_to(self.relay.pty)
        self.places.append(self.relay.pty)

    def unplug(self):
        self.name.unlink()
        self.relay.unplug()

    def answer_as(self, serial, other):
        self.relay.swap = (serial, other)

    def close(self):
        self.relay.close()


class Adapter:
    """A USB adapter on umockdev: /dev/ttyUSB<n>, found by the adapter's own numbers."""

    def __init__(self, sim, part, folder):
        self.relay = Relay(port_of(sim, f"{part}-tcp"))
        self.usb = Usb(folder)
        self.link = f"serial:usb-0403:6001:A50285BI?baud={BAUD[part]}"
        self.env = {**self.usb.env, "LD_PRELOAD": preload(BUILD / "goniod")}
        self.places = []

    def plug(self):
        n = len(self.places)
        self.relay.plug()
        self.usb.tell(f"plug-tty {n} 9 {n + 2} 0403 6001 A50285BI {self.relay.pty}")
        self.places.append(f"/dev/ttyUSB{n}")

    def unplug(self):
        self.relay.unplug()
        self.usb.tell(f"unplug-tty {len(self.places) - 1}")

    def by_library(self):
        return int(self.usb.tell(f"seen-tty {len(self.places) - 1}")) > 0

    def close(self):
        self.relay.close()
        self.usb.close()


class Usbtmc:
    """The lock-in as a USBTMC device: found by its USB serial number at whatever bus and address."""

    def __init__(self, sim, part, folder):
        assert part == "detector"
        self.usb = Usb(folder)
        self.port = port_of(sim, "detector-tcp")
        self.device = self.usb.tell(f"bridge {self.port} cr 0b21 0830 S43480")
        self.link = "usbtmc:0b21:0830:S43480"
        self.env = {**self.usb.env, "LD_PRELOAD": preload(BUILD / "goniod")}
        self.places = []

    def plug(self):
        n = len(self.places)
        self.usb.tell(f"plug {self.device} {n + 1} {10 + n}")
        self.places.append((n + 1, 10 + n))

    def unplug(self):
        self.usb.tell(f"unplug {self.device}")

    def close(self):
        self.usb.close()


LINKS = [("laser", ById), ("detector", ById),
         pytest.param("laser", Adapter, marks=needs_umockdev), pytest.param("detector", Adapter, marks=needs_umockdev),
         pytest.param("detector", Usbtmc, marks=needs_umockdev)]


# --- a campaign over one -------------------------------------------------------------------------


class Run:
    """A campaign whose laser or detector is on such a link; all else on goniosim's TCP ports."""

    def __init__(self, part, line, sim, daemon):
        self.part, self.line, self.sim, self.daemon = part, line, sim, daemon
        self.run = daemon.submit(CAMPAIGN, "replugged.cfg")
        self.id = self.run["run"]
        self.events = daemon.follow(0)

    def unplug(self):
        """In the middle of the second sweep; what the run says to it."""
        for _ in range(5):
            self.events.until(lambda e: e["event"] == "reading" and e["run"] == self.id and e["sweep"] == 1)
        self.line.unplug()
        text = self.events.until_state(self.id, "paused")["text"]
        assert f"{self.part} ({self.line.link}): unplugged; waiting for it to come back" in text
        if self.part == "laser":
            assert text.startswith("LASER MAY BE ON: use its key or the interlock; laser")
        else:
            assert not self.light(), "off while the run is paused"

    def light(self):
        return self.sim.control(do="state")["laser"]["emission"]

    def finish(self):
        self.events.until_state(self.id, "running")
        self.events.until_state(self.id, "done", patience_s=120)

    def device(self):
        return next(d for d in self.daemon.status()["devices"] if d["name"] == self.part)

    def check_readings(self):
        """Each point was read once, in its order, but for the references before all, which are read again after the
        gap, and is what the sample that was set gives."""
        asked = [(e["sweep"], e["point"]) for e in self.events.seen if e["event"] == "reading" and e["run"] == self.id]
        in_turn = [point for point, attempts in itertools.groupby(p for p in asked if p[0] > 0)]
        assert in_turn == sorted({p for p in asked if p[0] > 0}), "no point twice, none out of its turn"
        stored = query(self.run["file"], "select distinct sweep, point from reading order by sweep, point")
        assert [tuple(row) for row in stored] == sorted(set(asked))
        sample = self.sim.control(do="truth")["sample"]
        rows = query(self.run["file"], "select theta_i_deg, theta_r_signed_deg, f_r, u_A from reading_brdf"
                                       " where f_r is not null")
        assert len(rows) == (13 + 4) + (13 + 5), len(rows)
        for theta_i, theta_r, f, u in rows:
            # six times the noise; 0.7 % for the beam's own, and 0.003 deg on the flank of the peak
            assert abs(f - f00(sample, theta_i, theta_r)) <= 6 * u + 7e-3 * f, (theta_i, theta_r)


@pytest.fixture
def start_run(start_sim, start_daemon, tmp_path):
    lines, runs = [], []

    def start(part, kind):
        sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
        line = kind(sim, part, tmp_path)
        lines.append(line)
        line.plug()
        text = (sim.folder / "goniod-tcp.cfg").read_text()
        assert text.count(f"tcp:127.0.0.1:{port_of(sim, part + '-tcp')}") == 1
        bench = tmp_path / "goniod.cfg"
        bench.write_text(text.replace(f"tcp:127.0.0.1:{port_of(sim, part + '-tcp')}", line.link))
        daemon = start_daemon("--config", bench, folder=tmp_path / "d", env=line.env)
        runs.append(Run(part, line, sim, daemon))
        return runs[-1]

    yield start
    for run in runs:
        assert run.daemon.end() == 0, "OFF was not confirmed"  # while there is a laser that can be told
    for line in lines:
        line.close()


def commands(heard):
    return [c for c in bytes(heard).decode().split("\r") if c]


@pytest.mark.parametrize("part, kind", LINKS)
def test_it_is_known_again_by_its_serial_number_and_the_run_goes_on(start_run, part, kind):
    r = start_run(part, kind)
    before = r.device()
    assert SERIAL[part].decode() in before["identity"]
    r.unplug()
    r.line.plug()
    r.finish()
    assert len(set(r.line.places)) == 2, "the same name again proves nothing"
    after = r.device()
    assert after["identity"] == before["identity"] and after["returns"] == before["returns"] + 1
    assert not r.light()
    r.check_readings()
    if kind is Adapter:
        assert r.line.by_library()


@pytest.mark.parametrize("kind", [ById, pytest.param(Adapter, marks=needs_umockdev)])
def test_a_laser_that_comes_back_is_armed_from_off(start_run, kind):
    r = start_run("laser", kind)
    r.unplug()
    assert r.light(), "nobody could tell it"
    r.line.plug()
    r.finish()
    first, again = (commands(heard) for heard in r.line.relay.heard)
    assert r.line.relay.heard[0].startswith(b"\rl0\r") and r.line.relay.heard[1].startswith(b"\rl0\r")
    on = again.index("@cob1")  # the run's own ON, after OFF was read back and the laser was identified
    assert first.count("@cob1") == again.count("@cob1") == 1
    assert again[0] == "l0" and again.index("l?") < again.index("sn?") < on
    assert set(again[:again.index("l?")]) == {"l0"}, "nothing but OFF before it is read back"
    answers = bytes(r.line.relay.answers[1]).decode().split("\r\n")
    assert answers[again.index("l?")] == "0", (again[:6], answers[:6])
    r.check_readings()


@pytest.mark.parametrize("part, kind", [("laser", ById), ("detector", ById),
                                        pytest.param("laser", Adapter, marks=needs_umockdev)])
def test_another_serial_number_keeps_the_run_paused_and_says_why(start_run, part, kind):
    r = start_run(part, kind)
    serial, other = SERIAL[part], OTHER[part]
    r.unplug()
    readings = len(query(r.run["file"], "select * from reading"))
    r.line.relay.swap = (serial, other)
    r.line.plug()
    why = (f"{part}: another device answers here: serial number {serial.decode()} before, {other.decode()} now; plug the "
           "former one in again, or restart goniod when the exchange is meant")
    text = r.events.until_state(r.id, "paused")["text"]
    assert text == ("LASER MAY BE ON: use its key or the interlock; " if part == "laser" else "") + why
    assert r.daemon.status()["state"] == "paused"
    device = r.device()
    assert device["link"] == "lost" and device["problem"] == why and serial.decode() in device["identity"]
    tries = r.device()["errors"]
    r.daemon.gonio("resume", "--detach")  # changes nothing
    wait_for(lambda: r.device()["errors"] >= tries + 2)
    assert r.daemon.status()["state"] == "paused"
    if part == "laser":
        sent = commands(r.line.relay.heard[1])
        assert sent[0] == "l0" and "@cob1" not in sent and not any(c.startswith("p ") for c in sent), sent
    else:
        sent = commands(r.line.relay.heard[1])
        assert set(sent) == {"OUTX 0;*IDN?"}, "asked who it is, and nothing else"
    assert len(query(r.run["file"], "select * from reading")) == readings
    # the right one again, at a third place
    r.line.unplug()
    r.line.relay.swap = None
    r.line.plug()
    r.finish()
    r.check_readings()


@needs_umockdev
def test_another_usb_serial_number_is_not_taken_for_it(start_run):
    r = start_run("detector", Usbtmc)
    r.unplug()
    other = r.line.usb.tell(f"bridge {r.line.port} cr 0b21 0830 S99999")
    r.line.usb.tell(f"plug {other} 5 6")

    def said():
        return "no device with the serial 'S43480'; there is usbtmc:0b21:0830:S99999" in r.device()["problem"]

    wait_for(said)
    assert r.daemon.status()["state"] == "paused" and not r.light()
    r.line.plug()
    r.finish()
    r.check_readings()
