# SPDX-License-Identifier: MIT
"""Instruments made from profiles, here ones that nobody makes, on real wires: pyserial, plain sockets, mbpoll and
pymodbus talk to them."""
import os
import re
import select
import signal
import socket
import subprocess
import time

import pytest
import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from conftest import BUILD, PATIENCE_S, ROOT, Program, gonio, wait_for

PROFILES = sorted(p.stem for p in (ROOT / "configs" / "profiles").glob("*.cfg"))

LAMP = r"""
profile: { name = "lamp"; title = "A lamp"; role = "laser"; protocol = "message"; source = "this test";
  link = "serial:/dev/ttyUSB0?baud=19200"; };
values: (
  { name = "lit"; type = "int"; max = 1; },
  { name = "asked_w"; unit = "W"; max = 2; },
  { name = "power_w"; unit = "W"; },
  { name = "door"; type = "word"; words = ( "CLOSED", "OPEN" ); },
  { name = "flags"; type = "hex"; bits = ( { name = "hot"; bit = 2; } ); },
  { name = "model"; type = "string"; } );
framing: { end_out = "\r"; end_in = "\r\n"; ok_line = "done"; };
exchanges: (
  { name = "model"; send = "WHO?"; answer = "{model}"; },
  { name = "lit"; send = "LIT?"; answer = "{lit}"; },
  { name = "power"; send = "POW?"; answer = "{power_w:.3f} W"; },
  { name = "flags"; send = "FLG?"; answer = "{flags:04x}"; },
  { name = "set"; send = "POW {asked_w:.3f}"; },
  { name = "on"; send = "ON"; then = "lit = 1"; },
  { name = "off"; send = "OFF"; then = "lit = 0"; } );
refusals: ( { like = "what?*"; } );
laser: { status = ( "lit", "power" ); light = ( "lit" ); emitting = "lit = 1";
  states = ( { when = "lit = 1"; is = "emitting"; }, { is = "off"; } );
  on = ( { send = "on"; } ); off = ( "\rOFF" ); off_asks = ( "lit" ); is_off = "lit = 0"; };
simulate: {
  start = ( { value = "model"; is = "Lamp 3"; }, { value = "asked_w"; is = "1"; } );
  drift = ( { value = "power_w"; when = "lit = 1"; to = "asked_w"; rate = 20; },
            { value = "power_w"; when = "lit = 0"; to = "0"; } );
  deny = ( { does = "on"; when = "door = OPEN"; answer = "shut the door"; } ); };
"""

SLIDE = r"""
profile: { name = "slide"; title = "A slide"; role = "axis"; protocol = "modbus"; source = "this test"; };
values: (
  { name = "target"; type = "int"; address = 0x10; format = "s32"; min = -9000; max = 9000; },
  { name = "speed"; type = "int"; address = 0x12; format = "s32"; min = 1; max = 100000; },
  { name = "go"; type = "int"; address = 0x14; max = 1; },
  { name = "command"; type = "hex"; address = 0x15; bits = ( { name = "stop"; bit = 3; } ); },
  { name = "status"; type = "hex"; address = 0x20; access = "r"; bits = ( { name = "moving"; bit = 0; } ); },
  { name = "position"; type = "int"; address = 0x21; format = "s32"; access = "r"; },
  { name = "celsius"; address = 0x30; format = "f32"; access = "r"; table = "input"; },
  { name = "lamp"; type = "int"; address = 4; table = "coil"; max = 1; },
  { name = "door"; type = "int"; address = 7; table = "discrete"; access = "r"; } );
writes: (
  { name = "move"; set = ( "target = $position", "speed = $speed", "go = 1" );
    then = "status.moving = 1, go = 0"; },
  { name = "stop"; edge = "command.stop"; then = "status.moving = 0"; } );
axis: { status = ( "status", "position" ); position = "position"; moving = "status.moving";
  in_position = "not status.moving"; move = "move"; stop = "stop"; };
simulate: {
  start = ( { value = "celsius"; is = "21.5"; }, { value = "position"; is = "-100"; } );
  drift = ( { value = "position"; when = "status.moving"; to = "target"; rate_value = "speed";
              then = "status.moving = 0"; } );
  deny = ( { does = "move"; when = "door = 1"; answer = "4"; } ); };
"""


@pytest.fixture
def lamp(start_sim, tmp_path):
    return start_sim("--profile", written(tmp_path, "lamp", LAMP))


