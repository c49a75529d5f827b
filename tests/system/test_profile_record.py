# SPDX-License-Identifier: MIT
"""gonio profile record: a simulated instrument of each shipped profile is recorded, what was recorded is pasted into
the profile, and gonio profile check passes; and everything that can go wrong on the way."""
import os
import re
import shutil
import signal
import socket
import subprocess
import threading
import time

import pytest

from conftest import BUILD, PATIENCE_S, ROOT, gonio, wait_for
from test_usbtmc import Usb, preload

PROFILES = sorted((ROOT / "configs" / "profiles").glob("*.cfg"))

METER = r"""
profile: { name = "meter"; title = "A meter"; role = "detector"; protocol = "message"; source = "this test"; };
values: (
  { name = "x"; unit = "V"; min = -5; max = 5; },
  { name = "gain"; type = "int"; min = 1; max = 9; },
  { name = "model"; type = "string"; } );
framing: { end_out = "\r"; end_in = "\r\n"; timeout_ms = 100; quiet_ms = 100; };
exchanges: (
  { name = "model"; send = "WHO?"; answer = "{model}"; },
  { name = "x"; send = "X?"; answer = "{x:.3f} V"; },
  { name = "gain"; send = "G?"; answer = "{gain}"; },
  { name = "set_gain"; send = "G {gain}"; answer = "OK"; verify = "gain"; },
  { name = "reset"; send = "RST"; answer = "OK"; then = "gain = 1"; } );
refusals: ( { like = "what?*"; } );
identify: { asks = ( "model" ); title = "{model}"; };
detector: { signal = "x"; sample = ( "x" ); full_scale = "gain"; ranges = [ 1.0 ]; read_range = ( "gain" ); };
simulate: { start = ( { value = "model"; is = "Meter \"3\", a\\b"; }, { value = "x"; is = "1.5"; },
                      { value = "gain"; is = "2"; } );
            deny = ( { answer = "what? (no)"; } ); };
"""


def written(folder, text=METER, name="meter"):
    file = folder / f"{name}.cfg"
    file.write_text(text)
    return file


def link_to(sim, name, modbus=False):
    return f"{'modbus-rtu' if modbus else 'serial'}:{sim.folder / name}"


def tcp_link(sim, name, modbus=False):
    address = sim.control(do="state")["wires"][f"{name}-tcp"]["address"]
    return f"{'modbus-tcp' if modbus else 'tcp'}:127.0.0.1:{address.rsplit(':', 1)[1]}"


def pasted(profile, recording, folder):
    """A copy of the profile with what was recorded, as its first lines say."""
    text = profile.read_text()
    if "right behind" in recording:
        assert text.count("golden: (") == 1
        text = text.replace("golden: (", "golden: (\n" + recording, 1)
    else:
        assert "golden: (" not in text
        text += recording
    folder.mkdir(exist_ok=True)
    copy = folder / profile.name
    copy.write_text(text)
    return copy


def entries(recording):
    return recording.count('source = "recorded ')


def comments(recording):
    return [line.strip() for line in recording.splitlines() if line.startswith("  #")]


# --- round trip -------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", ["pty", "tcp"])
@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.stem)
def test_what_is_recorded_passes_when_it_is_pasted(start_sim, tmp_path, profile, wire):
    modbus = 'protocol = "modbus"' in profile.read_text()
    sim = start_sim("--profile", profile, "--fast")
    link = tcp_link(sim, profile.stem, modbus) if wire == "tcp" else link_to(sim, profile.stem, modbus)
    out = tmp_path / "recording"
    r = gonio("profile", "record", profile, link, "--out", out)
    recording = out.read_text()
    assert r.returncode == 0, r.stderr + recording
    assert r.stdout == "" and "no entry" not in recording and "failed" not in recording
    count = entries(recording)
    assert count >= 4 and f"\n{count} entries\n" in r.stderr
    assert re.search(r'source = "recorded \d{4}-\d\d-\d\d with gonio \S+ from .+"; }', recording)
    check = gonio("profile", "check", pasted(profile, recording, tmp_path / "pasted"))
    assert check.returncode == 0 and check.stderr == "", check.stderr
    before = gonio("profile", "check", profile)
    shipped = int(re.search(r"golden +(\d+) of", before.stdout).group(1))
    assert f"golden      {shipped + count} of {shipped + count} entries pass\n" in check.stdout


