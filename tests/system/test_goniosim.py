# SPDX-License-Identifier: MIT
"""goniosim and peers that were not written for it: mbpoll, pymodbus, pyserial and plain sockets."""
import cmath
import json
import math
import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import time

import pytest
import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from conftest import BUILD, PATIENCE_S, Program, control

THETA_I, THETA_R, SAMPLE = 1, 2, 3
MOVE, READY, HOME_END, ALARM = 1 << 13, 1 << 5, 1 << 4, 1 << 7
RTU_GAP_CHARS = 3.5


@pytest.fixture
def fast(start_sim):
    return start_sim("--fast", "--seed", "7")


def port_of(sim, wire):
    return int(sim.control(do="state")["wires"][wire]["address"].rsplit(":", 1)[1])


def wait_for(condition, what, patience_s=PATIENCE_S):
    """Asks again and again, without a pause: each question takes its own time."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
    raise AssertionError(f"not within {patience_s} s: {what}")


def words(value):
    return [value >> 16 & 0xFFFF, value & 0xFFFF]


def pair(registers):
    value = registers[0] << 16 | registers[1]
    return value - (1 << 32) if value >> 31 else value


class Axes:
    """Three AZ drivers over any pymodbus client."""

    def __init__(self, client):
        assert client.connect()
        self.client = client

    def read(self, unit, address, count):
        answer = self.client.read_holding_registers(address, count, slave=unit)
        assert not answer.isError(), answer
        return answer.registers

    def write(self, unit, address, values):
        answer = self.client.write_registers(address, values, slave=unit)
        assert not answer.isError(), answer

    def status(self, unit):
        return self.read(unit, 0x7E, 4)[1]

    def position(self, unit):
        return pair(self.read(unit, 0xCC, 2))

    def rest(self, unit):
        wait_for(lambda: not self.status(unit) & MOVE, f"unit {unit} at rest")
        assert not self.status(unit) & ALARM

    def home(self, unit):
        self.write(unit, 0x7C, [0, 0x10])
        self.write(unit, 0x7C, [0, 0])
        wait_for(lambda: self.status(unit) & HOME_END, f"unit {unit} at home")

    def move(self, unit, steps):
        self.write(unit, 0x58, sum(map(words, [0, 1, steps, 300000, 60000000, 60000000, 1000, 1]), []))
        self.rest(unit)
        assert self.position(unit) == steps


def serial_axes(sim, baud=115200):
    # strict would set the line a second time, and asking a pty for parity twice is EINVAL
    return Axes(ModbusSerialClient(str(sim.folder / "axes"), baudrate=baud, parity="E", timeout=2, strict=False))


def tcp_axes(sim):
    return Axes(ModbusTcpClient("127.0.0.1", port=port_of(sim, "axes-tcp"), timeout=2))


class Text:
    """A text instrument on a pty (pyserial) or on raw TCP."""

    def __init__(self, sim, wire, end, baud=115200):
        self.end = end
        if wire.endswith("-tcp"):
            self.port = serial.serial_for_url(f"socket://127.0.0.1:{port_of(sim, wire)}", timeout=PATIENCE_S)
        else:
            self.port = serial.Serial(str(sim.folder / wire), baud, timeout=PATIENCE_S)

    def send(self, text):
        self.port.write(text.encode() + b"\r")

    def ask(self, text):
        self.send(text)
        answer = self.port.read_until(self.end)
        assert answer.endswith(self.end), (text, answer)
        return answer[: -len(self.end)].decode()

    def ask_slowly(self, text):
        """The laser wants 100 ms between commands and ignores what comes sooner."""
        self.port.timeout = 0.12
        for _ in range(50):
            self.send(text)
            answer = self.port.read_until(self.end)
            if answer.endswith(self.end):
                return answer[: -len(self.end)].decode()
        raise AssertionError(f"no answer to {text}")


def laser(sim, wire="laser"):
    return Text(sim, wire, b"\r\n")


def detector(sim, wire="detector"):
    d = Text(sim, wire, b"\r", 19200)
    d.send("OUTX 0")
    assert d.ask("*IDN?").startswith("Stanford_Research_Systems,SR830")
    return d


# --- run directory and options ----------------------------------------------------------------------


def test_the_run_directory_appears_and_disappears(start_sim):
    sim = start_sim("--fast")
    assert {p.name for p in sim.folder.iterdir()} == {"axes", "laser", "detector", "control.sock", "goniosim.pid",
                                                      "goniod.cfg", "goniod-tcp.cfg", "ready"}
    assert (sim.folder / "goniosim.pid").read_text() == f"{sim.pid}\n"
    text = (sim.folder / "goniod.cfg").read_text()
    assert f'link = "modbus-rtu:{sim.folder}/axes?baud=115200&parity=E"' in text
    assert f'"modbus-tcp:127.0.0.1:{port_of(sim, "axes-tcp")}"' in (sim.folder / "goniod-tcp.cfg").read_text()
    assert sim.end() == 0
    assert list(sim.folder.iterdir()) == []


def test_a_long_run_directory_works(start_sim, tmp_path):
    sim = start_sim("--fast", folder=tmp_path / ("x" * 120))
    (sim.folder / "control.sock").lstat()
    assert serial_axes(sim).status(THETA_I) & READY


def test_a_second_goniosim_in_the_same_directory_is_refused(fast):
    second = subprocess.run([BUILD / "goniosim", "--run-dir", fast.folder], capture_output=True, text=True,
                            timeout=PATIENCE_S, check=False)
    assert second.returncode == 4
    assert str(fast.pid) in second.stderr
    assert fast.control(do="state")["ok"]


def test_leftovers_of_one_that_was_killed_do_no_harm(start_sim, tmp_path):
    first = start_sim("--fast", folder=tmp_path / "bench")
    assert first.end(signal.SIGKILL) == -signal.SIGKILL
    second = start_sim("--fast", folder=tmp_path / "bench")
    assert second.control(do="state")["ok"]
    assert serial_axes(second).status(THETA_I) & READY


@pytest.mark.parametrize("arguments, says", [
    ([], "--run-dir"),
    (["--run-dir", "{}", "--seeed", "1"], "--seed"),
    (["--run-dir", "{}", "--seed", "x"], "--seed"),
    (["--run-dir", "{}", "--set", "sample.sigma=9"], "0.001..1"),
    (["--run-dir", "{}", "--set", "sample.sigma"], "NAME=VALUE"),
    (["--run-dir", "{}", "--config", "/nonexistent.cfg"], "/nonexistent.cfg"),
    (["--run-dir", "/nonexistent/folder"], "/nonexistent/folder"),
])
def test_mistakes_on_the_command_line(arguments, says, tmp_path):
    done = subprocess.run([BUILD / "goniosim", *[a.format(tmp_path) for a in arguments]], capture_output=True,
                          text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 2
    assert says in done.stderr and not done.stdout


def test_a_wrong_file_is_refused_with_its_line(tmp_path):
    config = tmp_path / "sim.cfg"
    config.write_text("seed = 3;\nlaser: { warmup_s = -1.0; };\n")
    done = subprocess.run([BUILD / "goniosim", "--run-dir", tmp_path / "bench", "--config", config],
                          capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 2
    assert "sim.cfg:2:" in done.stderr
    assert not (tmp_path / "bench").exists()


def test_it_ends_with_its_parent(tmp_path):
    """The parent is a shell of its own that is killed."""
    code = ("import subprocess,sys,time\n"
            f"p=subprocess.Popen([{str(BUILD / 'goniosim')!r},'--run-dir',{str(tmp_path / 'b')!r},'--fast',"
            "'--exit-with-parent'],stdout=subprocess.PIPE)\n"
            "print([p.stdout.readline() for _ in range(2)], flush=True)\n"
            "print('up', p.pid, flush=True)\ntime.sleep(600)\n")
    parent = Program([sys.executable, "-c", code], tmp_path / "parent.log")
    pid = int(parent.wait_line("up").split()[1])
    fd = os.pidfd_open(pid)
    parent.end(signal.SIGKILL)
    ended = select.select([fd], [], [], PATIENCE_S)[0]
    if not ended:
        signal.pidfd_send_signal(fd, signal.SIGKILL)
    os.close(fd)
    assert ended, "goniosim still runs"
    assert not (tmp_path / "b").exists()


# --- the axes and their bus -------------------------------------------------------------------------


def mbpoll(*arguments):
    done = subprocess.run(["mbpoll", "-0", "-1", *map(str, arguments)], capture_output=True, text=True,
                          timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {int(a): int(v) for a, v in re.findall(r"^\[(\d+)\]:\s+(-?\d+)", done.stdout, re.M)}


def test_mbpoll_reads_status_over_both_wires(fast):
    expected = {126: 0, 127: 0x4020, 128: 0, 129: 0}  # in position and ready
    for unit in (THETA_I, THETA_R, SAMPLE):
        assert mbpoll("-m", "rtu", "-a", unit, "-b", 115200, "-P", "even", "-r", 126, "-c", 4,
                      fast.folder / "axes") == expected
        assert mbpoll("-m", "tcp", "-a", unit, "-p", port_of(fast, "axes-tcp"), "-r", 126, "-c", 4,
                      "127.0.0.1") == expected


def test_pymodbus_moves_an_axis_that_both_wires_see(fast):
    rtu, tcp = serial_axes(fast), tcp_axes(fast)
    rtu.home(THETA_R)
    rtu.move(THETA_R, 45000)
    assert tcp.position(THETA_R) == 45000
    tcp.move(THETA_R, -30500)
    assert rtu.position(THETA_R) == -30500
    state = fast.control(do="state")["axes"]["theta_r"]
    assert state["motor"] == pytest.approx(-30.5) and state["load"] == pytest.approx(-30.485)  # backlash
    assert fast.control(do="state")["axes"]["theta_i"]["motor"] == pytest.approx(2.5)


def test_pymodbus_hears_exceptions(fast):
    for axes in (serial_axes(fast), tcp_axes(fast)):
        assert axes.client.read_holding_registers(0x10, 2, slave=1).exception_code == 2
        assert axes.client.write_registers(0x60, [0, 0], slave=1).exception_code == 3
        assert axes.client.read_coils(0, 8, slave=1).exception_code == 1


CLIENT_THAT_DIES = """
import os, sys, signal
from pymodbus.client import ModbusSerialClient
c = ModbusSerialClient(sys.argv[1], baudrate=115200, parity="E", timeout=2, strict=False)
assert c.connect()
assert c.read_holding_registers(0x7E, 4, slave=1).registers[1] == 0x4020
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_even_parity_works_again_after_a_client_died(fast):
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", CLIENT_THAT_DIES, fast.folder / "axes"], capture_output=True,
                              text=True, timeout=PATIENCE_S, check=False)
        assert done.returncode == -signal.SIGKILL, done.stderr
    mbpoll("-m", "rtu", "-a", 1, "-b", 115200, "-P", "even", "-r", 126, "-c", 4, fast.folder / "axes")


