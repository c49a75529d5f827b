# SPDX-License-Identifier: MIT
"""USBTMC by the real libusb: simulated power meters (tests/usb/usbsim) on nodes of umockdev, asked by gonio's own link
(tests/usb/linkask), by gonio's driver, and by pyvisa-py, which knows nothing of gonio."""
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from conftest import BUILD, QUICK_LASER, ROOT, wait_for
from mockbus import METER, PRELOAD, Usb, needs_umockdev, preload

IDENTITY = "Thorlabs,PM100USB,P0000001,1.4.0"

pytestmark = needs_umockdev


@pytest.fixture
def usb(tmp_path):
    bus = Usb(tmp_path)
    yield bus
    bus.close()


@pytest.fixture
def meter(usb):
    usb.tell("plug 0 1 2")
    return usb.open()


def value(said):
    """Which measurement an answer was."""
    number = re.match(r"ok (\S+) \(", said)
    assert number, said
    return round((float(number.group(1)) - 1e-3) * 1e9)


def milliseconds(said):
    return float(re.search(r"\((\S+) ms\)$", said).group(1))


ABORT_IN, CLEAR, REMOTE = 3, 5, 160


def test_a_meter_is_identified_and_read(usb, meter):
    assert meter.ask("ask *IDN?").startswith(f"ok {IDENTITY} ")
    assert [value(meter.ask("ask MEAS:POW?")) for _ in range(20)] == list(range(1, 21))
    assert meter.ask("send SENS:CORR:WAV 1550").startswith("ok")
    assert meter.ask("ask SENS:CORR:WAV?").startswith("ok 1.5500E+03")
    assert meter.ask("ask SYST:ERR?").startswith('ok 0,"No error"')
    assert (usb.seen(REMOTE), usb.seen(CLEAR), usb.seen(ABORT_IN)) == (1, 1, 0)


def test_a_long_answer_comes_whole(meter):
    for size in (51, 52, 53, 4096, 5000):
        said = meter.ask(f"bytes LONG? {size}")
        text = bytes(ord("a") + i % 26 for i in range(size - 1)) + b"\n"
        assert said.startswith(f"ok {size} {crc32c(text):08x} "), said


def crc32c(data):
    crc = 0xffffffff
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82f63b78 if crc & 1 else 0)
    return crc ^ 0xffffffff


@pytest.mark.parametrize("fault, said, aborts", [
    ("stall_in", "refused by the device (stall)", 0),
    ("stall_out", "refused by the device (stall)", 0),
    ("wrong_tag", "the answer to another question (wrong tag)", 1),
    ("wrong_complement", "the answer to another question (wrong tag)", 1),
    ("huge", "an answer of an impossible size", 1),
    ("small", "an answer of an impossible size", 1),
    ("deaf", "no answer in 500 ms", 1),
])
def test_a_fault_is_reported_and_mended(usb, meter, fault, said, aborts):
    usb.tell(f"fault 0 {fault} 1")
    answer = meter.ask("ask MEAS:POW?")
    assert answer.startswith("error link ") and said in answer, answer
    again = value(meter.ask("ask MEAS:POW?"))
    assert value(meter.ask("ask MEAS:POW?")) == again + 1
    assert (usb.seen(ABORT_IN), usb.seen(CLEAR)) == (aborts, 2)


def test_short_packets_and_split_answers_are_put_together(usb, meter):
    for fault in ("short", "split"):
        usb.tell(f"fault 0 {fault} 1")
        assert meter.ask("ask *IDN?").startswith(f"ok {IDENTITY} ")
    assert usb.seen(CLEAR) == 1


def test_a_query_can_be_cancelled(usb, meter):
    usb.tell("delay 0 400")
    answer = meter.ask("stop 100 MEAS:POW?")
    print(answer)
    assert answer.startswith("error canceled ") and 95 < milliseconds(answer) < 300, answer
    assert value(meter.ask("ask MEAS:POW?")) == 2


