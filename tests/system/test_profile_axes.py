# SPDX-License-Identifier: MIT
"""Axes by their profiles: the daemon moves a controller that pymodbus serves, over TCP and RTU, and a whole bench of
another make."""
import asyncio
import os
import re
import select
import threading
import time
import tty

import pytest
from pymodbus.datastore import ModbusServerContext, ModbusSlaveContext
from pymodbus.datastore.store import BaseModbusDataBlock
from pymodbus.server.async_io import ModbusSerialServer, ModbusTcpServer
from pymodbus.transaction import ModbusRtuFramer

from conftest import PATIENCE_S, QUICK_LASER, query, wait_for

TINY = """\
campaign: {
  name = "tiny";
  theta_i_deg = [ 10.0 ];
  theta_r: { from_deg = 0.0; to_deg = 20.0; step_deg = 10.0; };
  dense: { half_width_deg = 0.0; step_deg = 1.0; };
  readings: { count = 2; };
};
"""
HOME_END, READY, MOVING, IN_POSITION = 1 << 4, 1 << 5, 1 << 13, 1 << 14
STOP, HOME = 1 << 5, 1 << 4
MOVE_S = 0.2


def pair(value):
    return [value >> 16 & 0xFFFF, value & 0xFFFF]


def signed(registers):
    value = registers[0] << 16 | registers[1]
    return value - (1 << 32) if value >> 31 else value


class Axis(BaseModbusDataBlock):
    """The registers of an AZ driver that gonio's profile uses, written for this test: each move takes 0.2 s."""

    def __init__(self):
        self.at, self.to, self.since, self.homed, self.input = 0, 0, 0.0, False, 0
        self.moves, self.reads = [], []

    def validate(self, address, count=1):
        known = [(0x58, 0x68), (0x7C, 0x82), (0xC6, 0xCE), (0x180, 0x182)]
        return any(first <= address and address + count <= end for first, end in known)

    def travel(self):
        done = min((time.monotonic() - self.since) / MOVE_S, 1.0)
        return done, round(self.at + (self.to - self.at) * done)

    def go(self, to):
        self.at = self.travel()[1]
        self.to, self.since = to, time.monotonic()

    def value(self, address):
        done, position = self.travel()
        status = (HOME_END if self.homed else 0) | (READY | IN_POSITION if done == 1.0 else MOVING)
        return {0x7C: self.input, 0x7E: status, 0xC6: position, 0xCC: position}.get(address, 0)

    def getValues(self, address, count=1):
        self.reads.append((address, count))
        return [pair(self.value(a & ~1))[a & 1] for a in range(address, address + count)]

    def setValues(self, address, values):
        if address == 0x58 and len(values) == 16:
            assert signed(values[2:4]) == 1 and signed(values[14:16]) == 1  # absolute, starts
            self.moves.append(signed(values[4:6]))
            self.go(self.moves[-1])
        elif address in (0x7C, 0x7D):
            rising = values[-1] & ~self.input
            self.input = values[-1]
            if rising & STOP:
                self.go(self.travel()[1])
                self.since = 0.0
            if rising & HOME:
                self.homed = True
                self.go(0)


class Peer:
    """pymodbus serves an axis on a loop of its own."""

    def __init__(self, make_server):
        self.axis = Axis()
        slave = ModbusSlaveContext(hr=self.axis, zero_mode=True)
        self.context = ModbusServerContext(slaves={3: slave}, single=False)
        self.loop = asyncio.new_event_loop()
        self.ready = threading.Event()
        self.thread = threading.Thread(target=self.run, args=(make_server,))
        self.thread.start()
        assert self.ready.wait(PATIENCE_S)

    def run(self, make_server):
        asyncio.set_event_loop(self.loop)
        self.server = self.loop.run_until_complete(make_server(self.context))
        self.loop.call_soon(self.ready.set)
        self.loop.run_forever()

    async def cancel_all(self):
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def end(self):
        asyncio.run_coroutine_threadsafe(self.cancel_all(), self.loop).result(PATIENCE_S)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(PATIENCE_S)
        self.loop.close()


async def tcp_server(context, port=0):
    server = ModbusTcpServer(context, address=("127.0.0.1", port), allow_reuse_address=True)
    task = asyncio.ensure_future(server.serve_forever())
    await server.serving
    server.task = task
    return server