@pytest.fixture
def slide(start_sim, tmp_path):
    return start_sim("--profile", written(tmp_path, "slide", SLIDE), "--unit", "5")


def written(folder, name, text):
    file = folder / f"{name}.cfg"
    file.write_text(text)
    return file


def port_of(sim, wire):
    return int(sim.control(do="state")["wires"][wire]["address"].rsplit(":", 1)[1])


class Line:
    def __init__(self, port):
        self.port = port

    def ask(self, text, lines=1):
        self.port.write(text.encode() + b"\r")
        answers = [self.port.read_until(b"\r\n") for _ in range(lines)]
        assert all(a.endswith(b"\r\n") for a in answers), (text, answers)
        return [a[:-2].decode() for a in answers]


def on_pty(sim, **kwargs):
    return Line(serial.Serial(str(sim.folder / "lamp"), 19200, timeout=PATIENCE_S, **kwargs))


def on_tcp(sim):
    return Line(serial.serial_for_url(f"socket://127.0.0.1:{port_of(sim, 'lamp-tcp')}", timeout=PATIENCE_S))


def values(sim):
    return sim.control(do="values")["values"]


# --- text -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("connect", [on_pty, on_tcp])
def test_a_lamp_is_asked_told_and_refuses(lamp, connect):
    line = connect(lamp)
    assert line.ask("WHO?", 2) == ["Lamp 3", "done"]
    assert line.ask("LIT?", 2) == ["0", "done"]
    assert line.ask("POW 0.5") == ["done"]
    assert line.ask("ON") == ["done"]
    wait_for(lambda: line.ask("POW?", 2)[0] == "0.500 W")
    assert line.ask("POW 2.5") == ["what?"]
    assert line.ask("HELLO") == ["what?"]
    assert values(lamp)["asked_w"] == 0.5
    assert line.ask("OFF") == ["done"]
    assert line.ask("POW?", 2) == ["0.000 W", "done"]


def test_what_the_wires_and_the_socket_set_is_one_instrument(lamp):
    pty, tcp = on_pty(lamp), on_tcp(lamp)
    assert lamp.control(do="set", values={"door": "OPEN", "flags.hot": True, "model": "it's"})["ok"] is False
    assert values(lamp)["door"] == "OPEN" and values(lamp)["model"] == "Lamp 3"
    assert pty.ask("FLG?", 2) == ["0004", "done"]
    assert tcp.ask("ON") == ["shut the door"]
    assert lamp.control(do="set", values={"door": "closed"})["ok"]
    assert tcp.ask("ON") == ["done"]
    assert pty.ask("LIT?", 2)[0] == "1"
    assert lamp.control(do="power-cycle")["ok"]
    assert pty.ask("LIT?", 2)[0] == "0"
    assert lamp.control(do="state")["refused"] == 1


def test_a_command_within_the_gap_is_not_heard(start_sim, tmp_path):
    hasty = LAMP.replace('ok_line = "done";', 'ok_line = "done"; gap_ms = 200;')
    lamp = start_sim("--profile", written(tmp_path, "lamp", hasty))
    port = on_tcp(lamp).port
    port.timeout = 0.1
    port.write(b"LIT?\rLIT?\rLIT?\r")
    assert port.read_until(b"done\r\n") == b"0\r\ndone\r\n"
    assert lamp.control(do="state")["too_early"] == 2

    def answer():
        port.write(b"WHO?\r")
        return port.read_until(b"done\r\n")

    heard = []
    wait_for(lambda: heard.append(answer()) or heard[-1])
    assert heard[-1] == b"Lamp 3\r\ndone\r\n"  # and nothing more of those


