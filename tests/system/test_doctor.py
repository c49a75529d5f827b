# SPDX-License-Identifier: MIT
"""gonio doctor on the simulated bench: each thing that can be wrong is named, with why and what to do, and nothing
moves or lights up."""
import fcntl
import grp
import json
import os
import pathlib
import stat

import pytest

from conftest import BUILD, QUICK_LASER, gonio, short_folder, wait_for

HEADING = ["who", "level", "what", "why", "what_to_do"]
ALL = ["laser", "axis theta_i", "axis theta_r", "axis sample", "detector"]


class Bench:
    """A simulator, its bench file to be changed, and a socket where no daemon listens."""

    def __init__(self, sim, file="goniod.cfg"):
        self.sim = sim
        self.text = (sim.folder / file).read_text()
        self.path = sim.folder.parent / "bench.cfg"
        self.env = {"GONIO_SOCKET": str(sim.folder / "nobody.sock")}

    def change(self, old, new):
        assert self.text.count(old) == 1, old
        self.text = self.text.replace(old, new)

    def doctor(self, **kwargs):
        """Exit status and findings by who."""
        self.path.write_text(self.text)
        r = gonio("doctor", self.path, **{"env": self.env, **kwargs})
        lines = [line.split("\t") for line in r.stdout.splitlines()]
        assert lines[0] == HEADING, r
        self.order = [line[0] for line in lines[1:]]
        findings = {line[0]: dict(zip(HEADING[1:], line[1:])) for line in lines[1:]}
        wrong = sum(f["level"] == "WRONG" for f in findings.values())
        assert r.returncode == (1 if wrong else 0)
        assert r.stderr == ("all well\n" if not wrong else "1 thing is wrong\n" if wrong == 1
                            else f"{wrong} things are wrong\n")
        assert all(f["why"] and f["what_to_do"] for f in findings.values() if f["level"] == "WRONG")
        return findings


@pytest.fixture
def bench(start_sim):
    def start(*args, file="goniod.cfg"):
        return Bench(start_sim("--fast", "--seed", "7", *QUICK_LASER, "--set", "axes.homed=true", *args), file)
    return start


def wrong(findings):
    return {who: f for who, f in findings.items() if f["level"] == "WRONG"}


@pytest.mark.parametrize("file", ["goniod.cfg", "goniod-tcp.cfg"])
def test_a_healthy_bench_is_well_and_nothing_moves_or_lights_up(bench, file):
    b = bench(file=file)
    before = b.sim.control(do="state")
    findings = b.doctor()
    assert b.order == ALL and all(f["level"] == "well" for f in findings.values()), findings
    assert findings["laser"]["what"].startswith("Cobolt ") and "OFF first" in findings["laser"]["what"]
    assert "SR830" in findings["detector"]["what"] and findings["axis sample"]["what"].startswith("unit 3, at ")
    after = b.sim.control(do="state")
    assert after["laser"]["ons"] == before["laser"]["ons"] and after["laser"]["offs"] > before["laser"]["offs"]
    for axis, state in after["axes"].items():
        assert state["motor"] == before["axes"][axis]["motor"] and state["moves"] == before["axes"][axis]["moves"]
    for setting in ("time_constant_s", "full_scale_v"):
        assert after["detector"][setting] == before["detector"][setting]


def test_a_laser_that_emits_is_switched_off(bench):
    b = bench()
    fd = os.open(b.sim.folder / "laser", os.O_RDWR | os.O_NOCTTY)
    os.write(fd, b"@cob1\r")
    wait_for(lambda: b.sim.control(do="state")["laser"]["emission"])
    os.close(fd)
    assert not wrong(b.doctor())
    assert not b.sim.control(do="state")["laser"]["emission"]


def test_a_laser_that_ignores_off_is_an_alarm(bench):
    b = bench()
    fd = os.open(b.sim.folder / "laser", os.O_RDWR | os.O_NOCTTY)
    os.write(fd, b"@cob1\r")
    wait_for(lambda: b.sim.control(do="state")["laser"]["emission"])
    os.close(fd)
    assert b.sim.control(do="set", ignore_off=True)["ok"]
    f = wrong(b.doctor())
    assert list(f) == ["laser"] and "LASER MAY BE ON" in f["laser"]["what"]
    assert "key or the interlock" in f["laser"]["what_to_do"]