@pytest.mark.parametrize("baud", [115200, 9600])
def test_serial_frames_take_the_time_of_their_baud(start_sim, baud):
    """Request 8 bytes, answer 5 + 2 n, 11 bits each, and the gap of 3.5 characters: a lower bound only."""
    sim = start_sim()
    fd = os.open(sim.folder / "axes", os.O_RDWR | os.O_NOCTTY)
    port = serial.Serial(str(sim.folder / "axes"), baud, parity="E", timeout=PATIENCE_S)
    request = bytes.fromhex("01 03 00CC 0006")
    request += crc(request)
    took = []
    for _ in range(20):
        before = time.monotonic()
        port.write(request)
        answer = port.read(17)
        took.append(time.monotonic() - before)
        assert len(answer) == 17 and crc(answer[:-2]) == answer[-2:]
    os.close(fd)
    least = (25 + RTU_GAP_CHARS) * 11 / baud
    print(f"{baud} baud: theory {1000 * least:.2f} ms, measured {1000 * min(took):.2f}.."
          f"{1000 * max(took):.2f}, median {1000 * sorted(took)[10]:.2f} ms")
    assert min(took) >= least * 0.999


def crc(frame):
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return value.to_bytes(2, "little")


def test_without_wire_speed_serial_is_quicker_than_its_baud(start_sim):
    sim = start_sim("--set", "wires.speed=false")
    axes = serial_axes(sim, 1200)
    before = time.monotonic()
    for _ in range(20):
        axes.read(1, 0xCC, 6)
    assert time.monotonic() - before < 20 * 28.5 * 11 / 1200