def test_wires_are_unplugged_mute_late_and_lose_replies(lamp):
    line = on_pty(lamp)
    poll = select.poll()
    poll.register(line.port.fileno(), select.POLLIN)
    assert lamp.control(do="unplug", wire="lamp")["ok"]
    assert poll.poll(1000 * PATIENCE_S)[0][1] & select.POLLHUP
    line.port.close()
    assert not (lamp.folder / "lamp").is_symlink()
    assert lamp.control(do="plug", wire="lamp")["ok"]
    line = on_pty(lamp)
    assert line.ask("WHO?", 2)[0] == "Lamp 3"
    port = port_of(lamp, "lamp-tcp")
    client = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
    client.sendall(b"WHO?\r")
    assert client.recv(1) == b"L"
    assert lamp.control(do="unplug", wire="lamp-tcp")["ok"]
    with pytest.raises(ConnectionError):
        while client.recv(100):
            pass
    assert lamp.control(do="plug", wire="lamp-tcp")["ok"]
    assert port_of(lamp, "lamp-tcp") == port
    assert lamp.control(do="set", wire="lamp", drop=1)["ok"]
    line.port.write(b"WHO?\r")
    wait_for(lambda: lamp.control(do="state")["wires"]["lamp"]["lost"] == 1)
    assert lamp.control(do="mute", wire="lamp")["ok"]
    line.port.write(b"ON\r")
    wait_for(lambda: values(lamp)["lit"] == 1)  # done, but not said
    assert lamp.control(do="unmute", wire="lamp")["ok"]
    assert lamp.control(do="set", wire="lamp", delay_ms=150)["ok"]
    before = time.monotonic()
    assert line.ask("LIT?", 2)[0] == "1"
    assert time.monotonic() - before >= 0.149


@pytest.mark.parametrize("question, says", [
    (dict(do="fly"), "state, values"),
    (dict(do="set"), "values, drop, delay_ms"),
    (dict(do="set", values={"dor": 1}), "no value 'dor'"),
    (dict(do="set", values={"lit": [1]}), "must be a number"),
    (dict(do="set", values={"door": "AJAR"}), "cannot be read"),
    (dict(do="set", values=3), "an object"),
    (dict(do="unplug", wire="axes"), "lamp, lamp-tcp"),
])
def test_the_control_socket_says_what_is_wrong(lamp, question, says):
    answer = lamp.control(**question)
    assert answer["ok"] is False and says in answer["error"], answer


# --- registers --------------------------------------------------------------------------------------