def test_a_port_that_is_not_there_and_those_that_are(bench):
    b = bench()
    assert b.sim.control(do="unplug", wire="detector")["ok"]
    f = wrong(b.doctor())
    assert list(f) == ["detector"] and "no such port" in f["detector"]["what"]
    ports = sorted(pathlib.Path("/dev/serial/by-id").glob("*"))
    assert ("ports that exist:" if ports else "no USB serial adapter is plugged in") in f["detector"]["what_to_do"]


def test_exchanged_links_are_told_by_what_answers_there(bench):
    b = bench()
    b.change("/laser?baud=115200", "/other")
    b.change("/detector?baud=19200", "/laser?baud=19200")
    b.change("/other", "/detector?baud=115200")
    f = wrong(b.doctor())
    assert list(f) == ["laser", "detector"]
    assert "this is the detector (Stanford_Research_Systems,SR830" in f["laser"]["what"]
    assert "the config expects the laser" in f["laser"]["what"]
    assert "this is the laser (Cobolt " in f["detector"]["what"]
    assert "the config expects the detector" in f["detector"]["what"]
    assert "exchange the plugs" in f["laser"]["what_to_do"]


def test_a_laser_on_the_axes_port_is_named(bench):
    b = bench()
    b.change("/axes?baud=115200", "/laser?baud=115200")
    f = wrong(b.doctor())
    assert list(f) == ["bus axes"] and "this is the laser (Cobolt " in f["bus axes"]["what"]


