# SPDX-License-Identifier: MIT
"""A simulated USB bus (tests/usb/usbsim) on nodes of umockdev: instruments of the class USBTMC and serial adapters, and
the programs that ask on it."""
import os
import re
import shutil
import subprocess

import pytest

from conftest import BUILD, Program

PRELOAD = "libumockdev-preload.so.0"
METER = "usbtmc:1313:8072"

# Where CI says that everything is installed, what is missing is a failure.
needs_umockdev = pytest.mark.skipif(
    not os.environ.get("CI") and not (shutil.which("umockdev-wrapper") and (BUILD / "tests/usbsim").exists()),
    reason="umockdev is not installed")


def preload(program):
    """What umockdev-wrapper sets; a program with AddressSanitizer wants that before all others."""
    needs = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    asan = re.search(r"=> (\S*libasan\S*)", needs)
    return f"{asan.group(1)} {PRELOAD}" if asan else PRELOAD


class Dialogue(Program):
    """A program that answers each line with a line."""

    def __init__(self, argv, log, env, cwd=None):
        super().__init__(argv, log, env={"LD_PRELOAD": preload(argv[0]), **env}, stdin=subprocess.PIPE, cwd=cwd)

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def hear(self):
        return self.wait_line("")

    def ask(self, line):
        self.say(line)
        return self.hear()

    def close(self):
        self.process.stdin.close()
        return self.process.wait(10)


class Usb:
    """The simulated bus and whoever asks on it."""

    def __init__(self, folder):
        self.folder = folder
        self.simulator = Dialogue([BUILD / "tests/usbsim"], folder / "usbsim.log", {})
        self.env = {"UMOCKDEV_DIR": self.simulator.wait_line("dir ")[4:]}
        self.clients = []

    def tell(self, line):
        said = self.simulator.ask(line)
        assert said.startswith("ok"), f"{line}: {said}"
        return said[3:]

    def seen(self, request):
        return int(self.tell(f"seen 0 {request}"))

    def link(self, text=METER, *ends):
        """The client and what it said when it opened the link."""
        client = Dialogue([BUILD / "tests/linkask", text, *ends], self.folder / "linkask.log", self.env)
        said = client.hear()
        if said.startswith("ok open"):
            self.clients.append(client)
        else:
            assert client.process.wait(10) == 1
        return client, said

    def guarded(self):
        """A client whose device is held by a guard process."""
        client = Dialogue([BUILD / "tests/linkask", METER, BUILD / "gonio-guard"], self.folder / "linkask.log", self.env,
                          self.folder)
        self.clients.append(client)
        said = client.hear()
        assert said.startswith("ok open"), said
        return client

    def open(self, text=METER, *ends):
        client, said = self.link(text, *ends)
        assert said.startswith("ok open"), said
        return client

    def close(self):
        for client in self.clients:
            if client.process.poll() is None:
                assert client.close() == 0, client.errors()
        assert self.simulator.close() == 0, self.simulator.errors()