def mbpoll(sim, *arguments, rtu=True):
    where = ["-m", "rtu", "-b", 115200, "-P", "even"] if rtu else ["-m", "tcp", "-p", port_of(sim, "slide-tcp")]
    place = [sim.folder / "slide"] if rtu else ["127.0.0.1"]
    if "--" in arguments:  # values to write come after the place
        at = arguments.index("--")
        place += arguments[at:]
        arguments = arguments[:at]
    done = subprocess.run(["mbpoll", "-0", "-1", "-a", "5", *map(str, [*where, *arguments, *place])],
                          capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return [float(v) for v in re.findall(r"^\[\d+\]:\s+(-?[\d.]+)", done.stdout, re.M)]


@pytest.mark.parametrize("rtu", [True, False])
def test_mbpoll_reads_and_writes_all_tables(slide, rtu):
    assert mbpoll(slide, "-t", "4:int", "-B", "-r", 0x21, rtu=rtu) == [-100]
    assert mbpoll(slide, "-t", "3:float", "-B", "-r", 0x30, rtu=rtu) == [21.5]
    assert mbpoll(slide, "-t", "0", "-r", 4, rtu=rtu) == [0]
    mbpoll(slide, "-t", "0", "-r", 4, "--", 1, rtu=rtu)
    assert mbpoll(slide, "-t", "0", "-r", 4, rtu=rtu) == [1]
    assert slide.control(do="set", values={"door": True})["ok"]
    assert mbpoll(slide, "-t", "1", "-r", 7, rtu=rtu) == [1]
    mbpoll(slide, "-t", "4:int", "-B", "-r", 0x10, "--", -7000, rtu=rtu)
    assert values(slide)["target"] == -7000


def words(value):
    return [value >> 16 & 0xFFFF, value & 0xFFFF]


def pymodbus_client(sim, rtu):
    # strict would set the line a second time, and asking a pty for parity twice is EINVAL
    client = (ModbusSerialClient(str(sim.folder / "slide"), baudrate=115200, parity="E", timeout=2, strict=False)
              if rtu else ModbusTcpClient("127.0.0.1", port=port_of(sim, "slide-tcp"), timeout=2))
    assert client.connect()
    return client


@pytest.mark.parametrize("rtu", [True, False])
def test_pymodbus_moves_and_stops_the_slide(slide, rtu):
    client = pymodbus_client(slide, rtu)

    def read(address, count):
        answer = client.read_holding_registers(address, count, slave=5)
        assert not answer.isError(), answer
        return answer.registers

    def write(address, *registers):
        return client.write_registers(address, list(registers), slave=5)

    began = time.monotonic()
    assert not write(0x10, *words(900), *words(5000), 1).isError()
    assert read(0x14, 1) == [0]  # the trigger is taken back
    wait_for(lambda: read(0x20, 1) == [0])
    assert time.monotonic() - began >= 0.2  # 1000 steps at 5000 a second
    assert read(0x21, 2) == words(900)
    assert not write(0x10, *words(-9000), *words(1), 1).isError()
    assert read(0x20, 1) == [1]
    assert not write(0x15, 8).isError()  # stop
    assert read(0x20, 1) == [0]
    assert write(0x10, *words(9001), *words(1), 1).exception_code == 3
    assert write(0x20, 1).exception_code == 2
    assert client.read_holding_registers(0x40, 1, slave=5).exception_code == 2
    assert slide.control(do="set", values={"door": 1})["ok"]
    assert write(0x10, *words(0), *words(1), 1).exception_code == 4
    client.close()


# --- the programs -----------------------------------------------------------------------------------


def test_gonio_profile_sim_says_how_to_reach_it_and_ends_with_ctrl_c(tmp_path):
    file = written(tmp_path, "lamp", LAMP)
    runtime = tmp_path / "run"
    runtime.mkdir()
    sim = Program([BUILD / "gonio", "profile", "sim", file], tmp_path / "log", {"XDG_RUNTIME_DIR": str(runtime)})
    sim.wait_line("ready")
    link = next(line for line in sim.said if line.startswith("serial:"))
    assert link.startswith(f"serial:{runtime}/goniosim-") and link.endswith("/lamp?baud=19200")
    host, port = next(line for line in sim.said if line.startswith("tcp:"))[4:].split(":")
    with serial.Serial(link[7:].split("?")[0], 19200, timeout=PATIENCE_S) as pty:
        pty.write(b"WHO?\r")
        assert pty.read_until(b"done\r\n") == b"Lamp 3\r\ndone\r\n"
    with socket.create_connection((host, int(port)), PATIENCE_S) as tcp:
        tcp.sendall(b"LIT?\r")
        assert tcp.recv(1) == b"0"
    assert sim.end(signal.SIGINT) == 0
    assert list(runtime.iterdir()) == []


def test_a_profile_is_found_by_its_name(tmp_path):
    written(tmp_path, "lamp", LAMP)
    with_run = Program([BUILD / "goniosim", "--profile", "lamp", "--run-dir", tmp_path / "run"], tmp_path / "log",
                       {"GONIO_PROFILES": str(tmp_path)})
    with_run.wait_line("ready")
    assert with_run.end() == 0
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", PROFILES)
def test_every_profile_is_served(start_sim, name):
    sim = start_sim("--profile", ROOT / "configs" / "profiles" / f"{name}.cfg")
    wires = sim.control(do="state")["wires"]
    assert set(wires) == {name, f"{name}-tcp"} and all(w["plugged"] for w in wires.values())
    known = {k: v for k, v in values(sim).items() if v is not None}
    assert known
    assert sim.control(do="set", values=known)["ok"]
    assert sim.end() == 0


@pytest.mark.parametrize("text, arguments, says", [
    (LAMP.replace('type = "hex"', 'type = "hexe"'), [], r"lamp.cfg:9: .*hexe"),
    (LAMP.replace('then = "lit = 1"', 'then = "lit = bright"'), [], "lit = bright"),
    (LAMP, ["--seed", "3"], "--seed"),
    (LAMP, ["--unit", "300"], "247"),
], ids=["type", "then", "seed", "unit"])
def test_what_cannot_be_served_is_refused(tmp_path, text, arguments, says):
    done = subprocess.run([BUILD / "goniosim", "--profile", written(tmp_path, "lamp", text), *arguments],
                          capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                          env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)})
    assert done.returncode == 2 and re.search(says, done.stderr), done.stderr
    assert not list(tmp_path.glob("goniosim-*"))


def test_gonio_profile_sim_needs_a_profile():
    done = gonio("profile", "sim")
    assert done.returncode == 2 and "PROFILE" in done.stderr


def test_goniosim_runs_without_the_drivers_libraries():
    needed = subprocess.run(["ldd", BUILD / "goniosim"], capture_output=True, text=True, check=True).stdout
    assert "libjansson" in needed
    assert not re.search("modbus|serialport|usb", needed), needed
