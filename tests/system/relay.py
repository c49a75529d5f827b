# SPDX-License-Identifier: MIT
"""A serial adapter in front of an instrument of goniosim: a pty, under another name after each time it is plugged in,
whose bytes go to the instrument's TCP port and back. It keeps what the host said, and can answer for another device."""
import os
import select
import socket
import threading
import tty

from conftest import PATIENCE_S, wait_for


def port_of(sim, wire):
    return int(sim.control(do="state")["wires"][wire]["address"].rsplit(":", 1)[1])


class Relay:
    def __init__(self, port):
        self.port = port
        self.heard = []  # of each time it was plugged in, the host's bytes
        self.answers = []  # and the instrument's, as the host got them
        self.swap = None  # (bytes, bytes): in answers, while another device is there
        self.pty = None  # its name; the last one while it is unplugged
        self.spare = []  # keeps names in use
        self.fds = None

    def plug(self):
        assert self.fds is None
        master, slave = os.openpty()
        if os.ttyname(slave) == self.pty:
            self.spare.append((master, slave))
            master, slave = os.openpty()
        self.pty = os.ttyname(slave)
        tty.setraw(slave)
        line = None

        def connected():
            nonlocal line
            try:
                line = socket.create_connection(("127.0.0.1", self.port), PATIENCE_S)
            except ConnectionError:
                return False
            return True

        wait_for(connected)
        self.heard.append(bytearray())
        self.answers.append(bytearray())
        self.fds = master, slave, line
        self.quit, tell = os.pipe()
        self.tell = tell
        self.thread = threading.Thread(target=self._carry, args=(master, line, self.quit), daemon=True)
        self.thread.start()

    def unplug(self):
        """Whoever has the pty open sees it hang up."""
        if self.fds is None:
            return
        os.close(self.tell)
        self.thread.join(PATIENCE_S)
        master, slave, line = self.fds
        os.close(self.quit)
        os.close(slave)
        os.close(master)
        line.close()
        self.fds = None

    def _carry(self, master, line, quit_fd):
        heard, answers = self.heard[-1], self.answers[-1]
        while True:
            ready, _, _ = select.select([master, line, quit_fd], [], [])
            if quit_fd in ready:
                return
            if master in ready:
                data = os.read(master, 4096)
                heard += data
                line.sendall(data)
            if line in ready:
                data = line.recv(4096)
                if not data:
                    return
                if self.swap:
                    data = data.replace(*self.swap)
                answers += data
                os.write(master, data)

    def close(self):
        self.unplug()
        for fds in self.spare:
            for fd in fds:
                os.close(fd)