def test_a_port_in_use_names_the_other_process(bench):
    b = bench()
    fd = os.open(b.sim.folder / "detector", os.O_RDWR | os.O_NOCTTY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        f = wrong(b.doctor())
    finally:
        os.close(fd)
    assert list(f) == ["detector"]
    assert f"in use by pid {os.getpid()} (" in f["detector"]["what"]
    assert f["detector"]["what_to_do"] == "end that one first"


def test_a_unit_that_is_silent_while_others_answer(bench):
    b = bench()
    b.change("unit = 3", "unit = 9")
    f = wrong(b.doctor())
    assert list(f) == ["axis sample"]
    assert f["axis sample"]["what"] == "unit 9 does not answer, while units 1, 2 on the same bus do"
    assert "address switch to 9" in f["axis sample"]["what_to_do"]


def test_nobody_answers(bench):
    b = bench()
    for wire in ("axes", "detector"):
        assert b.sim.control(do="mute", wire=wire)["ok"]
    f = wrong(b.doctor())
    assert list(f) == ["bus axes", "detector"]
    assert "nobody answers on this bus (asked: unit 1, 2, 3)" in f["bus axes"]["what"]
    assert "115200 baud, parity E, 1 stop bit" in f["bus axes"]["what_to_do"]
    assert "no answer in 300 ms" in f["detector"]["what"] and "baud rate or parity" in f["detector"]["why"]
    assert "19200 baud, parity N, 1 stop bit" in f["detector"]["what_to_do"]


def test_nobody_answers_behind_a_serial_server(bench):
    b = bench(file="goniod-tcp.cfg")
    assert b.sim.control(do="mute", wire="detector-tcp")["ok"]
    f = wrong(b.doctor())
    assert list(f) == ["detector"] and "nobody answers behind it" in f["detector"]["why"]


def test_an_echo_is_named(bench):
    f = wrong(bench("--set", "laser.echo=true").doctor())
    assert list(f) == ["laser"] and f["laser"]["what_to_do"] == "turn its echo off"


def test_a_controller_that_lost_its_home_is_told_and_is_no_failure(bench):
    b = bench()
    assert b.sim.control(do="power-cycle", axis="theta_r")["ok"]
    findings = b.doctor()
    f = findings["axis theta_r"]
    assert f["level"] == "look" and f["what"] == "its controller does not know its home"
    assert "restarted" in f["why"] and "homes it first" in f["what_to_do"]
    assert not wrong(findings)


def test_alarm_and_interlock(bench):
    b = bench()
    assert b.sim.control(do="set", axis="theta_i", alarm=0x30)["ok"]
    assert b.sim.control(do="set", interlock="open")["ok"]
    f = wrong(b.doctor())
    assert list(f) == ["laser", "axis theta_i"]
    assert f["laser"]["what"] == "its interlock is open"
    assert f["axis theta_i"]["what"] == "alarm 30h: overload"


def test_tcp_that_leads_nowhere(bench):
    b = bench(file="goniod-tcp.cfg")
    assert b.sim.control(do="unplug", wire="laser-tcp")["ok"]
    port = b.sim.control(do="state")["wires"]["detector-tcp"]["address"].rsplit(":", 1)[1]
    b.change(f'"tcp:127.0.0.1:{port}"', f'"tcp:no-such-host.invalid:{port}"')
    f = wrong(b.doctor())
    assert list(f) == ["laser", "detector"]
    assert "Connection refused" in f["laser"]["what"] and "nothing listens" in f["laser"]["why"]
    assert "no address for this host" in f["detector"]["what"]
    assert "spelling of 'no-such-host.invalid'" in f["detector"]["what_to_do"]


def test_without_permission_that_is_said(bench):
    if os.geteuid() == 0:
        pytest.skip("root may open every port; the next test asks as somebody else")
    b = bench()
    os.chmod(os.path.realpath(b.sim.folder / "detector"), 0)
    f = wrong(b.doctor())
    assert list(f) == ["detector"] and "permission denied" in f["detector"]["what"]


def test_without_permission_the_group_to_join_is_named(bench):
    if os.geteuid() != 0:
        pytest.skip("only root can ask as somebody else")
    if not all(p.stat().st_mode & stat.S_IXOTH for p in BUILD.parents):
        pytest.skip("somebody else cannot reach the build folder")
    b = bench()
    folder = short_folder(b.sim.folder)
    for name in ("laser", "axes", "detector"):
        port = os.path.realpath(b.sim.folder / name)
        b.change(f"{b.sim.folder}/{name}?", f"{folder}/{name}?")
        (folder / name).symlink_to(port)
        os.chown(port, 0, grp.getgrnam("dialout").gr_gid)
        os.chmod(port, 0o660 if name == "detector" else 0o666)
    folder.chmod(0o755)
    b.path = folder / "bench.cfg"
    f = wrong(b.doctor(user="nobody", group="nogroup", extra_groups=[]))
    assert list(f) == ["detector"] and "permission denied" in f["detector"]["what"]
    assert f["detector"]["what_to_do"].startswith("join the group 'dialout': sudo usermod -aG dialout nobody")


@pytest.mark.parametrize("named", [True, False])
def test_a_daemon_that_has_the_ports_is_asked(start_sim, start_daemon, tmp_path, named):
    sim = start_sim("--fast", "--seed", "7", *QUICK_LASER)
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    before = sim.control(do="state")["laser"]["offs"]
    assert sim.control(do="unplug", wire="detector")["ok"]
    wait_for(lambda: any(d["link"] == "lost" for d in daemon.status()["devices"]))
    arguments = [sim.folder / "goniod.cfg"] if named else []
    r = gonio("doctor", "--json", *arguments, env=daemon.env, cwd=tmp_path)
    assert r.returncode == 1, r
    report = json.loads(r.stdout)
    findings = {f["who"]: f for f in report["findings"]}
    assert report["goniod_pid"] == daemon.pid and report["well"] is False
    assert set(findings) == {"goniod", *ALL}
    assert findings["goniod"]["level"] == "look"
    assert f"in use by pid {daemon.pid}" in findings["goniod"]["what"]
    assert findings["detector"]["level"] == "wrong" and "detector" in findings["detector"]["what"]
    assert findings["laser"]["level"] == "well" and "says goniod" in findings["laser"]["what"]
    assert findings["axis theta_i"]["what"] == "its controller does not know its home"
    assert sim.control(do="state")["laser"]["offs"] == before, "goniod's laser was left alone"


def test_a_wrong_bench_file_is_not_examined(bench):
    b = bench()
    before = b.sim.control(do="state")["wires"]
    b.change("unit = 3", "unti = 3")
    b.path.write_text(b.text)
    r = gonio("doctor", b.path, env=b.env)
    assert r.returncode == 2 and "did you mean 'unit'?" in r.stderr and r.stdout == ""
    assert b.sim.control(do="state")["wires"] == before
    r = gonio("doctor", env=b.env, cwd=b.sim.folder.parent)
    assert r.returncode == 2 and "which bench?" in r.stderr


def test_the_bench_file_of_this_folder_is_the_one(bench):
    b = bench()
    r = gonio("doctor", "--json", env=b.env, cwd=b.sim.folder)
    report = json.loads(r.stdout)
    assert r.returncode == 0 and report["well"] is True and report["goniod_pid"] is None
    assert report["file"] == "goniod.cfg" and [f["who"] for f in report["findings"]] == ALL
    assert set(report["findings"][0]) == {"who", "level", "what", "why", "what_to_do"}