def test_a_tampered_byte_is_found(start_sim, tmp_path):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    r = gonio("profile", "record", meter, link_to(sim, "meter"))
    assert r.returncode == 0 and 'sent = "X?"; received = "1.500 V";\n    gives = "x = 1.5";' in r.stdout
    sent = pasted(meter, r.stdout.replace('sent = "X?"', 'sent = "X!"'), tmp_path / "sent")
    check = gonio("profile", "check", sent)
    assert check.returncode == 2
    assert re.search(r"golden\[\d\] \(x\): sent: got X\?\\r / expected X!\\r / at byte 1\n", check.stderr)
    received = pasted(meter, r.stdout.replace("1.500 V", "1.600 V"), tmp_path / "received")
    check = gonio("profile", "check", received)
    assert check.returncode == 2 and "(x): x: got 1.6 / expected 1.5\n" in check.stderr


def test_a_tampered_frame_is_found(start_sim, tmp_path):
    profile = ROOT / "configs" / "profiles" / "oriental-az.cfg"
    sim = start_sim("--profile", profile, "--unit", "7")
    r = gonio("profile", "record", profile, link_to(sim, "oriental-az", True), "--unit", "7")
    assert r.returncode == 0 and 'sent = "07 03 00 CC 00 02 ' in r.stdout
    bad = pasted(profile, r.stdout.replace("07 03 00 CC", "07 03 00 CD"), tmp_path / "bad")
    check = gonio("profile", "check", bad)
    assert check.returncode == 2 and re.search(r"got 07 03 00 CC .* / expected 07 03 00 CD .* / at byte 3\n", check.stderr)


USB_METER = r"""
profile: { name = "usb-meter"; title = "A USB meter"; role = "inputs"; protocol = "message"; source = "this test"; };
values: ( { name = "model"; type = "string"; }, { name = "serial"; type = "string"; }, { name = "power_w"; unit = "W"; } );
framing: { end_out = "\n"; end_in = "\n"; };
exchanges: ( { name = "identity"; send = "*IDN?"; answer = "Thorlabs,{model},{serial},{}"; },
             { name = "power"; send = "MEAS:POW?"; answer = "{power_w}"; } );
identify: { asks = ( "identity" ); title = "Thorlabs {model}, serial {serial}"; };
inputs: { status = ( "power" ); };
"""


@pytest.mark.skipif(not shutil.which("umockdev-wrapper") or not (BUILD / "tests/usbsim").exists(),
                    reason="umockdev is not installed")
def test_a_usb_instrument_is_recorded(tmp_path):
    meter = written(tmp_path, USB_METER, "usb-meter")
    usb = Usb(tmp_path)
    try:
        usb.tell("plug 0 1 2")
        env = {"LD_PRELOAD": preload(BUILD / "gonio"), **usb.env}
        r = gonio("profile", "record", meter, "usbtmc:1313:8072", env=env)
    finally:
        usb.close()
    assert r.returncode == 0, r.stderr
    assert "  # *IDN?\\n -> Thorlabs,PM100USB,P0000001,1.4.0\\n\n" in r.stdout
    assert 'from Thorlabs PM100USB, serial P0000001"' in r.stdout
    assert re.search(r'does = "power"; sent = "MEAS:POW\?"; received = "[^"]+";\n    gives = "power_w = ', r.stdout)
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


# --- setting and doing ------------------------------------------------------------------------------