def test_a_long_wait_gives_the_clock_its_turn(usb, meter):
    usb.tell("mute 0 1")
    assert milliseconds(meter.ask("ask MEAS:POW?")) >= 500
    longest = float(re.match(r"ok (\S+) ", meter.ask("turns")).group(1))
    print("longest without a turn:", longest, "ms")
    assert 45 < longest < 200  # slices of 50 ms, and a loaded machine


def test_a_late_answer_is_not_taken_for_the_next(usb, meter):
    usb.tell("delay 0 700")
    answer = meter.ask("ask MEAS:POW?")
    assert "no answer in 500 ms" in answer and milliseconds(answer) < 600, answer
    assert value(meter.ask("ask MEAS:POW?")) == 2
    assert value(meter.ask("ask MEAS:POW?")) == 3


def test_clearing_that_is_pending_is_waited_for(usb, meter):
    usb.tell("fault 0 deaf 1")
    assert "no answer" in meter.ask("ask MEAS:POW?")
    usb.tell("fault 0 pending 5")
    assert value(meter.ask("ask MEAS:POW?")) == 1
    usb.tell("fault 0 deaf 1")
    assert "no answer" in meter.ask("ask MEAS:POW?")
    usb.tell("fault 0 pending 1000")
    assert meter.ask("ask MEAS:POW?").startswith("error device ")
    usb.tell("fault 0 pending 0")
    assert value(meter.ask("ask MEAS:POW?")) == 2


def test_unplugging_in_mid_query_is_reported_at_once(usb, meter):
    usb.tell("mute 0 1")
    usb.tell("after 100 unplug 0")
    answer = meter.ask("ask MEAS:POW?")
    print(answer)
    assert answer.startswith("error gone ") and "unplugged" in answer, answer
    assert milliseconds(answer) < 300
    assert "not open since it hung up" in meter.ask("ask MEAS:POW?")
    assert "no such device" in meter.ask("reopen")


def test_the_device_is_found_again_by_its_serial_number(usb, meter):
    assert value(meter.ask("ask MEAS:POW?")) == 1
    usb.tell("unplug 0")
    assert meter.ask("ask MEAS:POW?").startswith("error gone ")
    usb.tell("plug 1 1 3")  # another meter takes its place
    answer = meter.ask("reopen")
    assert answer.startswith("error gone ") and "no device with the serial 'P0000001'" in answer, answer
    usb.tell("plug 0 3 77")
    assert meter.ask("reopen").startswith("ok")
    assert value(meter.ask("ask MEAS:POW?")) == 2


def test_of_two_devices_the_serial_number_chooses(usb):
    usb.tell("plug 0 1 2")
    usb.tell("plug 1 2 3")
    _, said = usb.link()
    assert "give the serial: " in said and f"{METER}:P0000001" in said and f"{METER}:P0000002" in said, said
    assert usb.open(f"{METER}:P0000002").ask("ask *IDN?").startswith("ok ")
    _, said = usb.link(f"{METER}:P0000003")
    assert "no device with the serial 'P0000003'" in said, said


def test_who_comes_second_hears_that_it_is_in_use(usb, meter):
    _, said = usb.link()  # by whom is not said here: umockdev hides whose node it is
    assert said.startswith("error refused ") and "in use by" in said, said
    assert value(meter.ask("ask MEAS:POW?")) == 1
    assert meter.close() == 0
    assert value(usb.open().ask("ask MEAS:POW?")) == 2


def open_to_all(testbed):
    """Its sockets too, which are in folders of their own."""
    for folder, _, files in os.walk(testbed):
        os.chmod(folder, 0o777)
        for path in (os.path.realpath(f"{folder}/{name}") for name in files if "/ioctl" in folder):
            os.chmod(path, 0o777)
            os.chmod(os.path.dirname(path), 0o777)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody without permission")