# --- laser and detector -----------------------------------------------------------------------------


@pytest.mark.parametrize("wire", ["laser", "laser-tcp"])
def test_the_laser_on_both_wires(fast, wire):
    las = laser(fast, wire)
    assert las.ask("?") == "OK"
    las.port.timeout = 0.05
    las.send("l?")
    assert las.port.read(1) == b""  # too early: ignored
    assert las.ask_slowly("gom?") == "0"
    assert las.ask_slowly("l1").startswith("Error")  # autostart is enabled
    assert not fast.control(do="state")["laser"]["emission"]
    before = time.monotonic_ns()
    assert las.ask_slowly("@cob1") == "OK"
    wait_for(lambda: las.ask_slowly("gom?") == "4", "laser completed")
    state = fast.control(do="state")["laser"]
    assert state["emission"] and before < state["since_ns"] < time.monotonic_ns()
    assert float(las.ask_slowly("pa?")) == pytest.approx(0.01, rel=0.02)
    before = time.monotonic_ns()
    assert las.ask_slowly("l0") == "OK"
    state = fast.control(do="state")["laser"]
    assert not state["emission"] and state["power_w"] == 0
    assert before < state["last_off_ns"] < time.monotonic_ns()


def test_an_open_interlock_is_seen_on_the_wire(fast):
    las = laser(fast)
    las.ask("@cob1")
    wait_for(lambda: las.ask_slowly("l?") == "1", "emission")
    assert fast.control(do="set", interlock="open")["ok"]
    assert las.ask_slowly("l?") == "0" and las.ask_slowly("ilk?") == "1" and las.ask_slowly("f?") == "3"
    assert fast.control(do="set", interlock="closed")["ok"]
    assert las.ask_slowly("@cob1").startswith("Error")