class Cable:
    """Two ptys whose masters are joined: what goes into one comes out of the other."""

    def __init__(self):
        self.masters, self.ends = zip(*(os.openpty() for _ in range(2)))
        for end in self.ends:
            tty.setraw(end)
        self.names = [os.ttyname(end) for end in self.ends]
        self.stop_r, self.stop_w = os.pipe()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while True:
            ready, _, _ = select.select([*self.masters, self.stop_r], [], [])
            if self.stop_r in ready:
                return
            for master in ready:
                os.write(self.masters[1 - self.masters.index(master)], os.read(master, 4096))

    def cut(self):
        os.write(self.stop_w, b"x")
        self.thread.join(PATIENCE_S)
        for fd in (*self.masters, *self.ends, self.stop_r, self.stop_w):
            os.close(fd)


def tcp_peer(port=0):
    p = Peer(lambda context: tcp_server(context, port))
    p.port = p.server.server.sockets[0].getsockname()[1]
    p.link = f"modbus-tcp:127.0.0.1:{p.port}"
    return p


@pytest.fixture(params=["tcp", "rtu"])
def peer(request):
    """An axis behind pymodbus, and its link."""
    if request.param == "tcp":
        p = tcp_peer()
        yield p
        p.end()
        return
    cable = Cable()

    async def rtu_server(context):
        server = ModbusSerialServer(context, framer=ModbusRtuFramer, port=cable.names[0], baudrate=115200)
        await server.start()
        server.task = asyncio.ensure_future(server.serve_forever())
        return server

    p = Peer(rtu_server)
    p.link = f"modbus-rtu:{cable.names[1]}?baud=115200"
    yield p
    p.end()
    cable.cut()


def axis_of(daemon, name):
    return next(a for a in daemon.status()["devices"] if a["name"] == name)


def bench_with(peer, start_sim, folder):
    """A simulated bench whose sample is moved by the peer's axis."""
    sim = start_sim("--fast", *QUICK_LASER)
    text = (sim.folder / "goniod-tcp.cfg").read_text()
    text = re.sub(r"(buses: \( \{[^}]*\})", rf'\1, {{ name = "peer"; link = "{peer.link}"; timeout_ms = 200; }}', text)
    text = re.sub(r'(name = "sample"; driver = "oriental-az"; bus = )"axes"', r'\1"peer"', text)
    (folder / "goniod.cfg").write_text(text)
    return folder / "goniod.cfg"


def test_the_daemon_moves_an_axis_that_pymodbus_serves(start_sim, start_daemon, tmp_path, peer):
    d = start_daemon("--config", bench_with(peer, start_sim, tmp_path))
    d.submit(TINY)
    wait_for(lambda: 30000 in peer.axis.moves)  # out of the beam
    wait_for(lambda: axis_of(d, "sample")["position"] == 30.0)
    assert peer.axis.homed and peer.axis.input == 0
    assert {(0x7E, 4), (0xC6, 8)} <= set(peer.axis.reads)
    assert peer.axis.moves.count(30000) == 1
    assert d.gonio("stop").returncode == 0


def test_an_axis_that_goes_away_is_lost_and_comes_back(start_sim, start_daemon, tmp_path):
    peer = tcp_peer()
    try:
        d = start_daemon("--config", bench_with(peer, start_sim, tmp_path))
        assert axis_of(d, "sample")["link"] == "ok"
    finally:
        peer.end()
    wait_for(lambda: axis_of(d, "sample")["link"] == "lost")
    peer = tcp_peer(peer.port)
    try:
        wait_for(lambda: axis_of(d, "sample")["link"] == "ok")
        assert peer.axis.reads[0] == (0x7E, 4)  # who it is, before anything is written
    finally:
        peer.end()


def test_a_bench_of_leadshine_drives_measures(start_sim, start_daemon):
    sim = start_sim("--fast", *QUICK_LASER, "--set", "axes.controller=leadshine-pr")
    assert (sim.folder / "goniod.cfg").read_text().count('driver = "leadshine-pr"') == 3
    d = start_daemon("--config", sim.folder / "goniod.cfg")
    reply = d.submit(TINY)
    d.follow(reply["event_id"]).until_state(reply["run"], "done")
    axes = sim.control(do="state")["axes"]
    assert all(a["homed"] and a["alarm"] == 0 and a["moves"] > 0 and a["ignored"] == 0 for a in axes.values())
    assert query(reply["file"], "select count(*) from reading where flags = 0")[0][0] >= 3