def test_who_may_not_open_it_hears_which_rule_is_missing(usb):
    usb.tell("plug 0 1 2")
    open_to_all(usb.env["UMOCKDEV_DIR"])
    os.chmod(usb.env["UMOCKDEV_DIR"] + "/dev/bus/usb/001/002", 0o600)
    try:
        done = subprocess.run([BUILD / "tests/linkask", METER], user=65534, group=65534, extra_groups=[],
                              env={**os.environ, **usb.env, "LD_PRELOAD": preload(BUILD / "tests/linkask")},
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=20, check=False)
    except PermissionError:
        pytest.skip("the build is closed to others")
    assert done.stdout.startswith("error refused ") and "permission denied on /dev/bus/usb/001/002" in done.stdout
    assert 'ATTR{idVendor}=="1313", ATTR{idProduct}=="8072"' in done.stdout


def test_nothing_there_is_said(usb):
    _, said = usb.link()
    assert said.startswith("error gone ") and "is it plugged in and switched on?" in said, said


def ask_as_pyvisa(usb, resource, *lines):
    """What a program of these lines prints; meter is what pyvisa-py opened."""
    if not os.environ.get("CI"):
        pytest.importorskip("pyvisa_py")
    program = ["import sys, pyvisa", 'meter = pyvisa.ResourceManager("@py").open_resource(sys.argv[1])',
               "meter.timeout = 2000", *lines, "meter.close()"]
    peer = subprocess.run([sys.executable, "-c", "\n".join(program), resource],
                          env={**os.environ, **usb.env, "LD_PRELOAD": PRELOAD}, timeout=30,
                          capture_output=True, text=True, check=False)
    assert peer.returncode == 0, peer.stderr
    return peer.stdout.split("\n")[:-1]


def test_an_independent_peer_understands_the_device(usb):
    usb.tell("plug 0 1 2")
    assert ask_as_pyvisa(usb, "USB0::0x1313::0x8072::P0000001::INSTR",
                         'print(meter.query("*IDN?").strip())',
                         'meter.write("SENS:CORR:WAV 633")',
                         'print(float(meter.query("SENS:CORR:WAV?")))',
                         'for i in range(3): print(round((float(meter.query("MEAS:POW?")) - 1e-3) * 1e9))',
                         'meter.write("LONG? 5000")',
                         'print(len(meter.read_raw()))') == [IDENTITY, "633.0", "1", "2", "3", "5000"]


# --- the meter that is made from its profile -------------------------------------------------------

PROFILED = "Thorlabs,PM100D,P0012345,2.4.0"


@pytest.fixture
def profiled(usb):
    """What `gonio profile sim thorlabs-pm100` serves, plugged in at the link that the profile names."""
    device = usb.tell(f"profile {ROOT}/configs/profiles/thorlabs-pm100.cfg")
    usb.tell(f"plug {device} 1 5")
    return device


def test_pyvisa_reads_and_sets_the_meter_made_from_its_profile(usb, profiled):
    usb.tell(f"set {profiled} power_w = 0.00025")
    assert ask_as_pyvisa(usb, "USB0::0x1313::0x8078::P0012345::INSTR",
                         r'meter.write_termination = "\n"',  # as the profile says
                         'print(meter.query("*IDN?").strip())',
                         'print(meter.query("SYST:SENS:IDN?").strip())',
                         'print(float(meter.query("READ?")))',
                         'meter.write("SENS:CORR:WAV 1310")',
                         'print(float(meter.query("SENS:CORR:WAV?")))',
                         'print(meter.query("SYST:ERR?").strip())',
                         'meter.write("WHAT IS THIS")',
                         'print(meter.query("SYST:ERR?").strip())',
                         'print(meter.query("SYST:ERR?").strip())') == [
        PROFILED, "S132C,210101,01-JAN-2026,1,2,33", "0.00025", "1310.0", '0,"No error"',
        '-113,"Undefined header"', '0,"No error"']


