# SPDX-License-Identifier: MIT
"""Serial ports by the real libserialport: USB adapters (tests/usb/ttyserver) on nodes of umockdev with an instrument of
goniosim behind each, found by the numbers that sysfs shows, whatever their names in /dev are."""
import re

import pytest

from conftest import BUILD, QUICK_LASER, gonio
from mockbus import Usb, needs_umockdev, preload
from relay import Relay, port_of

pytestmark = needs_umockdev
LINK = "serial:usb-0403:6001"


@pytest.fixture
def usb(tmp_path):
    bus = Usb(tmp_path)
    yield bus
    bus.close()


@pytest.fixture
def lock_in(usb, start_sim):
    """An SR830 of goniosim on the pty behind an adapter that is not plugged in yet."""
    relay = Relay(port_of(start_sim("--fast", *QUICK_LASER), "detector-tcp"))
    relay.plug()
    yield relay
    relay.close()


def plug(usb, number, serial, pty, product="6001"):
    usb.tell(f"plug-tty {number} 9 {number + 2} 0403 {product} {serial} {pty}")


def test_libserialport_opens_it_by_its_numbers_and_it_answers(usb, lock_in):
    plug(usb, 4, "A50285BI", lock_in.pty)
    client = usb.open(f"{LINK}:A50285BI?baud=9600", "cr")
    assert client.ask("ask OUTX 0;*IDN?").startswith("ok Stanford_Research_Systems,SR830,s/n43480,ver1.07")
    assert int(usb.tell("seen-tty 4")) > 0, "not the library: termios alone asks no modem lines"
    assert client.close() == 0
    before = int(usb.tell("seen-tty 4"))
    client = usb.open(f"{LINK}?baud=9600", "cr")  # the only one with these numbers
    assert client.ask("ask *IDN?").startswith("ok Stanford")
    assert int(usb.tell("seen-tty 4")) > before


def test_it_is_looked_for_again_at_each_opening(usb, lock_in):
    plug(usb, 0, "A50285BI", lock_in.pty)
    client = usb.open(f"{LINK}:A50285BI?baud=9600", "cr")
    assert client.ask("ask OUTX 0;*IDN?").startswith("ok Stanford")
    lock_in.unplug()
    usb.tell("unplug-tty 0")
    said = client.ask("ask *IDN?")
    assert said.startswith("error gone ") and "unplugged" in said, said
    assert "no such port" in client.ask("reopen")
    other = lock_in.pty
    lock_in.plug()
    assert lock_in.pty != other
    plug(usb, 3, "A50285BI", lock_in.pty)
    assert client.ask("reopen").startswith("ok")
    assert client.ask("ask OUTX 0;*IDN?").startswith("ok Stanford")
    assert int(usb.tell("seen-tty 3")) > 0


def test_which_are_there_is_said_when_none_fits_or_several_do(usb, lock_in):
    _, said = usb.link(f"{LINK}:A1")
    assert said.startswith("error gone ") and "no USB serial adapter is plugged in" in said, said
    plug(usb, 0, "A1", lock_in.pty)
    plug(usb, 5, "A2", lock_in.pty)
    plug(usb, 2, "-", lock_in.pty, "6015")
    _, said = usb.link(f"{LINK}:A3")
    assert said.startswith("error gone usb-0403:6001:A3: no such port: no adapter with these numbers; there is "
                           "usb-0403:6001:A1 (/dev/ttyUSB0), usb-0403:6015 (/dev/ttyUSB2), "
                           "usb-0403:6001:A2 (/dev/ttyUSB5)"), said
    _, said = usb.link(LINK)
    assert said.startswith("error input usb-0403:6001: 2 ports have these numbers: usb-0403:6001:A1 (/dev/ttyUSB0), "
                           "usb-0403:6001:A2 (/dev/ttyUSB5); give the serial number too"), said
    plug(usb, 3, "A2", lock_in.pty)
    _, said = usb.link(f"{LINK}:A2")
    assert said.startswith("error input ") and "a path in /dev/serial/by-path" in said, said


def test_who_comes_second_hears_who_has_it(usb, lock_in):
    plug(usb, 0, "A1", lock_in.pty)
    client = usb.open(f"{LINK}:A1?baud=9600", "cr")
    _, said = usb.link(f"{LINK}:A1?baud=9600")
    assert said.startswith(f"error refused usb-0403:6001:A1: in use by pid {client.pid} (linkask)"), said


def test_doctor_lists_the_adapters_as_links_name_them(usb, lock_in, tmp_path, start_sim):
    plug(usb, 7, "A50285BI", lock_in.pty)
    sim = start_sim("--fast", folder=tmp_path / "another")
    bench = tmp_path / "goniod.cfg"
    bench.write_text(re.sub(r"tcp:127.0.0.1:%d" % port_of(sim, "detector-tcp"), "serial:usb-0403:6001:A1?baud=9600",
                            (sim.folder / "goniod-tcp.cfg").read_text()))
    done = gonio("doctor", bench, env={**usb.env, "LD_PRELOAD": preload(BUILD / "gonio")})
    assert done.returncode == 1, done.stdout
    (row,) = [line for line in done.stdout.splitlines() if line.startswith("detector\t")]
    assert "no such port" in row and "usb-0403:6001:A50285BI (/dev/ttyUSB7)" in row, row