@pytest.mark.parametrize("wire", ["detector", "detector-tcp"])
def test_the_detector_on_both_wires(fast, wire):
    d = detector(fast, wire)
    d.send("SENS 10;OFLT 4;OFSL 1;*CLS")
    assert d.ask("SENS?;XXXX?") == "10"
    assert d.ask("*ESR?") == "32"
    x, y, frequency, monitor = map(float, d.ask("SNAP? 1,2,9,5").split(","))
    assert abs(x) < 1e-5 and abs(y) < 1e-5 and frequency == 1000 and abs(monitor) < 0.01
    assert fast.control(do="set", saturate=True)["ok"]
    wait_for(lambda: int(d.ask("LIAS?")) & 1, "input overload")


def test_a_second_client_on_raw_tcp_is_closed_and_the_first_goes_on(fast):
    las = laser(fast, "laser-tcp")
    assert las.ask("?") == "OK"
    with socket.create_connection(("127.0.0.1", port_of(fast, "laser-tcp")), PATIENCE_S) as second:
        assert second.recv(1) == b""
    assert las.ask_slowly("?") == "OK"
    las.port.close()
    assert laser(fast, "laser-tcp").ask_slowly("?") == "OK"


# --- light ------------------------------------------------------------------------------------------


def f00(p, theta_i_deg, theta_r_deg):
    """The model in plane, with complex arithmetic: written from its equations, apart from the program's."""
    ti, tr = math.radians(theta_i_deg), math.radians(theta_r_deg)
    half, b = (tr - ti) / 2, (ti + tr) / 2  # normal of the facet, angle of incidence on it
    eps = complex(p["n"], p["k"]) ** 2
    q = cmath.sqrt(eps - math.sin(b) ** 2)
    rs = (math.cos(b) - q) / (math.cos(b) + q)
    rp = (eps * math.cos(b) - q) / (eps * math.cos(b) + q)
    g = min(1, 2 * math.cos(half) * math.cos(tr) / math.cos(b), 2 * math.cos(half) * math.cos(ti) / math.cos(b))
    c = (p["ks"] / (2 * math.pi) / (4 * p["sigma"] ** 2) * g / math.cos(half) ** 4
         * math.exp(-math.tan(half) ** 2 / (2 * p["sigma"] ** 2)) / (math.cos(ti) * math.cos(tr)))
    return c * (abs(rs) ** 2 + abs(rp) ** 2) / 2 + p["kd"] / math.cos(ti)


def reading(d, sens):
    """Means of signal and monitor over 100 time constants and at least 50 values; settled, in range."""
    d.send(f"SENS {sens};OFLT 4;OFSL 1")
    d.ask("LIAS?")
    end = time.monotonic() + 0.05  # 50 time constants
    wait_for(lambda: d.ask("OFLT?") and time.monotonic() > end, "settled")
    d.ask("LIAS?")
    values, monitors = [], []
    end = time.monotonic() + 0.1
    while len(values) < 50 or time.monotonic() < end:
        x, _, _, monitor = map(float, d.ask("SNAP? 1,2,9,5").split(","))
        values.append(x)
        monitors.append(monitor)
    assert not int(d.ask("LIAS?")) & 0x0F
    return sum(values) / len(values), sum(monitors) / len(values)