def test_what_is_set_is_recorded_with_its_read_back(start_sim, tmp_path):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--set", "gain=5", "--do", "reset", "--do=G 9")
    assert r.returncode == 2 and "'G 9'" in r.stderr and r.stdout == ""
    assert sim.control(do="values")["values"]["gain"] == 2  # nothing was sent before all were checked
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--set", "gain=5", "--do", "reset")
    assert r.returncode == 0, r.stderr
    assert '{ does = "set_gain"; with = "gain = 5"; sent = "G 5"; received = "OK";' in r.stdout
    assert 'does = "gain"; sent = "G?"; received = "5";' in r.stdout and 'sent = "RST"' in r.stdout
    assert sim.control(do="values")["values"]["gain"] == 1
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


def test_nothing_is_told_without_a_name(start_sim, tmp_path):
    for profile in PROFILES:
        sim = start_sim("--profile", profile, "--fast", folder=tmp_path / profile.stem)
        modbus = 'protocol = "modbus"' in profile.read_text()
        before = sim.control(do="values")["values"]
        r = gonio("profile", "record", profile, link_to(sim, profile.stem, modbus))
        assert r.returncode == 0, r.stderr
        after = sim.control(do="values")["values"]
        told = {name for name in before if before[name] != after.get(name)}
        # time stamps go on, and event registers are cleared by reading
        assert told <= {"time_s", "esr", "lias"}, (profile.stem, told)