def test_gonios_driver_reads_the_meter_made_from_its_profile(usb, profiled, start_sim, start_daemon, tmp_path):
    usb.tell(f"set {profiled} power_w = 0.00025")
    sim = start_sim("--fast", *QUICK_LASER)
    bench = tmp_path / "goniod.cfg"
    text, count = re.subn(r'(detector: \{[^}]*?driver = )"\w+"(.*?link = )"[^"]*"',
                          r'\1"thorlabs-pm100"\2"usbtmc:1313:8078:P0012345"',
                          (sim.folder / "goniod-tcp.cfg").read_text(), flags=re.S)
    assert count == 1
    bench.write_text(re.sub(r"monitor_aux = \d", "monitor_aux = 0", text))
    daemon = start_daemon("--config", bench, env={**usb.env, "LD_PRELOAD": preload(BUILD / "goniod")})

    def seen():
        return next(d for d in daemon.status()["devices"] if d["name"] == "detector")

    assert seen()["link"] == "ok", seen()
    assert seen()["identity"] == "Thorlabs PM100D, serial P0012345, head S132C 210101"
    wait_for(lambda: seen()["signal_v"] == 0.00025)
    usb.tell(f"set {profiled} power_w = 0.0005")
    wait_for(lambda: seen()["signal_v"] == 0.0005)
    assert ask_errors(daemon) == {}


def ask_errors(daemon):
    """What went wrong on the detector's link, by kind."""
    status, reply = daemon.request("GET", "/api/v1/devices")
    assert status == 200
    (detector,) = [d for d in reply["devices"] if d["kind"] == "detector"]
    return {kind: n for kind, n in detector["traffic"]["errors"].items() if n}


# --- through a guard process -----------------------------------------------------------------------

def wavelength_nm(client):
    return round(float(re.match(r"ok (\S+) \(", client.ask("ask SENS:CORR:WAV?")).group(1)))


def reads_1234(usb):
    """What the meter is set to, by a client of its own, as soon as the guard has let it go."""
    client, said = usb.link()
    return said.startswith("ok open") and wavelength_nm(client) == 1234


def test_over_usb_a_guard_lets_questions_and_answers_pass(usb):
    usb.tell("plug 0 1 2")
    meter = usb.guarded()
    assert meter.ask("off").startswith("ok")
    assert wavelength_nm(meter) == 1234  # its first bytes were OFF
    assert meter.ask("ask *IDN?").startswith(f"ok {IDENTITY} ")
    said = meter.ask("bytes LONG? 5000")
    text = bytes(ord("a") + i % 26 for i in range(4999)) + b"\n"
    assert said.startswith(f"ok 5000 {crc32c(text):08x} "), said
    assert meter.ask("ask NONSENSE?").startswith("error")
    assert meter.ask("ask *IDN?").startswith(f"ok {IDENTITY} ")


def test_over_usb_a_lease_that_runs_out_means_off(usb):
    usb.tell("plug 0 1 2")
    meter = usb.guarded()
    assert meter.ask("off").startswith("ok")
    assert meter.ask("send SENS:CORR:WAV 1550").startswith("ok")
    for _ in range(10):
        assert meter.ask("renew").startswith("ok")
        time.sleep(0.1)
    assert wavelength_nm(meter) == 1550
    time.sleep(1.0)
    refused = meter.ask("ask SENS:CORR:WAV?")
    assert refused.startswith("error refused") and "0.5 s" in refused, refused
    assert meter.ask("off").startswith("ok")
    assert wavelength_nm(meter) == 1234


def test_over_usb_a_death_means_off(usb):
    usb.tell("plug 0 1 2")
    meter = usb.guarded()
    assert meter.ask("off").startswith("ok")
    assert meter.ask("send SENS:CORR:WAV 1550").startswith("ok")
    assert wavelength_nm(meter) == 1550
    usb.clients.remove(meter)
    meter.end(signal.SIGKILL)
    wait_for(lambda: reads_1234(usb))