def test_a_brdf_measured_over_the_wires_is_the_one_that_was_set(fast):
    axes, las, d = tcp_axes(fast), laser(fast, "laser-tcp"), detector(fast, "detector-tcp")
    truth = fast.control(do="truth")
    for unit in (THETA_I, THETA_R, SAMPLE):
        axes.home(unit)
    dark, monitor_dark = reading(d, 8)  # 1 uV
    assert dark == pytest.approx(2e-7, abs=5e-8)
    las.ask_slowly("p 0.05")
    las.ask_slowly("@cob1")
    wait_for(lambda: las.ask_slowly("gom?") == "4", "laser completed")
    axes.move(THETA_R, 180000)
    assert reading(d, 26)[0] < 1e-3  # the sample is in the way
    axes.move(SAMPLE, 30000)
    beam, monitor_beam = reading(d, 26)
    assert 0.5 < beam < 0.95
    axes.move(SAMPLE, 0)
    for theta_i, theta_r, sens in [(45, -45, 14), (45, 45, 15), (30, 10, 15), (0, 20, 15), (60, 70, 17)]:
        axes.move(THETA_R, (theta_r - 1) * 1000)  # from below: no backlash
        axes.move(THETA_I, (theta_i - 1) * 1000)
        axes.move(THETA_R, theta_r * 1000)
        axes.move(THETA_I, theta_i * 1000)
        s, monitor = reading(d, sens)
        ratio = (s - dark) / (monitor - monitor_dark) / ((beam - dark) / (monitor_beam - monitor_dark))
        measured = ratio / (truth["optics"]["solid_angle_sr"] * math.cos(math.radians(theta_r)))
        # Noise of 7 nV on 20 uV and more, laser noise 1e-4, a step of the range 4e-5: 0.3 % is six of them all.
        assert measured == pytest.approx(f00(truth["sample"], theta_i, theta_r), rel=3e-3), (theta_i, theta_r)


# --- faults -----------------------------------------------------------------------------------------


def test_a_pty_that_is_unplugged_hangs_up_and_comes_back(fast):
    fd = os.open(fast.folder / "laser", os.O_RDWR | os.O_NOCTTY)
    poll = select.poll()
    poll.register(fd, select.POLLIN)
    assert fast.control(do="unplug", wire="laser")["ok"]
    assert poll.poll(1000 * PATIENCE_S)[0][1] & select.POLLHUP
    os.close(fd)
    assert not (fast.folder / "laser").is_symlink()
    assert not fast.control(do="state")["wires"]["laser"]["plugged"]
    assert fast.control(do="plug", wire="laser")["ok"]
    assert laser(fast).ask("?") == "OK"


def test_tcp_that_is_unplugged_resets_and_listens_again_on_its_port(fast):
    port = port_of(fast, "detector-tcp")
    client = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
    client.sendall(b"OUTX 0\r*IDN?\r")
    assert client.recv(100)
    assert fast.control(do="unplug", wire="detector-tcp")["ok"]
    with pytest.raises(ConnectionResetError):
        client.recv(1)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), PATIENCE_S)
    assert fast.control(do="plug", wire="detector-tcp")["ok"]
    assert port_of(fast, "detector-tcp") == port
    detector(fast, "detector-tcp")


def test_replies_can_be_dropped_delayed_and_muted(fast):
    d = detector(fast)
    d.port.timeout = 0.3
    assert fast.control(do="set", wire="detector", drop=1)["ok"]
    d.send("SENS?")
    assert d.port.read(1) == b""
    assert d.ask("SENS?") == "26"
    assert fast.control(do="set", wire="detector", delay_ms=150)["ok"]
    before = time.monotonic()
    assert d.ask("SENS?") == "26"
    assert time.monotonic() - before >= 0.149
    assert fast.control(do="mute", wire="detector")["ok"]
    d.send("SENS 20")
    d.send("SENS?")
    assert d.port.read(1) == b""
    assert fast.control(do="unmute", wire="detector")["ok"]
    assert d.ask("SENS?") == "20"  # it was carried out
    counts = fast.control(do="state")["wires"]["detector"]
    assert counts["lost"] == 2 and counts["client"] and counts["frames_in"] >= 6


def test_a_power_cycle_loses_home_and_an_alarm_stops(fast):
    axes = tcp_axes(fast)
    axes.home(THETA_I)
    axes.move(THETA_I, 10000)
    assert fast.control(do="power-cycle", axis="theta_i")["ok"]
    assert not axes.status(THETA_I) & HOME_END and axes.position(THETA_I) == 0
    axes.home(THETA_I)
    assert fast.control(do="set", axis="theta_i", alarm=0x30)["ok"]
    assert axes.status(THETA_I) & ALARM and pair(axes.read(THETA_I, 0x80, 2)) == 0x30