def test_an_axis_moves_only_when_it_is_named(start_sim, tmp_path):
    profile = ROOT / "configs" / "profiles" / "oriental-az.cfg"
    sim = start_sim("--profile", profile)
    link = link_to(sim, "oriental-az", True)
    r = gonio("profile", "record", profile, link, "--do", "move: position = 120, speed = 5000, acceleration = 9000",
              "--do", "stop", "--do", "home")
    assert r.returncode == 0, r.stderr
    assert 'with = " position = 120, speed = 5000, acceleration = 9000";' in r.stdout
    assert {"move", "stop", "home"} <= set(re.findall(r'does = "(\w+)"', r.stdout))
    assert int(sim.control(do="values")["values"]["output"]) & 1 << 4  # it went home
    check = gonio("profile", "check", pasted(profile, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


@pytest.mark.parametrize("name, on", [("cobolt-05", "on"), ("cobolt-05", "start"), ("coherent-obis", None),
                                      ("laser-quantum", None)])
def test_on_is_refused_before_anything_is_sent(start_sim, name, on):
    profile = ROOT / "configs" / "profiles" / f"{name}.cfg"
    sim = start_sim("--profile", profile, "--fast")
    text = profile.read_text()
    ons = [on] if on else re.findall(r'send = "(\w+)"', re.search(r"\n  on = \((.*?)\);", text, re.S).group(1))
    assert ons
    for word in ons:
        r = gonio("profile", "record", profile, link_to(sim, name), "--do", word)
        assert r.returncode == 4 and f"{word} switches emission on" in r.stderr and r.stdout == ""
        assert sim.control(do="state")["wires"][name].get("requests", 0) == 0
        r = gonio("profile", "record", profile, link_to(sim, name), "--interactive", stdin=f"{word}\nemission\n")
        assert r.returncode == 4 and f"{word} switches emission on" in r.stderr
        assert f'does = "{word}"' not in r.stdout
    values = sim.control(do="values")["values"]
    assert str(values.get("emission", values.get("enabled"))) in ("0", "0.0", "OFF", "DISABLED"), values


def test_a_disguised_on_is_refused(tmp_path):
    text = (ROOT / "configs" / "profiles" / "cobolt-05.cfg").read_text()
    text = text.replace('  { name = "off";', '  { name = "twin"; send = "l1"; answer = "OK"; },\n'
                        '  { name = "raw"; send = "l{emission}"; answer = "OK"; },\n'
                        '  { name = "later"; send = "lx"; answer = "OK"; then = "emission = 1"; },\n'
                        '  { name = "off";', 1)
    profile = written(tmp_path, text, "cobolt-05")
    for step in (["--do", "twin"], ["--set", "emission=1"], ["--do", "raw: emission = 1"], ["--do", "later"]):
        r = gonio("profile", "record", profile, f"serial:{tmp_path}/nobody", *step)
        assert r.returncode == 4, (step, r.stderr)
    r = gonio("profile", "record", profile, f"serial:{tmp_path}/nobody", "--set", "emission=0")
    assert r.returncode == 1 and "nobody" in r.stderr  # allowed, but there is no such port


# --- line by line -----------------------------------------------------------------------------------


def test_lines_are_run_one_after_another(start_sim, tmp_path):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    lines = "# a remark\n\nx\ngain = 7\ngain, x\nreset\n"
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--interactive", stdin=lines)
    assert r.returncode == 0, r.stderr
    assert re.findall(r'does = "(\w+)"', r.stdout) == ["model", "x", "set_gain", "gain", "reset"]
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--interactive", stdin="x\nxx\nx?\ngain = 10\nx")
    assert r.returncode == 2 and r.stderr.count("gonio: profile record:") == 3
    assert re.findall(r'does = "(\w+)"', r.stdout) == ["model", "x"]


@pytest.mark.parametrize("line, says", [("x" + " " * 600 + "y\n", "longer than 511 bytes"), ("x\0y\n", "zero byte"),
                                        ("set: x = " + "0" * 600 + "7\n", "longer than 511 bytes")])
def test_a_line_is_not_done_in_part(start_sim, tmp_path, line, says):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--interactive", stdin=line)
    assert r.returncode == 2 and says in r.stderr and entries(r.stdout) == 1, r


@pytest.mark.parametrize("closed", [False, True])
def test_an_input_that_cannot_be_read_is_said(start_sim, tmp_path, closed):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    argv = [BUILD / "gonio", "profile", "record", meter, link_to(sim, "meter"), "--interactive"]
    folder = os.open(tmp_path, os.O_RDONLY)
    try:
        r = subprocess.run(argv, stdin=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                           preexec_fn=(lambda: os.close(0)) if closed else None)
    finally:
        os.close(folder)
    assert r.returncode == 2 and "standard input: " in r.stderr, r.stderr


def test_a_line_is_recorded_when_it_was_typed(start_sim, tmp_path):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    out = tmp_path / "recording"
    with subprocess.Popen([BUILD / "gonio", "profile", "record", meter, link_to(sim, "meter"), "--interactive",
                           "--out", out], stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as p:
        p.stdin.write("x\n")
        p.stdin.flush()
        wait_for(lambda: out.exists() and 'does = "x"' in out.read_text())
        p.send_signal(signal.SIGINT)
        assert p.wait(PATIENCE_S) == 130
        assert out.read_text().endswith(");\n")
    check = gonio("profile", "check", pasted(meter, out.read_text(), tmp_path / "p"))
    assert check.returncode == 0, check.stderr


# --- what goes wrong --------------------------------------------------------------------------------


HANG_UP = b"<hangs up>"


class Instrument:
    """A meter over TCP that answers as a dict of bytes says; b"" hangs up, None is silence, a function is called."""

    def __init__(self, answers):
        self.answers, self.asked = answers, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(PATIENCE_S)
        self.link = f"tcp:127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        with self.listener, self.listener.accept()[0] as c, c.makefile("rb", buffering=0) as lines:
            line = b""
            while byte := lines.read(1):
                line += byte
                if byte != b"\r":
                    continue
                self.asked.append(line[:-1])
                answer = self.answers.get(line[:-1])
                line = b""
                if callable(answer):
                    answer = answer()
                if answer == b"":
                    return
                if answer:
                    c.sendall(answer.removesuffix(HANG_UP))
                    if answer.endswith(HANG_UP):
                        return


GOOD = {b"WHO?": b"Meter 3\r\n", b"X?": b"1.500 V\r\n", b"G?": b"2\r\n"}


@pytest.mark.parametrize("answer, says", [
    (None, r"X\?\\r -> nothing: no answer"),
    (b"1,5 V\r\n", r"X\?\\r -> 1,5 V\\r\\n: .+"),
    (b"7.000 V\r\n", r"X\?\\r -> 7.000 V\\r\\n: .*5"),
    (b"1.500", r"X\?\\r -> 1.500: .+"),
    (b"\xff\x80\x07\r\n", r"X\?\\r -> \\xff\\x80\\x07\\r\\n: .+"),
], ids=["silence", "misfit", "range", "broken-off", "garbage"])
def test_a_failure_is_a_comment_with_what_came(tmp_path, answer, says):
    meter = written(tmp_path)
    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": answer}).link)
    assert r.returncode == 1 and "1 of the questions failed" in r.stderr
    assert any(re.match(f"# no entry: {says}", c) for c in comments(r.stdout)), r.stdout
    assert any(c.startswith("# x failed: tcp:") for c in comments(r.stdout))
    assert re.findall(r'does = "(\w+)"', r.stdout) == ["model", "gain"]
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


@pytest.mark.parametrize("answer", [b"1.5", b"1.500 V", b"1.500 V\r"])
def test_an_answer_that_was_broken_off_is_no_entry(tmp_path, answer):
    """Its beginning may fit the pattern, and is another number."""
    meter = written(tmp_path)
    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": lambda: answer + HANG_UP}).link)
    assert r.returncode == 1
    assert re.findall(r'does = "(\w+)"', r.stdout) == ["model"], r.stdout
    assert any("broken off" in c for c in comments(r.stdout)), r.stdout


def test_a_retry_loses_nothing(tmp_path):
    meter = written(tmp_path)
    answers = iter([b"1,5 V\r\n"])
    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": lambda: next(answers, b"1.500 V\r\n")}).link)
    assert r.returncode == 0, r.stderr
    assert any("# no entry: X?\\r -> 1,5 V\\r\\n: " in c for c in comments(r.stdout))
    assert 'does = "x"; sent = "X?"; received = "1.500 V";' in r.stdout


def test_an_answer_that_comes_too_late_is_seen(tmp_path):
    meter = written(tmp_path, METER.replace("timeout_ms = 100; quiet_ms = 100", "timeout_ms = 500; quiet_ms = 1000"))
    late = iter([b"1.400 V\r\n"])

    def answer():
        said = next(late, None)
        if said:
            time.sleep(0.9)  # after its 500 ms, and before the line was silent for 1000 ms
        return said or b"1.500 V\r\n"

    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": answer}).link)
    assert r.returncode == 0, r.stderr
    assert "  # X?\\r -> 1.400 V\\r\\n\n" in r.stdout and "  # X?\\r -> 1.500 V\\r\\n\n" in r.stdout


def test_an_error_reply_is_an_entry(tmp_path):
    meter = written(tmp_path)
    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": b'what? "X" \r\n'}).link)
    assert r.returncode == 1 and "refuses 'X?'" in r.stderr
    assert "# X?\\r -> what? \"X\" \\r\\n" in r.stdout
    assert 'does = "x"; sent = "X?"; received = "what? \\"X\\" ";\n    source' in r.stdout
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


def test_an_exception_is_an_entry(start_sim, tmp_path):
    slide = written(tmp_path, r"""
profile: { name = "slide"; title = "A slide"; role = "inputs"; protocol = "modbus"; source = "this test"; };
values: ( { name = "a"; type = "int"; address = 0x10; access = "rw"; max = 9; },
          { name = "lamp"; type = "int"; address = 4; table = "coil"; max = 1; },
          { name = "door"; type = "int"; address = 7; table = "discrete"; access = "r"; max = 1; },
          { name = "celsius"; address = 0x30; format = "f32"; access = "r"; table = "input"; } );
writes: ( { name = "set_a"; set = ( "a" ); readback = true; }, { name = "light"; set = ( "lamp" ); } );
inputs: { status = ( "a" ); };
simulate: { start = ( { value = "celsius"; is = "21.5"; }, { value = "door"; is = "1"; } );
            deny = ( { does = "set_a"; when = "lamp = 1"; answer = "4"; } ); };
""", "slide")
    sim = start_sim("--profile", slide)
    for wire in (link_to, tcp_link):
        steps = ["--set", "a=3", "--set", "lamp=1", "--set", "a=4", "--set", "lamp=0"]
        r = gonio("profile", "record", slide, wire(sim, "slide", True), *steps)
        assert r.returncode == 1 and "exception 4" in r.stderr, r.stderr
        assert 'with = "a=4";\n    sent = "01 10 00 10 00 01 02 00 04 ' in r.stdout
        assert 'received = "01 90 04 4D C3";' in r.stdout
        assert 'gives = "celsius = 21.5";' in r.stdout and 'gives = "door = 1";' in r.stdout
        if wire is tcp_link:  # the frames as they went, with their headers
            assert any(re.match(r"# .. .. 00 00 00 06 01 04 00 30 00 02 -> .. .. 00 00 00 07 01 04 04 41 AC 00 00$", c)
                       for c in comments(r.stdout)), r.stdout
        check = gonio("profile", "check", pasted(slide, r.stdout, tmp_path / wire.__name__))
        assert check.returncode == 0, check.stderr


def test_a_unit_that_is_not_there(start_sim):
    profile = ROOT / "configs" / "profiles" / "oriental-az.cfg"
    sim = start_sim("--profile", profile)
    r = gonio("profile", "record", profile, link_to(sim, "oriental-az", True), "--unit", "3")
    assert r.returncode == 1 and "unit 3 does not answer" in r.stderr
    assert any(re.match(r"# no entry: 03 03 00 7E 00 04 .. .. -> nothing: no answer", c) for c in comments(r.stdout))
    assert not any(c.startswith("# no entry: 03 03 00 58") for c in comments(r.stdout))  # nothing else is asked


def test_another_instrument_is_asked_nothing_else(tmp_path):
    meter = written(tmp_path, METER.replace('title = "{model}"', """title = "{model}";
  refuse = ( { when = "model ~ 'Laser*'"; text = "is no meter"; } )"""))
    laser = Instrument({**GOOD, b"WHO?": b"Laser 3\r\n"})
    r = gonio("profile", "record", meter, laser.link, "--do", "reset")
    assert r.returncode == 1 and "is no meter" in r.stderr and laser.asked == [b"WHO?"]
    laser = Instrument({**GOOD, b"WHO?": b"Laser 3\r\n"})
    r = gonio("profile", "record", meter, laser.link, "--interactive", stdin="x\n")
    assert r.returncode == 1 and re.findall(r'does = "(\w+)"', r.stdout) == ["model", "x"]


def test_an_instrument_that_is_unplugged_in_the_middle(tmp_path):
    meter = written(tmp_path)
    r = gonio("profile", "record", meter, Instrument({**GOOD, b"X?": b""}).link)
    assert r.returncode == 1 and "the connection is broken" in r.stderr
    assert re.findall(r'does = "(\w+)"', r.stdout) == ["model"] and r.stdout.endswith(");\n")
    assert any(c.startswith("# no entry: X?\\r -> nothing") for c in comments(r.stdout))
    check = gonio("profile", "check", pasted(meter, r.stdout, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


def test_a_pty_that_is_unplugged_in_the_middle(start_sim, tmp_path):
    profile = ROOT / "configs" / "profiles" / "oriental-az.cfg"
    sim = start_sim("--profile", profile)
    with subprocess.Popen([BUILD / "gonio", "profile", "record", profile, link_to(sim, "oriental-az", True),
                           "--interactive", "--out", tmp_path / "r"], stdin=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True) as p:
        wait_for(lambda: (tmp_path / "r").exists() and "alarm_code" in (tmp_path / "r").read_text())
        assert sim.control(do="unplug", wire="oriental-az")["ok"]
        said = p.communicate("position\nto\n", PATIENCE_S)[1]
        assert p.returncode == 1 and said.count("hung up") + said.count("unplugged") >= 1, said
    recording = (tmp_path / "r").read_text()
    assert entries(recording) == 1 and recording.endswith(");\n")
    check = gonio("profile", "check", pasted(profile, recording, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


def test_ctrl_c_writes_what_was_recorded(tmp_path):
    meter = written(tmp_path, METER.replace("_ms = 100", "_ms = 5000"))
    instrument, out = Instrument({**GOOD, b"G?": None}), tmp_path / "r"
    with subprocess.Popen([BUILD / "gonio", "profile", "record", meter, instrument.link, "--out", out],
                          stderr=subprocess.PIPE, text=True) as p:
        wait_for(lambda: b"G?" in instrument.asked)
        begin = time.monotonic()
        p.send_signal(signal.SIGINT)
        assert p.wait(PATIENCE_S) == 130
        assert time.monotonic() - begin < 4.0  # not at the end of its patience of 5 s
    recording = out.read_text()
    assert re.findall(r'does = "(\w+)"', recording) == ["model", "x"]
    assert any(c.startswith("# no entry: G?\\r -> nothing") for c in comments(recording))
    check = gonio("profile", "check", pasted(meter, recording, tmp_path / "p"))
    assert check.returncode == 0, check.stderr


def test_ctrl_c_need_not_wait_until_a_setting_has_settled(tmp_path):
    meter = written(tmp_path, METER.replace('verify = "gain"', 'verify = "gain"; settle_ms = 60000'))
    instrument, out = Instrument({**GOOD, b"G 5": b"OK\r\n"}), tmp_path / "r"
    with subprocess.Popen([BUILD / "gonio", "profile", "record", meter, instrument.link, "--out", out, "--set", "gain=5"],
                          stderr=subprocess.PIPE, text=True) as p:
        wait_for(lambda: b"G 5" in instrument.asked)
        p.send_signal(signal.SIGINT)
        assert p.wait(PATIENCE_S) == 130
    assert "  # no entry: G 5\\r -> " in out.read_text() or 'does = "set_gain"' in out.read_text()


def test_a_recording_is_not_written_over(start_sim, tmp_path):
    meter = written(tmp_path)
    sim = start_sim("--profile", meter)
    out = written(tmp_path, "dear", "r")
    r = gonio("profile", "record", meter, link_to(sim, "meter"), "--out", out)
    assert r.returncode == 2 and "is there" in r.stderr and out.read_text() == "dear"


@pytest.mark.parametrize("arguments, status, says", [
    (["meter.cfg"], 2, "PROFILE LINK"),
    (["meter.cfg", "seriel:/dev/x"], 2, "seriel"),
    (["meter.cfg", "modbus-rtu:/dev/x"], 2, "serial:"),
    (["meter.cfg", "serial:nobody"], 1, "nobody"),
    (["meter.cfg", "serial:nobody", "--set", "y=1"], 2, "no value 'y'"),
    (["meter.cfg", "serial:nobody", "--set", "x=1"], 2, "nothing in profile meter sets x"),
    (["meter.cfg", "serial:nobody", "--set", "gain=maybe"], 2, "maybe"),
    (["meter.cfg", "serial:nobody", "--do", "gain"], 1, "nobody"),
    (["meter.cfg", "serial:nobody", "--do", "jump"], 2, "no exchange 'jump'"),
    (["meter.cfg", "serial:nobody", "--interactive", "--do", "x"], 2, "--interactive"),
    (["meter.cfg", "serial:nobody", "--unit", "300"], 2, "247"),
])
def test_wrong_arguments(tmp_path, arguments, status, says):
    written(tmp_path)
    r = gonio("profile", "record", *arguments, cwd=tmp_path)
    assert r.returncode == status and says in r.stderr and r.stdout == "", r.stderr
    assert os.listdir(tmp_path) == ["meter.cfg"]