@pytest.mark.parametrize("question, says", [
    ("not json", "JSON"),
    ("[1]", "object"),
    ('{"do":"fly"}', "'fly'"),
    ('{}', "'do'"),
    ('{"do":"unplug"}', "axes-tcp"),
    ('{"do":"unplug","wire":"usb"}', "axes-tcp"),
    ('{"do":"set"}', "something to set"),
    ('{"do":"set","interlok":"open"}', "interlok"),
    ('{"do":"set","interlock":"ajar"}', "open, closed"),
    ('{"do":"set","saturate":1}', "true or false"),
    ('{"do":"set","wire":"axes","drop":-1}', "0..1000000"),
    ('{"do":"set","drop":1}', "axes-tcp"),
    ('{"do":"set","axis":"phi","alarm":1}', "theta_i"),
    ('{"do":"set","term":"ghost","on":true}', "scatter"),
])
def test_the_control_socket_says_what_is_wrong(fast, question, says):
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(str(fast.folder / "control.sock"))
        s.sendall(question.encode() + b"\n")
        answer = json.loads(s.makefile().readline())
    assert answer["ok"] is False and says in answer["error"], answer


def test_a_wrong_request_changes_nothing(fast):
    before = fast.control(do="state")["laser"]["interlock_closed"]
    answer = fast.control(do="set", interlock="open", nonsense=1)
    assert not answer["ok"]
    assert fast.control(do="state")["laser"]["interlock_closed"] == before is True


def test_two_benches_with_one_seed_see_the_same_numbers_at_the_start(start_sim, tmp_path):
    sims = [start_sim("--fast", "--seed", seed, folder=tmp_path / f"b{i}") for i, seed in enumerate("334")]
    monitors = []
    for sim in sims:
        d = detector(sim)
        monitors.append([d.ask("OAUX? 2") for _ in range(20)])
    assert monitors[0] == monitors[1] != monitors[2]


def test_replies_that_nobody_read_do_not_meet_the_next_client(fast):
    d = detector(fast)
    before = fast.control(do="state")["wires"]["detector"]["frames_out"]
    for _ in range(5):
        d.send("SENS?")
    wait_for(lambda: fast.control(do="state")["wires"]["detector"]["frames_out"] == before + 5, "replies sent")
    d.port.close()
    wait_for(lambda: not fast.control(do="state")["wires"]["detector"]["client"], "client gone")
    fd = os.open(fast.folder / "detector", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.write(fd, b"OFLT?\r")
    select.select([fd], [], [], PATIENCE_S)
    assert os.read(fd, 100) == b"8\r"
    os.close(fd)


CLIENT_THAT_CLAIMS_AND_DIES = """
import fcntl, os, signal, sys, termios
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.ioctl(fd, termios.TIOCEXCL)
os.write(fd, b"?\\r")
assert os.read(fd, 1) == b"O"
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="starts programs as another user")
def test_a_claim_of_a_client_that_died_is_forgotten(tmp_path):
    """TIOCEXCL stays with a pty and keeps everybody out but root."""
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    folder = tmp_path / "bench"
    folder.mkdir()
    program = shutil.copy(BUILD / "goniosim", tmp_path)  # the build may lie where others may not look
    for path in folder.parents:
        if len(path.parts) > 2:
            path.chmod(0o711)
    folder.chmod(0o777)
    sim = Program([*nobody, program, "--run-dir", folder, "--fast"], tmp_path / "sim.log")
    try:
        sim.wait_line("ready")
        for _ in range(3):
            done = subprocess.run([*nobody, "/usr/bin/python3", "-c", CLIENT_THAT_CLAIMS_AND_DIES, folder / "laser"],
                                  capture_output=True, text=True, timeout=PATIENCE_S, check=False)
            assert done.returncode == -signal.SIGKILL, done.stderr
            wait_for(lambda: not control(folder / "control.sock", do="state")["wires"]["laser"]["client"], "it left")
            # The laser ignores what comes within 100 ms.
            last = time.monotonic() + 0.1
            wait_for(lambda: control(folder / "control.sock", do="state") and time.monotonic() > last, "a gap")
    finally:
        assert sim.end() == 0
